"""three.js, taken from an installed package, so that this project holds no third-party script.

trimesh has a built three.js (MIT) in the template of its own viewer. The library is one line below its licence comment.
"""

from __future__ import annotations

import functools
import io
import re
import zipfile
from importlib.metadata import distribution  # Which imports nothing: trimesh takes a fifth of a second.
from pathlib import Path
from typing import Final

from humanclaw import HumanclawError

_LIBRARY: Final = re.compile(r"/\*\*\n \* @license\n(?: \*[^\n]*\n)*? \*/\n[^\n]*\.THREE=\{\}[^\n]*")


@functools.cache
def three() -> str:
    """Return the script of three.js with its licence notice. Raises HumanclawError if trimesh does not hold it."""
    archive = Path(str(distribution("trimesh").locate_file("trimesh/resources/templates/viewer.zip")))
    library = None
    if archive.is_file():
        with zipfile.ZipFile(io.BytesIO(archive.read_bytes())) as files:
            text = "\n".join(files.read(name).decode() for name in files.namelist())
        library = _LIBRARY.search(text)
    if library is None:
        raise HumanclawError(
            "the installed trimesh holds no three.js.", "Install another version: pip install trimesh==5.2.0."
        )
    return library[0]
