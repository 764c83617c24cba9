"""Lock what is installed here with the hashes of its wheels: `python lock.py FILE`. Needs the network."""

from __future__ import annotations

import hashlib
import subprocess
import sys
import tempfile
from pathlib import Path

from packaging.utils import parse_wheel_filename

HEAD = """\
# The versions that .ci/run installs. `make lock` writes them.
# The hashes are of wheels for Python 3.11 on Linux, x86-64.
# torch is left out: its build and its index depend on the machine.
"""
NOT_LOCKED = ("humanclaw", "pip==", "torch==")


def pins() -> list[str]:
    """Return the installed packages as name==version, without our own, pip and torch."""
    command = [sys.executable, "-m", "pip", "list", "--format=freeze"]
    lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
    return [line for line in lines if not line.startswith(NOT_LOCKED)]


def locked(wheel: Path) -> str:
    """Return the two lines of a wheel: name and version, then its hash."""
    name, version, *_ = parse_wheel_filename(wheel.name)
    return f"{name}=={version} \\\n    --hash=sha256:{hashlib.sha256(wheel.read_bytes()).hexdigest()}\n"


def main(out: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        given = ["--quiet", "--no-deps", "--only-binary=:all:", "--dest", folder]
        subprocess.run([sys.executable, "-m", "pip", "download", *given, *pins()], check=True)
        out.write_text(HEAD + "".join(sorted(map(locked, Path(folder).iterdir()))), "utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
