"""Hold the server to the official conformance suite: python harnesses/mcp/conformance/run.py

Needs npx and the npm registry. The suite wants a newer Node than many systems have, so npx brings one along.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

SUITE = "@modelcontextprotocol/conformance@0.1.16"
NODE = "node@22"
EXPECTED = Path(__file__).with_name("expected-failures.yml")


def main() -> int:
    command = [sys.executable, "-m", "humanclaw", "mcp", "--http", "--port", "0"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as server:
        try:
            return check(url_of(server))
        finally:
            server.terminate()


def url_of(server: subprocess.Popen[str]) -> str:
    """The address that the server tells once it listens."""
    assert server.stderr
    for line in server.stderr:
        if found := re.search(r"http://\S+", line):
            return found[0]
    raise SystemExit("the server did not start")


def check(url: str) -> int:
    """Run every scenario; 0 if none fails that is not expected to."""
    options = ["--url", url, "--suite", "all", "--expected-failures", str(EXPECTED)]
    with tempfile.TemporaryDirectory() as scratch:  # The suite may leave results where it runs.
        npx = ["npx", "--yes", "-p", NODE, "-p", SUITE, "conformance", "server", *options]
        return subprocess.run(npx, cwd=scratch, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
