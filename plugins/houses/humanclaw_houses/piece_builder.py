"""Build an asset from shapes and textures: one mesh, one atlas, collision hulls, and surfaces that support objects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, wraps
from typing import Concatenate, Literal, ParamSpec

import numpy as np
from manifold3d import Manifold
from numpy.typing import NDArray

from humanclaw.world import Asset, Hinge, Joint, Mesh, atlas, balanced, exact
from humanclaw_houses.shapes import Array, Chart, Point, Shape, box
from humanclaw_houses.style import Style
from humanclaw_houses.textures import Texture

Solid = Literal["", "box", "hull"]
P = ParamSpec("P")


@dataclass(frozen=True)
class SupportSurface:
    """A level rectangle that objects can be put on, in the asset's frame, metres."""

    x0: float
    z0: float
    x1: float
    z1: float
    y: float
    room: float = 1.0
    """Free height above it."""
    inside: bool = False
    """Whether it is behind a door."""


@dataclass(frozen=True, eq=False)
class Piece:
    """An asset with the properties that furnishing needs."""

    asset: Asset
    surfaces: tuple[SupportSurface, ...] = ()
    mass: float = 0.0
    """Kilograms; 0 if it is fixed."""
    friction: float = 0.5
    hinged_parts: tuple[HingedPart, ...] = ()
    """Its doors and drawers, closed."""

    @cached_property
    def size(self) -> tuple[float, float, float]:
        """Width, height and depth of the mesh, metres."""
        low, high = self.low, self.high
        return tuple(np.asarray(high - low, float).tolist())

    @cached_property
    def low(self) -> Array:
        own = self.asset.mesh.vertices.min(axis=0)
        return np.asarray(np.min([own, *(leaf.piece.low + leaf.at for leaf in self.hinged_parts)], axis=0), float)

    @cached_property
    def high(self) -> Array:
        own = self.asset.mesh.vertices.max(axis=0)
        return np.asarray(np.max([own, *(leaf.piece.high + leaf.at for leaf in self.hinged_parts)], axis=0), float)


@dataclass(frozen=True, eq=False)
class HingedPart:
    """A door, drawer or lid of a piece."""

    piece: Piece
    at: Point
    """Place of its origin in the frame of the piece when it is closed, metres."""
    joint: Joint
    state: float = 0.0
    """How far it is open, in the unit of its joint."""

    def opened(self, share: float) -> HingedPart:
        """Return it open by a share of its range."""
        return replace(self, state=round(share * max(self.joint.low, self.joint.high, key=abs), 4))


class PieceBuilder:
    """Gathers the parts of one asset."""

    def __init__(self, mass: float = 0.0, friction: float = 0.5) -> None:
        """mass: kilograms; 0 if it is fixed."""
        self.mass, self.friction = mass, friction
        self.seat: float | None = None
        """Height of the seat, metres."""
        self._parts: list[tuple[Chart, Texture]] = []
        self._hulls: list[Array] = []
        self._surfaces: list[SupportSurface] = []
        self._hinged_parts: list[tuple[PieceBuilder, Joint]] = []

    def add(self, shape: Shape, texture: Texture, solid: Solid = "") -> None:
        """Add a part. solid: whether its bounding box or its convex hull collides, or nothing."""
        self._parts += [(chart, texture) for chart in shape.charts]
        if solid == "box":
            low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
            self._hulls.append(corners(low, high))
        elif solid == "hull":
            self._hulls.append(convex(shape.vertices))

    def box(self, size: Point, at: Point, texture: Texture, *, solid: bool = True, skip: str = "") -> None:
        """Add a box that stands on `at`. solid: whether it collides. skip: sides to leave out, as in shapes.box."""
        self.add(box(size, at, skip), texture)
        if solid:
            self.solid(size, at)

    def solid(self, size: Point, at: Point) -> None:
        """Add an invisible collision box that stands on `at`."""
        half = np.array([size[0] / 2, 0.0, size[2] / 2])
        self._hulls.append(corners(np.array(at) - half, np.array(at) + half + [0.0, size[1], 0.0]))

    def surface(
        self, width: float, depth: float, y: float, x: float = 0.0, z: float = 0.0, room: float = 1.0,
        *, inside: bool = False,
    ) -> None:  # fmt: skip
        """Declare a level rectangle about (x, z)."""
        self._surfaces.append(
            SupportSurface(x - width / 2, z - depth / 2, x + width / 2, z + depth / 2, y, room, inside)
        )

    def hinged_part(self, joint: Joint, mass: float) -> PieceBuilder:
        """Return a builder for a part on a hinge or slide, in the same frame. mass: kilograms."""
        part = PieceBuilder(mass)
        self._hinged_parts.append((part, joint))
        return part

    def points(self) -> Array:
        """Return (N, 3) all vertices so far."""
        return np.concatenate([chart.vertices for chart, _ in self._parts])

    def piece(self, name: str, category: str) -> Piece:
        """Return the finished asset, moved so that its footprint is centred on the origin."""
        shift = -_footprint(np.concatenate([self.points(), *(part.points() for part, _ in self._hinged_parts)]))
        hulls = tuple(exact(hull + shift) for hull in self._hulls)
        asset = Asset(name, category, bake(self._parts, shift), hulls, self.seat)
        sx, _, sz = shift
        surfaces = tuple(replace(s, x0=s.x0 + sx, z0=s.z0 + sz, x1=s.x1 + sx, z1=s.z1 + sz) for s in self._surfaces)
        hinged_parts = tuple(
            part._hinged(f"{name}_{number}", category, joint, shift)
            for number, (part, joint) in enumerate(self._hinged_parts, 1)
        )
        return Piece(asset, surfaces, self.mass, self.friction, hinged_parts)

    def _hinged(self, name: str, category: str, joint: Joint, shift: Array) -> HingedPart:
        """Return the finished hinged part. shift: of the piece that it belongs to."""
        middle = _footprint(self.points())
        x, y, z = (middle + shift).tolist()
        if isinstance(joint, Hinge):
            joint = replace(joint, point=_vec3(np.array(joint.point) - middle))
        piece = self.piece(name, category)
        return HingedPart(piece, (x, y, z), balanced(joint, (piece.low + piece.high) / 2, self.mass))


def maker(
    category: str, *, mass: float = 0.0, friction: float = 0.5
) -> Callable[[Callable[Concatenate[PieceBuilder, Style, P], None]], Callable[Concatenate[Style, str, P], Piece]]:
    """Make a maker of pieces, which takes style and name, of a function that adds the parts of a piece to a builder."""

    def decorate(
        add: Callable[Concatenate[PieceBuilder, Style, P], None],
    ) -> Callable[Concatenate[Style, str, P], Piece]:
        @wraps(add)
        def make(style: Style, name: str, /, *args: P.args, **options: P.kwargs) -> Piece:
            builder = PieceBuilder(mass, friction)
            add(builder, style, *args, **options)
            return builder.piece(name, category)

        return make

    return decorate


def _footprint(points: Array) -> Array:
    """Return (3,) the middle of the points' box, on height 0."""
    return np.asarray((points.min(axis=0) + points.max(axis=0)) / 2 * [1.0, 0.0, 1.0])


def _vec3(point: Array) -> Point:
    x, y, z = np.round(point, 5).tolist()
    return x, y, z


def corners(low: Array, high: Array) -> Array:
    """Return the (8, 3) corners of a box."""
    pick = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    return np.where(pick == 1, high, low)


def convex(points: Array) -> Array:
    """Return (K, 3) vertices of the convex hull, thinned where that moves the surface by less than 4 mm."""
    hull = Manifold.hull_points(np.round(points, 5)).simplify(0.004)
    return np.asarray(hull.to_mesh64().vert_properties[:, :3], float)


def bake(parts: Sequence[tuple[Chart, Texture]], shift: Array) -> Mesh:
    """Combine charts into one mesh: their textures side by side in an atlas, their uv fitted into the textures."""
    textures = list({id(texture): texture for _, texture in parts}.values())
    picture, places, extent = atlas([texture.pixels for texture in textures])
    cells = {id(texture): place for texture, place in zip(textures, places, strict=True)}
    counts = np.array([len(chart.vertices) for chart, _ in parts])
    first = np.cumsum(counts) - counts
    faces = np.concatenate([chart.faces for chart, _ in parts])
    faces += np.repeat(first, [len(chart.faces) for chart, _ in parts])[:, None]
    corner = np.repeat([cells[id(texture)] for _, texture in parts], counts, axis=0)
    uv = _fit(np.concatenate([chart.uv for chart, _ in parts]), counts, first, [texture for _, texture in parts])
    vertices = np.concatenate([chart.vertices for chart, _ in parts]) + shift
    return Mesh(exact(vertices), faces.astype(np.int32), exact(uv * extent + corner), picture)


def _fit(uv: Array, counts: NDArray[np.int64], first: NDArray[np.int64], textures: Sequence[Texture]) -> Array:
    """Return (N, 2) uv in 0..1 of each part's texture: all of it, or a cut as large as the part at a varying place.

    The places vary so that equal parts do not show the same pattern.
    """
    uv = uv - np.repeat(np.minimum.reduceat(uv, first), counts, axis=0)
    span = np.maximum(np.maximum.reduceat(uv, first), 1e-9)
    across = np.array([texture.grain for texture in textures]) & (span[:, 0] > span[:, 1])
    span[across] = span[across, ::-1]
    rows = np.repeat(across, counts)
    uv[rows] = uv[rows, ::-1]
    share = np.minimum(span / np.array([[1e-9 if texture.fit else texture.metres] for texture in textures]), 1.0)
    offset = np.arange(len(textures))[:, None] * np.array([0.37, 0.61]) % 1.0 * (1.0 - share)
    span, share, offset = (np.repeat(each, counts, axis=0) for each in (span, share, offset))
    return np.asarray(uv / span * share + offset)
