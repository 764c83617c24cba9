"""Sweet Home 3D furniture libraries: a zip file, or its unpacked folder, with a catalogue in Java's properties format.

Models have +Y up and their front to +Z. The catalogue gives each its size in centimetres and some a rotation.
"""

from __future__ import annotations

import functools
import math
import re
import zipfile
from collections import defaultdict
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path, PurePosixPath
from typing import Final

from humanclaw import HumanclawError
from humanclaw.storage import DAMAGED, Folder, open_file
from humanclaw.world import MODEL_BYTES
from humanclaw_houses.importers.source_models import Collection, SourceModel

CATALOGUE: Final = "PluginFurnitureCatalog.properties"
LIBRARY_BYTES: Final = 2 << 30
"""Maximum bytes of a library in one file."""
TEXT_BYTES: Final = 4 << 20
"""Maximum bytes of its catalogue and of its licence."""
MOST: Final = 20_000
"""Maximum pieces of furniture of a library."""
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
        with open_file(path, LIBRARY_BYTES) as file, zipfile.ZipFile(file) as archive:
            text = _member(archive, CATALOGUE)
            terms = _member(archive, "LICENSE.TXT") if "LICENSE.TXT" in archive.namelist() else b""
    except (*DAMAGED, KeyError) as error:
        raise HumanclawError(
            f"{path} is not a Sweet Home 3D furniture library: {error}.",
            f"Such a library is a zip file that holds {CATALOGUE}.",
        ) from error
    return _collection(text, terms, name or path.stem, lambda model: functools.partial(_unzip, path, model))


def _member(archive: zipfile.ZipFile, name: str) -> bytes:
    """Return a text of a library. Raises BadZipFile if it is too large."""
    if archive.getinfo(name).file_size > TEXT_BYTES:
        raise zipfile.BadZipFile(f"{name} is larger than {TEXT_BYTES >> 20} MiB")
    return archive.read(name)


def open_folder(path: Path, name: str = "") -> Collection:
    """Open an unpacked library."""
    files = Folder(path)
    try:
        text, terms = (files.read(name, TEXT_BYTES) if files.has(name) else b"" for name in (CATALOGUE, "LICENSE.TXT"))
    except OSError as error:
        raise HumanclawError(f"{path / CATALOGUE} cannot be read: {error.strerror}.") from error
    return _collection(text, terms, name or path.name, lambda model: lambda _: _inside(path, model))


def _collection(text: bytes, terms: bytes, name: str, fetcher: Callable[[str], Callable[[Path], Path]]) -> Collection:
    values = properties(text)
    rows: dict[int, dict[str, str]] = defaultdict(dict)
    for key, value in values.items():
        if found := re.fullmatch(r"(.*)#(\d{1,9})", key):
            rows[int(found[2])][found[1]] = value
    licence = licence_of(f"{values.get('license', '')}\n{terms.decode('latin-1')}")
    if len(rows) > MOST:
        raise HumanclawError(f"the catalogue of {name} has {len(rows):,} entries; at most {MOST:,} are read.")
    models = []
    passed_over = 0
    for _, row in sorted(rows.items()):
        if "id" not in row:
            continue
        if row.get("doorOrWindow") == "true" or "staircaseCutOutShape" in row:
            passed_over += 1
        else:
            models.append(_model(row, licence, values.get("name", name), fetcher))
    return Collection(name, models, passed_over)


def _model(
    row: Mapping[str, str], licence: str, library: str, fetcher: Callable[[str], Callable[[Path], Path]]
) -> SourceModel:
    model = row.get("model", "").lstrip("/")
    return SourceModel(
        id=slug(row["id"].rpartition("#")[2]),
        name=row.get("name", row["id"]),
        fetch=fetcher(model),
        group=row.get("category", ""),
        size=_size(row),
        rotation=rotation_of(row.get("modelRotation", "")),
        movable=row.get("movable") == "true",
        author=row.get("creator", library),
        licence=licence_of(row["license"]) if "license" in row else licence,
    )


def rotation_of(text: str) -> tuple[float, ...] | None:
    """Return the nine finite numbers of a matrix; None for any other text."""
    words = text.split(maxsplit=9)
    with suppress(ValueError):
        found = tuple(float(word) for word in words)
        return found if len(found) == 9 and all(map(math.isfinite, found)) else None
    return None


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
    home = str(PurePosixPath(model).parent) + "/"
    try:
        with open_file(archive, LIBRARY_BYTES) as stream, zipfile.ZipFile(stream) as file:
            members = [one for one in file.infolist() if one.filename.startswith(home) and not one.is_dir()]
            if sum(one.file_size for one in members) > MODEL_BYTES:
                raise HumanclawError(f"{model} is larger than {MODEL_BYTES >> 20} MiB with its textures.")
            for member in members:
                file.extract(member, folder)  # Stays inside the folder: zipfile drops ".." and absolute paths.
    except DAMAGED as error:
        raise HumanclawError(f"{model} cannot be unpacked: {error}.") from error
    return _inside(folder, model)


def _inside(folder: Path, model: str) -> Path:
    if not Folder(folder).has(model):
        raise HumanclawError(f"the catalogue names {model or 'no model'}, which is not in the library.")
    return folder / model


def properties(text: bytes) -> dict[str, str]:
    """Parse Java properties: latin-1 with \\uXXXX, `key=value` or `key: value`, # comments, backslash continuations."""
    joined = re.sub(r"\\\r?\n[ \t]*", "", text.decode("latin-1"))
    found = {}
    for line in joined.splitlines():
        match = re.match(r"\s*([^#!\s=:][^=:\s]*)\s*[=:\s]\s*(.*)", line)
        if match:
            found[match[1]] = re.sub(r"\\u([0-9a-fA-F]{4})", lambda code: chr(int(code[1], 16)), match[2]).strip()
    return found
