"""Make assets from the model files of templates. Expensive results are cached on disk, keyed by the files' content.

Each template becomes a fragment: a small scene in the template's own frame (axes and scale applied), which the scene
then places.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import Scene, SceneError
from humanclaw.body import Array, Pose2D
from humanclaw.storage import Cache, read_file
from humanclaw.world import (
    MODEL_BYTES,
    Asset,
    Hinge,
    KeepOutBox,
    Mesh,
    Part,
    SceneObject,
    back_of,
    bake,
    balanced,
    base_of,
    bounds,
    convex_pieces,
    exact,
    lightened,
    moved,
    pack_scene,
    read_model,
    seat_of,
    turned,
    unpack_scene,
    with_lid,
)
from humanclaw_habitat import urdf
from humanclaw_habitat.attributes import Template, Vec3
from humanclaw_habitat.categories import SEATS
from humanclaw_habitat.dataset import Kind
from humanclaw_habitat.frames import axes, quarter, quaternion, scaled
from humanclaw_habitat.stage import floor_levels, pieces, righted, together

VERSION: Final = 10
"""Part of the cache key. Raise it when a change of the code makes another asset from the same files."""
_LIMIT: Final = 1 << 32
"""Maximum bytes of the cache on disk. What was not used for longest goes first."""
_SMALL: Final = 0.35
"""An object whose longest side is shorter than this collides as one convex piece, metres."""
_CONVEX: Final = 0.9
"""A part of a collision mesh counts as convex if it fills this share of its convex hull."""
_FROM_BACK: Final = {"-z": 0, "+x": 1, "+z": 2, "-x": 3}
"""Side of the back to the quarter turns to the left that bring the front to +z. Habitat's own back is at +z."""
_DENSITY: Final = 300.0
"""Mass per volume of the bounding box of a door or drawer without a stated mass, kg/m^3."""
_MASSES: Final = (0.5, 60.0)
"""Lower and upper limit of such a mass, kg."""
_SCALED: Final = "@"
"""Separates the template and the scale in the name of an asset."""


def template_of(obj: SceneObject) -> str:
    """Return the template of an object in a scene; empty for a piece of the building."""
    name, scaled, _ = obj.asset.rpartition(_SCALED)
    return name if scaled else ""


@dataclass
class Models:
    """The model files of a scene, each hashed at most once, and what of them was left out."""

    origin: tuple[str, str]
    """Source and licence of the assets."""
    triangles: int
    digests: dict[Path, str] = field(default_factory=dict)
    lost: dict[Path, tuple[str, ...]] = field(default_factory=dict)
    cache: Cache = field(default_factory=lambda: Cache("habitat", _LIMIT))

    def scene_of(self, kind: Kind, scale: Vec3, category: str, joined: bool = False) -> Scene:
        """Return one object in the frame of its template. The note 'middle' is the centre of its bounding box, metres.

        joined: whether its collision model is one convex piece. Raises SceneError if a file is missing or unreadable.
        """
        return self._kept(kind, (scale, category, joined), lambda: self._object(kind, scale, category, joined))

    def building(self, kind: Kind) -> Scene:
        """Return a building in its own frame. The note 'levels' lists its floors as [metres, square metres].

        Raises SceneError.
        """
        return self._kept(kind, (), lambda: self._stage(kind))

    def _kept(self, kind: Kind, rest: tuple[object, ...], make: Callable[[], Scene]) -> Scene:
        """Return a fragment from the cache; if it is not there, make and store it."""
        if not kind.template.render_asset:
            raise SceneError(f"{kind.file} names no render_asset.", "Shapes without a model file are not supported.")
        files = [kind.path(name) for name in (kind.template.render_asset, kind.template.collision_asset) if name]
        inner = [mesh for file in dict.fromkeys(files) if file.suffix == ".urdf" for mesh in urdf.meshes(file)]
        files += [kind.path(str(mesh)) for mesh in inner]
        recipe = (VERSION, kind.template.model_dump(), self.origin, self.triangles, self._decodes, *rest)
        key = hashlib.sha256(repr((recipe, [self._digest(file) for file in files])).encode()).hexdigest()
        data = self.cache.get(key)
        if data is not None:
            try:
                return self._told(files, unpack_scene(data))
            except SceneError as error:
                self.cache.drop(key, error.message)
        made = make()
        lost = {number: self.lost[file] for number, file in enumerate(files) if file in self.lost}
        made = replace(made, notes={**made.notes, "lost": json.dumps(lost)})
        self.cache.put(key, pack_scene(made))
        return made

    @cached_property
    def _decodes(self) -> bool:
        """Whether KTX2 textures can be decoded. Part of the cache key, because a model looks different without them."""
        return importlib.util.find_spec("alktx2") is not None

    def _told(self, files: Sequence[Path], fragment: Scene) -> Scene:
        for number, lost in json.loads(fragment.notes["lost"]).items():
            self.lost[files[int(number)]] = tuple(lost)
        return fragment

    def _digest(self, path: Path) -> str:
        if path not in self.digests:
            try:
                self.digests[path] = hashlib.sha256(read_file(path, MODEL_BYTES)).hexdigest()
            except OSError as error:
                raise SceneError(
                    f"{path} cannot be read: {error.strerror}.", "Check that the dataset is complete."
                ) from error
        return self.digests[path]

    def _parts(self, path: Path, template: Template, what: str = "visual", moving: str = "") -> list[Part]:
        """Return everything in a model file, rotated so that its up is +Y and its front -Z.

        what: 'visual' or 'collision', which elements of a URDF's links to read. moving: the link whose links are read.
        """
        turn = axes(template.up, template.front)
        parts = self._links(path, what, moving) if path.suffix == ".urdf" else self._read(path)
        return [replace(part, vertices=part.vertices @ turn.T) for part in parts]

    def _links(self, path: Path, what: str, moving: str) -> list[Part]:
        """Return the visual or collision elements of a URDF's links; without such elements, the collision ones."""
        return urdf.links(path, what, self._read, moving) or urdf.links(path, "collision", self._read, moving)

    def _read(self, path: Path) -> list[Part]:
        model = read_model(path)
        if model.left_out:
            self.lost[path] = model.left_out
        return model.parts

    def _stage(self, kind: Kind) -> Scene:
        template = kind.template
        parts, shell = self._shell(kind, template.render_asset), None
        if template.collision_asset:
            shell = self._shell(kind, template.collision_asset)
        assets, objects = {}, []
        for number, piece in enumerate(pieces(parts, shell, template.is_collidable), 1):
            base = base_of(piece.mesh.vertices)
            name = f"{kind.name}/{piece.category}-{number}"
            hulls = tuple(exact(hull - base) for hull in piece.hulls)
            assets[name] = self._asset(name, piece.category, moved(piece.mesh, -base), hulls, None)
            objects.append(_object(number, assets[name], base, np.eye(3), kind))
        levels = json.dumps(floor_levels(parts))
        return Scene(kind.name, assets, tuple(objects), (), Pose2D(0, 0, 0), {"levels": levels})

    def _object(self, kind: Kind, scale: Vec3, category: str, joined: bool) -> Scene:
        name = f"{kind.name}{_SCALED}{','.join(f'{value:g}' for value in scale)}{' joined' if joined else ''}"
        path = kind.path(kind.template.render_asset)
        links = urdf.moving_links(path) if path.suffix == ".urdf" else []
        made = [self._piece(kind, scale, category, joined, name, moving) for moving in (None, *links)]
        pieces = [piece for piece in made if piece]
        if not pieces:
            raise SceneError(f"{path} has no shape: none of its triangles has an area.")
        assets = {asset.name: asset for asset, _, _ in pieces}
        objects = tuple(replace(obj, id=number) for number, (_, obj, _) in enumerate(pieces, 1))
        return Scene(name, assets, objects, (), Pose2D(0, 0, 0), {"middle": json.dumps(pieces[0][2])})

    def _piece(
        self, kind: Kind, scale: Vec3, category: str, joined: bool, name: str, moving: urdf.MovingLink | None
    ) -> tuple[Asset, SceneObject, list[float]] | None:
        """Return an object, or the part that a moving link carries, with the centre of its bounding box; None without a
        shape."""
        template, link = kind.template, moving.link if moving else ""
        parts = scaled(self._parts(kind.path(template.render_asset), template, moving=link), np.array(scale))
        whole = bake(parts) if parts else None
        if whole is None or not len(whole.faces):
            return None
        low, high = bounds(parts)
        base = base_of(np.stack([low, high]))
        mesh = moved(lightened(whole, self.triangles), -base)
        # A seat faces away from its back, even if the config states another front.
        quarters = _FROM_BACK[(back_of(mesh) if category in SEATS else "") or "+z"]
        mesh = turned(mesh, quarters)
        seat = seat_of(mesh, category) if category in SEATS and not moving else None
        hulls: tuple[NDArray[np.float32], ...] = ()
        if template.is_collidable:
            given = self._given(kind, np.array(scale), link)
            placed = tuple(exact((hull - base) @ quarter(quarters).T) for hull in given)
            hulls = _hulls(mesh, placed, template, joined, seat.room if seat else None)
        asset = self._asset(f"{name} {link}" if moving else name, category, mesh, hulls, seat.height if seat else None)
        obj = _object(1, asset, base, quarter(-quarters), kind)
        if moving:
            obj = _hung(obj, asset, moving, axes(template.up, template.front), np.array(scale), base, quarter(quarters))
        return asset, obj, ((low + high) / 2).tolist()

    def _shell(self, kind: Kind, asset: str) -> Sequence[Part]:
        size = np.array(kind.template.scale) * kind.template.units_to_meters
        return righted(scaled(self._parts(kind.path(asset), kind.template), size))

    def _given(self, kind: Kind, scale: Array, moving: str) -> list[NDArray[np.float32]]:
        """Return the pieces of a template's own collision model; pieces that are not convex are decomposed."""
        asset = kind.template.collision_asset
        if not asset or kind.template.use_bounding_box_for_collision:
            return []
        parts = scaled(self._parts(kind.path(asset), kind.template, "collision", moving), scale)
        solids = [solid for part in parts for solid in _solids(part)]
        return [hull for solid in solids for hull in convex_pieces(solid, 1 if _is_convex(solid) else 16)]

    def _asset(
        self, name: str, category: str, mesh: Mesh, hulls: tuple[NDArray[np.float32], ...], seat: float | None
    ) -> Asset:
        return Asset(name, category, mesh, hulls, seat, *self.origin)


def _object(number: int, asset: Asset, base: Array, turn: Array, kind: Kind) -> SceneObject:
    x, y, z = (np.round(base, 5) + 0.0).tolist()
    friction = kind.template.friction_coefficient
    return SceneObject(number, asset.name, asset.category, (x, y, z), quaternion(turn), friction=friction)


def _hung(
    obj: SceneObject, asset: Asset, moving: urdf.MovingLink, turn: Array, scale: Array, base: Array, quarters: Array
) -> SceneObject:
    """Return an object on a moving link's joint, which is given in the file's frame. Without friction of its own it is
    balanced."""
    way, joint, longer = turn @ np.array(moving.joint.axis) * scale, moving.joint, 1.0
    axis = _vec3(quarters @ way / np.linalg.norm(way))
    if isinstance(joint, Hinge):
        joint = replace(joint, axis=axis, point=_vec3(quarters @ (turn @ np.array(joint.point) * scale - base)))
    else:
        longer = float(np.linalg.norm(way))
        joint = replace(joint, axis=axis, low=joint.low * longer, high=joint.high * longer)
    size = np.ptp(asset.mesh.vertices, axis=0)
    mass = moving.mass or round(float(np.clip(_DENSITY * size.prod(), *_MASSES)), 3)
    centre = asset.mesh.vertices.mean(axis=0).astype(float)
    return replace(
        obj, movable=True, mass=mass, joint=balanced(joint, centre, mass), state=float(moving.state) * longer
    )  # fmt: skip


def _vec3(point: Array) -> Vec3:
    x, y, z = (np.round(point, 5) + 0.0).tolist()
    return x, y, z


def _hulls(
    mesh: Mesh, given: tuple[NDArray[np.float32], ...], template: Template, joined: bool, room: KeepOutBox | None
) -> tuple[NDArray[np.float32], ...]:
    """Return the collision pieces of an object: its bounding box, the given pieces, or a decomposition.

    room: space over the seat that a decomposition keeps free.
    """
    if template.use_bounding_box_for_collision:
        return (_box(mesh),)
    if given and joined:
        return convex_pieces(_cloud(np.concatenate(given)), 1)
    if given:
        return given
    if np.ptp(mesh.vertices, axis=0).max() < _SMALL:
        return convex_pieces(mesh, 1)
    pieces = convex_pieces(mesh, keep_out=room)
    return with_lid(pieces, room) if room and len(pieces) > 1 else pieces


def _box(mesh: Mesh) -> NDArray[np.float32]:
    sides = zip(mesh.vertices.min(axis=0), mesh.vertices.max(axis=0), strict=True)
    return exact(np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 3))


def _cloud(points: Array) -> Mesh:
    """Return a mesh of the points; only its convex hull has a meaning."""
    faces = np.arange(len(points) // 3 * 3, dtype=np.int32).reshape(-1, 3)
    return Mesh(exact(points), faces, np.zeros((len(points), 2), np.float32), np.zeros((1, 1, 3), np.uint8))


def _solids(part: Part) -> list[Mesh]:
    """Return the connected pieces of a part, without textures."""
    points, place = np.unique(np.round(part.vertices, 5), axis=0, return_inverse=True)
    faces = place.ravel()[part.faces]
    label, blank, solids = together(faces), np.zeros((1, 1, 3), np.uint8), []
    for number in np.unique(label):
        used, index = np.unique(faces[label == number], return_inverse=True)
        uv = np.zeros((len(used), 2), np.float32)
        solids.append(Mesh(exact(points[used]), index.reshape(-1, 3).astype(np.int32), uv, blank))
    return solids


def _is_convex(mesh: Mesh) -> bool:
    """Return whether a closed mesh nearly fills its convex hull. A flat mesh counts as convex."""
    from scipy.spatial import ConvexHull, QhullError

    a, b, c = (mesh.vertices[mesh.faces[:, k]].astype(float) for k in range(3))
    try:
        whole = ConvexHull(mesh.vertices.astype(float)).volume
    except QhullError:
        return True
    return bool(abs(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6) > _CONVEX * whole)
