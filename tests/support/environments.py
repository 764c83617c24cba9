"""Virtual environments for tests that install something."""

from __future__ import annotations

import os
import site
import subprocess
import sys
from pathlib import Path


def like_this(folder: Path) -> dict[str, str]:
    """Make an environment that also sees every package installed here.

    Return the variables with which a process finds its `python`, `pip`, `humanclaw` and `pytest`.
    """
    subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
    here = [path for path in sys.path if path.endswith("-packages")] + site.getsitepackages()
    (packages,) = folder.glob("[Ll]ib/**/site-packages")
    lines = [f"import site; site.addsitedir({path!r})" for path in dict.fromkeys(here)]
    (packages / "here.pth").write_text("\n".join(lines))
    binaries = folder / ("Scripts" if os.name == "nt" else "bin")
    for name in ("humanclaw", "pytest"):
        (binaries / name).write_text(f'#!/bin/sh\nexec "{binaries}/python" -m {name} "$@"\n')
        (binaries / name).chmod(0o755)
    return os.environ | {"PATH": f"{binaries}{os.pathsep}{os.environ['PATH']}", "OMP_NUM_THREADS": "1"}
