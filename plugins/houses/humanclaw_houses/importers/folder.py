"""A folder of models without a catalogue, such as Kenney's Furniture Kit, or with a CSV table."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from humanclaw import HumanclawError
from humanclaw.storage import read_file
from humanclaw_houses.importers.source_models import Collection, SourceModel
from humanclaw_houses.importers.sweethome import rotation_of, slug

SUFFIXES: Final = (".glb", ".gltf", ".obj")
COLUMNS: Final = "file, name, category, creator, licence, width_m, height_m, depth_m, catalogue_rotation"
_BESIDE: Final = (".collision.", ".hulls.")
"""Parts of file names that mark the collision shapes of another model."""


@dataclass(frozen=True)
class FolderMetadata:
    """Metadata that the user gives for all models of a folder, and a table with metadata of each."""

    licence: str = ""
    author: str = ""
    front: str = "+z"
    table: Path | None = None


def open_folder(source: Path, name: str, metadata: FolderMetadata) -> Collection:
    """Return every GLB, glTF and OBJ under a folder. Models that the table does not name are included."""
    rows = _rows(metadata.table, source) if metadata.table else {}
    paths = sorted(path for path in source.rglob("*") if path.suffix.lower() in SUFFIXES)
    paths = [path for path in paths if not any(mark in path.name for mark in _BESIDE)]
    models = [_model(path, path.relative_to(source), rows.get(path.resolve(), {}), metadata) for path in paths]
    return Collection(name or source.resolve().name, models)


def _model(path: Path, inside: Path, row: Mapping[str, str], metadata: FolderMetadata) -> SourceModel:
    stem = inside.with_suffix("")
    # chair/chair.glb is the model "chair": collections often keep each model in a folder of its name.
    parts = stem.parts[:-1] if len(stem.parts) > 1 and stem.parts[-1] == stem.parts[-2] else stem.parts
    try:
        size = tuple(float(row[key]) for key in ("width_m", "height_m", "depth_m"))
    except (KeyError, ValueError):
        size = None
    return SourceModel(
        id=slug("-".join(parts)),
        name=row.get("name") or parts[-1].split(".")[0],
        fetch=lambda _: path,
        group=row.get("category", "").replace("_", " "),
        size=size,  # type: ignore[arg-type]
        rotation=rotation_of(row.get("catalogue_rotation", "")),
        front=metadata.front,
        author=row.get("creator") or metadata.author,
        licence=row.get("licence") or metadata.licence or "LicenseRef-unknown",
    )


def _rows(table: Path, source: Path) -> dict[Path, dict[str, str]]:
    """Return model path to its row of a table. Paths in the table are relative to the table or to the folder."""
    try:
        text = read_file(table, 1 << 24).decode("utf-8")
        rows = list(csv.DictReader(io.StringIO(text, newline="")))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise HumanclawError(f"cannot read the table {table}: {error}.", f"It is a CSV file with {COLUMNS}.") from error
    if not rows or "file" not in rows[0]:
        raise HumanclawError(f"{table} has no column `file`.", f"It needs `file`; all columns are {COLUMNS}.")
    found: dict[Path, dict[str, str]] = {}
    for row in rows:
        for base in (table.parent, source):
            found.setdefault((base / row["file"]).resolve(), row)
    return found
