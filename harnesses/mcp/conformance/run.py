"""Run the official conformance suite on the server: python harnesses/mcp/conformance/run.py

The server with the suite's fixtures (server.py) must pass every scenario, and `humanclaw mcp` as shipped every scenario
without a fixture. Needs npx and the npm registry. npx installs Node too: the suite needs a newer one than many systems
have.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

SUITE = "@modelcontextprotocol/conformance"
NODE = "node@22"
HERE = Path(__file__).parent
FIXTURES = (str(HERE / "server.py"),)
SHIPPED = ("-m", "humanclaw", "mcp", "--http", "--port", "0")
NEWEST = ("0.2.0-alpha.12", "--spec-version", "2025-11-25")
"""The newest suite, a pre-release. It also tests a sessionless protocol, which the server refuses over HTTP."""
RELEASED = ("0.1.16", "--expected-failures", str(HERE / "expected-failures.yml"))
AS_SHIPPED = (
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
    faults = 0
    with started(FIXTURES) as url:
        for suite in (NEWEST, RELEASED):
            faults += check(f"With the suite's fixtures, suite {suite[0]}", url, *suite, "--suite", "all")
    with started(SHIPPED) as url:
        for scenario in AS_SHIPPED:
            faults += check(f"As it is shipped: {scenario}", url, *NEWEST, "--scenario", scenario)
    print(f"\n{faults or 'No'} run(s) with unexpected results.")
    return min(faults, 1)


@contextmanager
def started(arguments: tuple[str, ...]) -> Iterator[str]:
    with subprocess.Popen([sys.executable, *arguments], stderr=subprocess.PIPE, text=True) as server:
        try:
            yield url_of(server)
        finally:
            server.terminate()


def url_of(server: subprocess.Popen[str]) -> str:
    """Return the address that the server prints."""
    assert server.stderr
    for line in server.stderr:
        if found := re.search(r"http://\S+", line):
            return found[0]
    raise SystemExit("the server did not start")


def check(title: str, url: str, version: str, *options: str) -> bool:
    """Run scenarios; return whether a result differs from the expected ones."""
    print(f"\n== {title} ==", flush=True)
    suite = ["conformance", "server", "--url", url, *options]
    with tempfile.TemporaryDirectory() as scratch:  # The suite may leave results where it runs.
        npx = ["npx", "--yes", "-p", NODE, "-p", f"{SUITE}@{version}", *suite]
        return subprocess.run(npx, cwd=scratch, check=False).returncode != 0


if __name__ == "__main__":
    sys.exit(main())
