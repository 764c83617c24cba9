"""Import the models of a collection as assets of a library."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np

from humanclaw import HumanclawError, SceneError
from humanclaw.body import Array
from humanclaw.records import ALIASES
from humanclaw.storage import Folder, read_file
from humanclaw.world import (
    ANYWHERE,
    MIDDLE,
    KeepOutBox,
    Mesh,
    Part,
    back_of,
    bake,
    base_of,
    bounds,
    convex_pieces,
    lightened,
    moved,
    read_model,
    seat_of,
    top_of,
    turned,
    with_lid,
)
from humanclaw_houses.importers.categories import category_of, misfit, otherwise, scale_of, sits
from humanclaw_houses.importers.source_models import Collection, SourceModel, Vec3, digest_of
from humanclaw_houses.importers.sweethome import slug
from humanclaw_houses.library import Entry, Level, paths, read_index, write_asset, write_index

VERSION: Final = 2
"""Raise it when the same source gives another asset. Assets of other versions are then made again."""
TRIANGLES: Final = 1200
_QUARTERS: Final = {"+z": 0, "+x": 3, "-z": 2, "-x": 1}
"""Direction of a front to the quarter turns to the left about y that bring it to +z."""
_OPPOSITE: Final = {"-z": "+z", "+z": "-z", "-x": "+x", "+x": "-x"}
_LARGEST: Final = 20.0
"""Maximum width, height and depth of a piece of furniture, metres."""
_SURFACES: Final = frozenset(
    {"table", "coffee_table", "side_table", "desk", "nightstand", "tv_stand", "dresser", "sideboard", "bookshelf"}
)
_ONE_PIECE: Final = frozenset(
    {"cup", "bowl", "bottle", "book", "clock", "backpack", "ball", "basket", "box", "vase", "bin", "teddy_bear"}
)
_POT: Final = 0.3
"""Lower share of a plant's height that collides: its pot. Leaves do not collide."""


@dataclass
class ImportReport:
    """Result of an import."""

    imported: Counter[str] = field(default_factory=Counter)
    """Assets by category, including unchanged ones."""
    unchanged: int = 0
    """Number of assets that the library already had."""
    other: Counter[str] = field(default_factory=Counter)
    """Names of models without a known category."""
    rejected: dict[str, str] = field(default_factory=dict)
    """Models of a known category that cannot be used, with the reason."""
    passed_over: int = 0
    """Number of doors, windows and stairs."""
    unlisted: list[str] = field(default_factory=list)
    """Ids of targets that are not in the list given with --only."""
    missing: list[str] = field(default_factory=list)
    """Ids in that list with the prefix of the collection that the collection does not have."""
    triangles: int = 0
    hulls: int = 0


def import_assets(
    collection: Collection, library: Path, triangles: int, watch: Iterable[SourceModel] | None = None,
    only: frozenset[str] | None = None,
) -> ImportReport:  # fmt: skip
    """Import a collection into a library. It replaces assets of the same collection; other assets stay.

    watch: the collection's models in a wrapper that shows progress. only: ids of the targets to import; other furniture
    is imported anyway. Unusable models are rejected. Raises HumanclawError if the library cannot be written.
    """
    index = read_index(library)
    known = {entry.id: entry for entry in index.assets} if index else {}
    report, kept = ImportReport(passed_over=collection.passed_over, missing=_missing(collection, only or ())), {}
    for model in collection.models if watch is None else watch:
        entry = _take(model, collection, library, triangles, known, report, only)
        if entry:
            kept[entry.id] = entry
            report.imported[entry.category] += 1
            report.triangles += entry.triangles
            report.hulls += entry.hulls
    others = [entry for entry in known.values() if entry.collection != collection.name]
    try:
        write_index(library, [*others, *kept.values()])
    except OSError as error:
        raise HumanclawError(f"cannot write {library}: {error.strerror}.", "Name another folder with --out.") from error
    for entry in known.values():
        if entry.collection == collection.name and entry.id not in kept:
            for name in paths(entry.id):
                Folder(library).remove(name)
    return report


def listed_in(path: Path) -> frozenset[str]:
    """Return the ids in a file, one per line, with comments after #. Raises HumanclawError if it has none."""
    try:
        lines = read_file(path, 1 << 24).decode("utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise HumanclawError(f"{path} cannot be read: {error}.", "Give a text file with one id per line.") from error
    ids = frozenset(line.split("#")[0].strip() for line in lines) - {""}
    if not ids:
        raise HumanclawError(f"{path} names no asset.", "Write one id per line, as in `humanclaw assets list`.")
    return ids


def _missing(collection: Collection, only: Iterable[str]) -> list[str]:
    prefix = f"{slug(collection.name)}-"
    there = {prefix + model.id for model in collection.models}
    return sorted(name for name in only if name.startswith(prefix) and name not in there)


def _take(
    model: SourceModel,
    collection: Collection,
    library: Path,
    triangles: int,
    known: dict[str, Entry],
    report: ImportReport,
    only: frozenset[str] | None,
) -> Entry | None:
    category = model.category or category_of(model.name, model.group)
    if not category:
        report.other[model.name] += 1
        return None
    name = f"{slug(collection.name)}-{model.id}"
    if only is not None and category in ALIASES and name not in only:
        report.unlisted.append(name)
        return None
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = model.fetch(Path(folder))
            digest, recipe = digest_of(path, model.statement), f"{VERSION}/{category}/{triangles}"
            old = known.get(name)
            if (
                old
                and (old.source_digest, old.recipe) == (digest, recipe)
                and all(map(Folder(library).has, paths(name)))
            ):
                report.unchanged += 1
                return old
            parts = read_model(path)
        return _entry(model, parts, category, triangles, library, name, collection.name, digest, recipe)
    except (HumanclawError, OSError) as error:
        report.rejected[model.id] = error.message if isinstance(error, HumanclawError) else str(error)
        return None


def _entry(
    model: SourceModel, parts: Sequence[Part], category: str, triangles: int, library: Path, name: str, collection: str,
    digest: str, recipe: str,
) -> Entry:  # fmt: skip
    sized, unit = _sized(parts, model, category)
    mesh = bake(sized)
    if not len(mesh.vertices):
        raise SceneError(f"{name} has no face of a finite size.", "Give its vertices in metres.")
    mesh = lightened(moved(mesh, -base_of(mesh.vertices)), triangles)
    category = otherwise(category, _size(mesh))
    quarters = _QUARTERS[model.front]
    if sits(category):
        back = back_of(turned(mesh, quarters))
        quarters = (quarters + _QUARTERS[_OPPOSITE[back]] if back else quarters) % 4
    mesh = turned(mesh, quarters)
    size = _size(mesh)
    seat = seat_of(mesh, MIDDLE.get(category, ANYWHERE)) if sits(category) else None
    wrong = misfit(category, size, seat.height if seat else None)
    if wrong:
        raise HumanclawError(f"{model.name} ({category}): {wrong}.")
    top = top_of(mesh) if category in _SURFACES else None
    hulls = _hulls(mesh, category, seat.room if seat else top)
    return Entry(
        id=name, name=model.name, category=category, size=size, unit=unit,
        turned=f"{90 * quarters} degrees" if quarters else "",
        seat_height=seat.height if seat else None, top=Level(**vars(top)) if top else None, mass=model.mass,
        movable=model.movable, triangles=len(mesh.faces), triangles_in_source=sum(len(part.faces) for part in parts),
        textured=any(part.picture is not None for part in parts), hulls=len(hulls), licence=model.licence,
        author=model.author, collection=collection, source_digest=digest, recipe=recipe,
        digest=write_asset(library, name, mesh, hulls),
    )  # fmt: skip


def _sized(parts: Sequence[Part], model: SourceModel, category: str) -> tuple[list[Part], str]:
    """Return the parts in metres, and the source of their scale."""
    if model.rotation:
        matrix = np.array(model.rotation).reshape(3, 3)
        parts = [replace(part, vertices=part.vertices @ matrix.T) for part in parts]
    low, high = bounds(parts)
    extent = high - low
    if model.size is not None:
        scale, unit = np.array(model.size) / np.maximum(extent, 1e-9), "size from the catalogue"
    else:
        found = scale_of(category, _vec3(extent))
        if found is None:
            said = " x ".join(f"{value:.3g}" for value in extent)
            raise HumanclawError(
                f"{model.name} measures {said} in its file, the size of a {category} in no known unit."
            )
        unit, scale = found[0], np.full(3, found[1])
    with np.errstate(over="ignore", invalid="ignore"):
        sized = [replace(part, vertices=part.vertices * scale) for part in parts]
        extent = np.subtract(*bounds(sized)[::-1])
    if not (extent <= _LARGEST).all():  # NaN is refused too.
        said = " x ".join(f"{value:.3g}" for value in extent)
        raise HumanclawError(f"{model.name} would measure {said} m; no piece of furniture is over {_LARGEST:g} m.")
    return sized, unit


def _size(mesh: Mesh) -> Vec3:
    return _vec3(np.round(np.ptp(mesh.vertices, axis=0).astype(float), 4))


def _vec3(values: Array) -> Vec3:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _hulls(mesh: Mesh, category: str, level: KeepOutBox | None) -> tuple[np.ndarray, ...]:
    """Return the collision pieces: one for small objects, only the pot of a plant, several for other furniture.

    Furniture with a seat or a top gets a box whose upper side is exactly at that level.
    """
    if category in _ONE_PIECE:
        return convex_pieces(mesh, 1)
    if category == "potted_plant":
        return convex_pieces(_below(mesh, _POT), 1)
    pieces = convex_pieces(mesh, 6 if category in ("lamp", "tv", "laptop") else 12, level)
    if level is None or len(pieces) == 1:
        return pieces
    return with_lid(pieces, level)


def _below(mesh: Mesh, share: float) -> Mesh:
    """Return the faces in the lower share of a mesh's height; the whole mesh if they are 12 or fewer."""
    heights = mesh.vertices[mesh.faces][:, :, 1].mean(axis=1)
    faces = mesh.faces[heights < share * mesh.vertices[:, 1].max()]
    return replace(mesh, faces=faces) if len(faces) > 12 else mesh
