"""Writing files so that nobody ever reads half of one."""

from __future__ import annotations

from pathlib import Path


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file: a reader sees the old one or the whole new one. The folder must exist. Raises OSError."""
    partial = path.with_name(path.name + ".partial")
    partial.write_bytes(data)
    partial.replace(path)
