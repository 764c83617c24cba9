"""Run the official conformance suite on the server: python harnesses/mcp/conformance/run.py

`humanclaw mcp` must pass every scenario that needs no fixture. The others call tools of the suite's own names, such as
`test_image_content`, and so test the SDK; the tests of this package cover these features under the server's names.
Needs npx and the npm registry. npx installs Node too: the suite needs a newer one than many systems have.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[3] / "tests" / "support"))
from clients import serving

SUITE = "@modelcontextprotocol/conformance"
NODE = "node@22"
SERVER = ("-m", "humanclaw", "mcp")
VERSION = "0.2.0-alpha.12"
"""The newest suite, a pre-release. It also tests a sessionless protocol, which the server refuses over HTTP."""
PROTOCOL = "2025-11-25"
SCENARIOS = (
    "server-initialize",
    "server-session-lifecycle",
    "logging-set-level",
    "ping",
    "tools-list",
    "server-sse-multiple-streams",
    "resources-list",
    "prompts-list",
    "dns-rebinding-protection",
)
"""Scenarios without a fixture."""


def main() -> int:
    with serving(*SERVER) as url:
        faults = sum(check(scenario, url) for scenario in SCENARIOS)
    print(f"\n{faults or 'No'} scenario(s) with unexpected results.")
    return min(faults, 1)


def check(scenario: str, url: str) -> bool:
    """Run a scenario; return whether it fails."""
    print(f"\n== {scenario} ==", flush=True)
    suite = ["conformance", "server", "--url", url, "--spec-version", PROTOCOL, "--scenario", scenario]
    with tempfile.TemporaryDirectory() as scratch:  # The suite may leave results where it runs.
        npx = ["npx", "--yes", "-p", NODE, "-p", f"{SUITE}@{VERSION}", *suite]
        return subprocess.run(npx, cwd=scratch, check=False).returncode != 0


if __name__ == "__main__":
    sys.exit(main())
