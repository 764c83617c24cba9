"""Sweet Home 3D furniture libraries: a zip file, or its unpacked folder, with a catalogue in Java's properties format.

Models have +Y up and their front to +Z. The catalogue gives each its size in centimetres and some a rotation.
"""

from __future__ import annotations

import functools
import re
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path, PurePosixPath
from typing import Final

from humanclaw import HumanclawError
from humanclaw_houses.importers.source_models import Collection, SourceModel

CATALOGUE: Final = "PluginFurnitureCatalog.properties"
_LICENCES: Final = (
    (r"public domain|cc-?0", "CC0-1.0"),
    (r"creative commons attribution 3\.0 us|by/3\.0/us", "CC-BY-3.0-US"),
    (r"creative commons (attribution )?3\.0|cc[ -]by|by/3\.0", "CC-BY-3.0"),
    (r"creative commons attribution 4\.0|by/4\.0", "CC-BY-4.0"),
    (r"free art|art libre", "LAL-1.3"),
    (r"general public|gpl", "GPL-2.0-or-later"),
)
"""Patterns of licence texts to SPDX names; the first match counts."""


def open_zip(path: Path, name: str = "") -> Collection:
    """Open a library in one file. Raises HumanclawError if it is not a Sweet Home 3D library."""
    try:
        archive = zipfile.ZipFile(path)
        text = archive.read(CATALOGUE)
    except (zipfile.BadZipFile, KeyError, OSError) as error:
        raise HumanclawError(
            f"{path} is not a Sweet Home 3D furniture library: {error}.",
            f"Such a library is a zip file that holds {CATALOGUE}.",
        ) from error
    terms = archive.read("LICENSE.TXT").decode("latin-1") if "LICENSE.TXT" in archive.namelist() else ""
    return _collection(text, terms, name or path.stem, lambda model: functools.partial(_unzip, path, model))


def open_folder(path: Path, name: str = "") -> Collection:
    """Open an unpacked library."""
    terms = (path / "LICENSE.TXT").read_text("latin-1") if (path / "LICENSE.TXT").is_file() else ""
    text = (path / CATALOGUE).read_bytes()
    return _collection(text, terms, name or path.name, lambda model: lambda _: _inside(path, model))


def _collection(text: bytes, terms: str, name: str, fetcher: Callable[[str], Callable[[Path], Path]]) -> Collection:
    values = properties(text)
    keys = sorted({int(key.partition("#")[2]) for key in values if re.fullmatch(r"id#\d+", key)})
    licence = licence_of(f"{values.get('license', '')}\n{terms}")
    models = []
    passed_over = 0
    for number in keys:
        row = {key.partition("#")[0]: value for key, value in values.items() if key.endswith(f"#{number}")}
        if row.get("doorOrWindow") == "true" or "staircaseCutOutShape" in row:
            passed_over += 1
        else:
            models.append(_model(row, licence, values.get("name", name), fetcher))
    return Collection(name, models, passed_over)


def _model(
    row: Mapping[str, str], licence: str, library: str, fetcher: Callable[[str], Callable[[Path], Path]]
) -> SourceModel:
    model = row.get("model", "").lstrip("/")
    rotation = tuple(float(value) for value in row.get("modelRotation", "").split())
    return SourceModel(
        id=slug(row["id"].rpartition("#")[2]),
        name=row.get("name", row["id"]),
        fetch=fetcher(model),
        group=row.get("category", ""),
        size=_size(row),
        rotation=rotation if len(rotation) == 9 else None,
        movable=row.get("movable") == "true",
        author=row.get("creator", library),
        licence=licence_of(row["license"]) if "license" in row else licence,
    )


def _size(row: Mapping[str, str]) -> tuple[float, float, float] | None:
    try:
        width, height, depth = (float(row[key]) / 100 for key in ("width", "height", "depth"))
    except (KeyError, ValueError):
        return None
    return width, height, depth


def licence_of(text: str) -> str:
    """Return the SPDX name of the licence in a text; LicenseRef-unknown if none is recognised."""
    found = (name for pattern, name in _LICENCES if re.search(pattern, text.lower()))
    return next(found, "LicenseRef-unknown")


def slug(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9]+", "-", text).strip("-") or "model"


def _unzip(archive: Path, model: str, folder: Path) -> Path:
    """Extract the folder of one model."""
    with zipfile.ZipFile(archive) as file:
        home = str(PurePosixPath(model).parent) + "/"
        for member in file.namelist():
            if member.startswith(home) and not member.endswith("/"):
                file.extract(member, folder)  # Stays inside the folder: zipfile drops ".." and absolute paths.
    return _inside(folder, model)


def _inside(folder: Path, model: str) -> Path:
    path = (folder / model).resolve()
    if not path.is_relative_to(folder.resolve()) or not path.is_file():
        raise HumanclawError(f"the catalogue names {model or 'no model'}, which is not in the library.")
    return path


def properties(text: bytes) -> dict[str, str]:
    """Parse Java properties: latin-1 with \\uXXXX, `key=value` or `key: value`, # comments, backslash continuations."""
    joined = re.sub(r"\\\r?\n[ \t]*", "", text.decode("latin-1"))
    found = {}
    for line in joined.splitlines():
        match = re.match(r"\s*([^#!\s=:][^=:\s]*)\s*[=:\s]\s*(.*)", line)
        if match:
            found[match[1]] = re.sub(r"\\u([0-9a-fA-F]{4})", lambda code: chr(int(code[1], 16)), match[2]).strip()
    return found
