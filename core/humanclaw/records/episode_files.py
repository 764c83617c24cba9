"""Read and write files of episodes, one a line."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from humanclaw.errors import HumanclawError
from humanclaw.records.specification import EpisodeSpec
from humanclaw.storage.files import MIB, Folder, read_file, writing
from humanclaw.text.json import first_fault, once

SPLIT: Final = 64 * MIB
"""Maximum bytes of a file of episodes; 1,218 episodes take half a MiB."""


def read_episodes(path: Path | str, data: bytes | None = None) -> tuple[EpisodeSpec, ...]:
    """Read a file of episodes, one a line. data: its content, if it has been read.

    Raises HumanclawError for an unreadable file, a malformed line, or an id that occurs twice. Ids name folders, so
    they are compared without regard to case.
    """
    try:
        data = read_file(Path(path), SPLIT) if data is None else data
    except OSError as error:
        raise HumanclawError(f"{path} cannot be read: {error.strerror}.", "Name a file of episodes.") from error
    if not data.strip():
        raise HumanclawError(f"{path} holds no episode.", "Write one a line, as JSON: see docs/records.md.")
    lines = data.removesuffix(b"\n").split(b"\n")
    specs = tuple(_spec(line, f"{path}:{number}") for number, line in enumerate(lines, 1))
    first: dict[str, int] = {}
    for number, spec in enumerate(specs, 1):
        if first.setdefault(spec.id.lower(), number) != number:
            reason = f"{path}:{number} holds the id {spec.id!r} of line {first[spec.id.lower()]} again."
            raise HumanclawError(reason, "Give every episode an id of its own.")
    return specs


def _spec(line: bytes, where: str) -> EpisodeSpec:
    try:
        spec = EpisodeSpec.model_validate_json(line)
        json.loads(line, object_pairs_hook=once)
    except ValidationError as error:
        fields = EpisodeSpec.model_fields
        remedy = f"A line is a JSON object with {', '.join(fields)}: see docs/records.md."
        if "start" in error.errors()[0]["loc"]:
            remedy = "A start has x, z and yaw, and floor, the height of the ground there."
        raise HumanclawError(f"{where} is not an episode: {first_fault(error, fields)}.", remedy) from error
    except KeyError as error:
        raise HumanclawError(f"{where} holds the key {error} twice.", "Keep one of the two.") from error
    return spec


def write_episodes(path: Path | str, specs: Sequence[EpisodeSpec]) -> None:
    """Write episodes to a file, one a line. Raises RecordError if it cannot be written."""
    lines = (spec.model_dump_json(exclude_defaults=True) + "\n" for spec in specs)
    path = Path(path)
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        Folder(path.parent).write(path.name, "".join(lines).encode())
