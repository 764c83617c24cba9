"""What the standard library raises for a damaged zip archive."""

from __future__ import annotations

import lzma
import zipfile
import zlib
from typing import Final

DAMAGED: Final = (zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, RuntimeError, UnicodeDecodeError, OSError)
"""RuntimeError: encrypted, or an unknown compression. UnicodeDecodeError: the name of a file. zipfile's documentation
names the first alone."""
