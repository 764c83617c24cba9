"""Build a wheel of every distribution of this repository: `python wheels.py FOLDER`. Needs hatchling."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def distributions() -> list[Path]:
    """Return the folders of all distributions, the core's first."""
    files = (file for kind in ("plugins", "skills", "harnesses") for file in ROOT.glob(f"{kind}/*/pyproject.toml"))
    return [ROOT, *sorted(file.parent for file in files)]


def build(folder: Path) -> list[Path]:
    """Build every wheel into a folder; return their paths."""
    command = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(folder.absolute())]
    for distribution in distributions():
        subprocess.run(command, cwd=distribution, check=True, capture_output=True)
    return sorted(folder.glob("*.whl"))


if __name__ == "__main__":
    for wheel in build(Path(sys.argv[1])):
        print(f"{wheel.stat().st_size / 1e6:6.1f} MB  {wheel.name}")
