"""Values of a floor plan: areas, walls with openings, stairs. All lengths are metres."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

WALL: Final = 0.12
"""Thickness of every wall, metres."""
CEILING: Final = 2.5
DOOR_HEIGHT: Final = 2.05
"""Heights of rooms and of doorways, metres: usual ones of new flats."""
OPEN_TOP: Final = 100.0
"""Top of an opening that reaches the ceiling, whatever its height."""
Axis = Literal["x", "z"]
PUBLIC: Final = frozenset({"living", "kitchen", "dining"})
"""Kinds of room that wide passages connect; in an open plan there is no wall between them."""


@dataclass(frozen=True)
class Layout:
    """The kind of a house, drawn before any of its measures."""

    shape: Literal["straight", "l", "t", "strip", "studio"] = "straight"
    """Shape of the hall: straight, around a corner (l), or ending at another hall (t).

    A strip has no hall: rooms open from the living room. A studio has only an entrance.
    """
    open_plan: bool = False
    """Whether there are no walls between the rooms of PUBLIC."""
    livings: int = 1
    storeys: int = 1

    @classmethod
    def draw(cls, rng: np.random.Generator, storeys: int) -> Layout:
        shapes: tuple[Literal["straight", "l", "t", "strip", "studio"], ...] = ("straight", "l", "t", "strip", "studio")
        shape = shapes[int(rng.choice(5, p=_SHAPES))] if storeys == 1 else "straight"
        open_plan = shape in ("strip", "studio") or bool(rng.random() < 0.4)
        large = shape not in ("strip", "studio")
        return cls(shape, open_plan, 2 if large and rng.random() < _TWO_LIVINGS else 1, storeys)

    @property
    def opened(self) -> frozenset[str]:
        """Kinds of room without walls between them."""
        if self.shape == "studio":
            return PUBLIC | {"bedroom", "hall"}
        return PUBLIC if self.open_plan else frozenset()


_SHAPES: Final = (0.28, 0.22, 0.18, 0.17, 0.15)
"""Shares of the shapes among houses with one storey."""
_TWO_LIVINGS: Final = 0.3
"""Share of large houses with two living rooms."""


@dataclass(frozen=True)
class Area:
    """A room, measured between the centre lines of its walls."""

    name: str
    kind: str
    x0: float
    z0: float
    x1: float
    z1: float

    @property
    def inner(self) -> tuple[float, float, float, float]:
        """x0, z0, x1, z1 between the inner faces of the walls."""
        h = WALL / 2
        return self.x0 + h, self.z0 + h, self.x1 - h, self.z1 - h


@dataclass(frozen=True)
class WallOpening:
    """A hole in a wall: a doorway (bottom 0) or a window. at: its centre along the wall."""

    at: float
    width: float
    bottom: float
    top: float
    kind: Literal["door", "front_door", "passage", "stairs", "open", "window"]
    """stairs and open reach up to the ceiling and from wall to wall."""
    leaf: int = 0
    """Side of the hinge along the wall for a door with a leaf, -1 or 1; 0 without a leaf."""
    opens_low: bool = False
    """Whether the leaf opens to the side of the smaller coordinate across the wall."""


@dataclass(frozen=True)
class Wall:
    """A straight wall along an axis, at `line` on the other axis.

    low, high: names of the rooms on its sides of smaller and larger coordinate; empty outside.
    """

    axis: Axis
    line: float
    start: float
    end: float
    low: str
    high: str
    openings: tuple[WallOpening, ...] = ()

    def point(self, along: float, across: float = 0.0) -> tuple[float, float]:
        """Return the world (x, z) of a point along the wall."""
        return (along, self.line + across) if self.axis == "x" else (self.line + across, along)


@dataclass(frozen=True)
class Stair:
    """A staircase with two flights side by side and a half-landing: 2 x `steps` risers in all. Metres."""

    riser: float
    going: float
    steps: int = 8
    """Risers of each flight."""
    left: bool = True
    """Whether the lower flight is on the left, seen from the hall."""

    @property
    def rise(self) -> float:
        """Height from floor to floor, metres."""
        return round(2 * self.steps * self.riser, 4)

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Stair:
        riser = float(rng.choice([0.17, 0.175, 0.18]))
        return cls(riser, round(float(rng.uniform(0.26, 0.29)), 2), left=bool(rng.random() < 0.5))


@dataclass(frozen=True)
class FloorPlan:
    """One storey."""

    areas: tuple[Area, ...]
    walls: tuple[Wall, ...]
    floor: float = 0.0
    """Height of its floor, metres."""
    height: float = CEILING
    """Height from its floor to the top of its walls: to the ceiling, or to the next floor, metres."""
    stair: Stair | None = None
    """The staircase in the area named stairs: its steps on the lower storey, its hole on the upper one."""


STAIR_WIDTH: Final = 2.22
"""Width of the area for the stairs between the centre lines of its walls: two flights of a metre and the spine."""


# -- walls -------------------------------------------------------------------------------------------------------------
def room_at(areas: tuple[Area, ...], x: float, z: float) -> str:
    """Return the name of the room that contains a point; empty outside."""
    return next((a.name for a in areas if a.x0 < x < a.x1 and a.z0 < z < a.z1), "")
