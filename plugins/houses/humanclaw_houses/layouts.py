"""Lay rooms out as rectangles: along a straight or a crossed hall, in a strip, or as a studio."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from humanclaw_houses.plan import Area, Layout

_SIZES: Final = {
    "living": (19.0, 27.0), "sitting": (14.0, 18.0), "kitchen": (10.0, 14.0), "dining": (11.0, 15.0),
    "bedroom": (11.5, 16.0), "kids": (10.0, 13.0), "bathroom": (5.5, 7.5), "office": (8.5, 11.5), "laundry": (5.0, 6.5),
}  # fmt: skip
"""Smallest and largest area of each kind of room, square metres."""
_LEAST_WIDTH: Final = {"living": 4.0, "kitchen": 2.7, "dining": 2.9, "bathroom": 1.75, "laundry": 1.65, "office": 2.5}
"""Least width of a kind of room in its row, metres; 2.8 of all others."""


def _programme(rng: np.random.Generator, layout: Layout) -> list[str]:
    """Draw the kinds of rooms besides the hall, from a small flat to a family house.

    A house with two living rooms is one of the two largest sizes.
    """
    size = int(rng.integers(4)) if layout.livings == 1 else int(rng.integers(2, 4))
    kinds = ["living", "kitchen", "bedroom", "bathroom"]
    if size >= 1:
        kinds += [str(rng.choice(["kids", "office", "bedroom"]))]
    if size >= 2:
        kinds += ["bedroom" if rng.random() < 0.5 else "kids", str(rng.choice(["bathroom", "laundry", "office"]))]
    if size >= 3:
        kinds += (
            ["dining", "bathroom"]
            + (["office"] if rng.random() < 0.6 else [])
            + (["laundry"] if rng.random() < 0.5 else [])
        )
    return kinds + ["living"] * (layout.livings - 1)


Rect = tuple[str, float, float, float, float]


# -- shapes ------------------------------------------------------------------------------------------------------------
def _straight(rng: np.random.Generator, layout: Layout) -> list[Rect] | None:
    """Lay out a hall with rooms on both sides, half of the time with a living block across its end."""
    hall, depths = _hall(rng), (float(rng.uniform(3.3, 4.3)), float(rng.uniform(3.3, 4.3)))
    kinds = _programme(rng, layout)
    block = rng.random() < 0.5
    rows = arrange_rows(_without(kinds, ("living", "kitchen")) if block else kinds, depths, rng)
    if rows is None:
        return None
    rects = lay_out(rows, depths, hall)
    return rects + living_block(rows, depths, hall, float(rng.uniform(4.4, 5.4))) if block else rects


def _crossed(rng: np.random.Generator, layout: Layout) -> list[Rect] | None:
    """Lay out a hall between two rows of rooms, and a third row across its end.

    In an l the hall turns along the third row; in a t it ends in the middle of a second hall along it.
    """
    hall, depths = _hall(rng), (float(rng.uniform(3.3, 4.1)), float(rng.uniform(3.3, 4.1)))
    kinds = _programme(rng, layout)
    beyond = hall if layout.shape == "l" else 0.0
    column = ["living", "kitchen", *(["dining"] if "dining" in kinds and rng.random() < 0.5 else [])]
    rows = arrange_rows(_without(kinds, column), depths, rng, beyond=beyond)
    width, across = float(rng.uniform(3.9, 4.9)), depths[0] + hall + depths[1]
    along = _fitted([(kind, _width(kind, width, rng)) for kind in column], across)
    # In an l one wall of the living room is beside the hall: a door in it needs 1.3 m.
    if rows is None or along is None or (along[0][1] < depths[0] + 1.4 and beyond):
        return None
    x = sum(w for _, w in rows[1])
    rects = lay_out((rows[0], rows[1]), depths, hall, length=x)
    rects.append(("hall", x, depths[0] if beyond else 0.0, x + hall, across))
    return rects + _stacked(along, x + hall, x + hall + width)


def _strip(rng: np.random.Generator, layout: Layout) -> list[Rect] | None:
    """Lay out a row of rooms, the living and the dining room along it from which they open, and the kitchen at the
    end."""
    depth, row_depth = float(rng.uniform(4.2, 5.2)), float(rng.uniform(3.3, 4.2))
    kinds = _programme(rng, layout)
    rest = _without(kinds, ("living", "kitchen", "dining"))
    row = [(kind, _width(kind, row_depth, rng)) for kind in _grouped(rest, rng)]
    length = sum(width for _, width in row)
    living = _fitted([("living", _width("living", depth, rng))] + (
        [("dining", _width("dining", depth, rng))] if length > 7 else []), length)  # fmt: skip
    if living is None or len(row) < 2 or not 18 < depth * living[0][1] < 43:
        return None
    rects: list[Rect] = []
    for line, (z0, z1) in ((row, (0.0, row_depth)), (living, (row_depth, row_depth + depth))):
        x = 0.0
        for kind, width in line:
            rects.append((kind, x, z0, x + width, z1))
            x += width
    wide = float(rng.uniform(12.0, 16.0)) / depth
    return [*rects, ("kitchen", length, row_depth, length + wide, row_depth + depth)]


def _studio(rng: np.random.Generator, layout: Layout) -> list[Rect] | None:
    """Lay out one open room to live, sleep and cook in, a bathroom, and an entrance between them."""
    bath, hall, cook = float(rng.uniform(2.1, 2.6)), float(rng.uniform(1.75, 2.0)), float(rng.uniform(2.6, 3.2))
    near, far = float(rng.uniform(2.6, 2.9)), float(rng.uniform(3.8, 4.7))
    bed, length = max(2.75, bath + float(rng.uniform(0.1, 0.4))), bath + hall + cook
    return [
        ("bathroom", 0.0, 0.0, bath, near), ("hall", bath, 0.0, bath + hall, near),
        ("kitchen", bath + hall, 0.0, length, near),
        ("bedroom", 0.0, near, bed, near + far), ("living", bed, near, length, near + far),
    ]  # fmt: skip


SHAPED: Final[dict[str, Callable[[np.random.Generator, Layout], list[Rect] | None]]] = {
    "straight": _straight, "l": _crossed, "t": _crossed, "strip": _strip, "studio": _studio,
}  # fmt: skip


def _hall(rng: np.random.Generator) -> float:
    """Draw the width of a hall, metres."""
    return float(rng.uniform(1.6, 1.95))


def _without(kinds: list[str], taken: Sequence[str]) -> list[str]:
    """Return the kinds without one of each taken kind."""
    left = list(kinds)
    for kind in taken:
        if kind in left:
            left.remove(kind)
    return left


def _width(kind: str, depth: float, rng: np.random.Generator) -> float:
    """Draw the width that a room needs in a row of a given depth, metres."""
    return max(float(rng.uniform(*_SIZES[kind])) / depth, _LEAST_WIDTH.get(kind, 2.8))


def _fitted(row: list[tuple[str, float]], length: float) -> list[tuple[str, float]] | None:
    """Scale a row to a length; None if that would distort its rooms."""
    share = length / sum(width for _, width in row)
    fair = 0.8 < share < 1.3 and all(share * width >= 0.97 * _LEAST_WIDTH.get(kind, 2.8) for kind, width in row)
    return [(kind, width * share) for kind, width in row] if fair else None


def _stacked(column: list[tuple[str, float]], x0: float, x1: float) -> list[Rect]:
    rects: list[Rect] = []
    z = 0.0
    for kind, depth in column:
        rects.append((kind, x0, z, x1, z + depth))
        z += depth
    return rects


def arrange_rows(
    kinds: list[str],
    depths: tuple[float, float],
    rng: np.random.Generator,
    stairs: float = 0.0,
    length: float | None = None,
    beyond: float = 0.0,
) -> tuple[list[tuple[str, float]], list[tuple[str, float]]] | None:
    """Distribute rooms to the two sides of the hall; return (kind, width) along each, with equal lengths.

    None if that would distort the rooms. stairs: width of the staircase at the start of the first row, 0 for none.
    length: of both rows; by default what the rooms need. beyond: by how much the first row is longer. Metres.
    """
    rows: tuple[list[tuple[str, float]], list[tuple[str, float]]] = ([("stairs", stairs)] if stairs else [], [])
    for number, kind in enumerate(_grouped(kinds, rng)):
        lengths = [sum(width for _, width in row) for row in rows]
        shortest = not rows[0] or kind not in ("kitchen", "dining")
        side = int(np.argmin(lengths)) if shortest else _side_of(rows, "living")
        width = float(rng.uniform(*_SIZES["sitting" if kind == "living" and number else kind])) / depths[side]
        rows[side].append((kind, max(width, _LEAST_WIDTH.get(kind, 2.8))))
    lengths = [sum(width for _, width in row) for row in rows]
    goal = (sum(lengths) - beyond) / 2 if length is None else length
    goals, fixed = (goal + beyond, goal), (stairs, 0.0)
    shares = [(to - own) / max(total - own, 1e-9) for to, total, own in zip(goals, lengths, fixed, strict=True)]
    if not all(0.87 < share < 1.22 for share in shares):
        return None
    scaled = tuple(
        [(kind, width if kind == "stairs" else width * share) for kind, width in row]
        for row, share in zip(rows, shares, strict=True)
    )
    fair = all(width >= 0.97 * _LEAST_WIDTH.get(kind, 2.8) for row in scaled for kind, width in row if kind != "stairs")
    return scaled if fair else None  # type: ignore[return-value]  # As many rows as came.


def _grouped(kinds: list[str], rng: np.random.Generator) -> list[str]:
    """Return living, dining and kitchen first, then the rest shuffled."""
    public = [kind for kind in ("living", "dining", "kitchen") if kind in kinds]
    private = _without(kinds, public)
    return public + [private[k] for k in rng.permutation(len(private))]


def _side_of(rows: tuple[list[tuple[str, float]], ...], kind: str) -> int:
    return next((side for side, row in enumerate(rows) if any(name == kind for name, _ in row)), 0)


def lay_out(
    rows: tuple[list[tuple[str, float]], list[tuple[str, float]]],
    depths: tuple[float, float],
    hall: float,
    length: float | None = None,
) -> list[Rect]:
    """Lay out the hall along x between two rows of rooms. length: of the hall, by default that of the first row."""
    length = sum(width for _, width in rows[0]) if length is None else length
    rects: list[Rect] = [("hall", 0.0, depths[0], length, depths[0] + hall)]
    for row, z0, z1 in ((rows[0], 0.0, depths[0]), (rows[1], depths[0] + hall, depths[0] + hall + depths[1])):
        x = 0.0
        for kind, width in row:
            rects.append((kind, x, z0, x + width, z1))
            x += width
    return rects


def living_block(
    rows: tuple[list[tuple[str, float]], list[tuple[str, float]]],
    depths: tuple[float, float],
    hall: float,
    width: float,
) -> list[Rect]:
    """Lay out living room and kitchen across the far end of the hall."""
    x, split = sum(w for _, w in rows[0]), depths[0] + hall
    return [("living", x, 0.0, x + width, split), ("kitchen", x, split, x + width, split + depths[1])]


def turned(storeys: list[list[Rect]], rng: np.random.Generator) -> list[list[Rect]]:
    """Mirror and turn all storeys in the same random way, and round to the centimetre."""
    flip_x, flip_z, swap = (bool(v) for v in rng.integers(0, 2, 3))
    far_x = max(x1 for rects in storeys for _, _, _, x1, _ in rects)
    far_z = max(z1 for rects in storeys for _, _, _, _, z1 in rects)
    result: list[list[Rect]] = []
    for rects in storeys:
        result.append([])
        for kind, x0, z0, x1, z1 in rects:
            if flip_x:
                x0, x1 = far_x - x1, far_x - x0
            if flip_z:
                z0, z1 = far_z - z1, far_z - z0
            if swap:
                x0, z0, x1, z1 = z0, x0, z1, x1
            result[-1].append((kind, round(x0, 2), round(z0, 2), round(x1, 2), round(z1, 2)))
    return result


def name_areas(rects: list[Rect]) -> tuple[Area, ...]:
    seen: dict[str, int] = {}
    areas = []
    for kind, *corners in rects:
        seen[kind] = seen.get(kind, 0) + 1
        areas.append(Area(kind if seen[kind] == 1 else f"{kind}_{seen[kind]}", kind, *corners))
    return tuple(areas)
