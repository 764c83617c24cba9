"""The header of a checkpoint, read without its weights and without torch: what registering a skill can afford to look at."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from safetensors.numpy import load_file

from humanclaw.errors import CheckpointError

KEY: Final = "humanclaw"
"""The metadata key of safetensors under which the header stands, as JSON."""
FORMAT: Final = 1
_LARGEST: Final = 100_000_000
"""Bytes that safetensors allows itself for names, shapes and metadata."""


def shipped_base() -> Path:
    """Where the weights of the shipped prior lie."""
    return Path(__file__).parent / "weights" / "base.safetensors"


def read_header(path: Path, remedy: str = "Train it with: humanclaw train") -> dict[str, Any]:
    """The header of a base or an adapter. A file that was cut off is found out, broken numbers are not (`non_finite`).

    Raises CheckpointError, with the remedy, for a file that is missing, broken or no checkpoint of this format.
    """
    content = _directory(path, remedy)
    note = content.get("__metadata__", {}).get(KEY)
    if note is None:
        raise CheckpointError(f"{path} is a safetensors file, but no checkpoint of HumanCLAW.", remedy)
    header: dict[str, Any] = json.loads(note)
    if header.get("format") != FORMAT:
        found = f"{path} has checkpoint format {header.get('format')}; this version reads format {FORMAT}."
        raise CheckpointError(found, remedy)
    return header


def _directory(path: Path, remedy: str) -> Mapping[str, Any]:
    """The JSON that a safetensors file begins with: 8 bytes of length, then names, types and places of the tensors."""
    if not path.is_file():
        raise CheckpointError(f"There is no checkpoint at {path}.", remedy)
    try:
        with path.open("rb") as file:
            length = int.from_bytes(file.read(8), "little")
            content: dict[str, Any] = json.loads(file.read(min(length, _LARGEST)))
        ends = [part["data_offsets"][1] for name, part in content.items() if name != "__metadata__"]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise CheckpointError(f"{path} cannot be read as a checkpoint ({error}).", remedy) from error
    if path.stat().st_size != 8 + length + max(ends, default=0):
        raise CheckpointError(f"{path} cannot be read as a checkpoint (it was cut off).", remedy)
    return content


def non_finite(path: Path) -> tuple[str, ...]:
    """The tensors of a checkpoint that hold NaN or infinity; this reads all of its weights."""
    return tuple(name for name, tensor in load_file(path).items() if not np.isfinite(tensor).all())
