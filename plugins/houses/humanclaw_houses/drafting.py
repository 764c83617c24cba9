"""Draw the floor plans of a house with one or two storeys."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from humanclaw import SceneError
from humanclaw_houses.doors_and_windows import walls_between, with_doors, with_windows
from humanclaw_houses.layouts import SHAPED, arrange_rows, lay_out, living_block, name_areas, turned
from humanclaw_houses.plan import CEILING, STAIR_WIDTH, FloorPlan, Layout, Stair


def draw_plans(rng: np.random.Generator, layout: Layout) -> tuple[FloorPlan, ...]:
    """Return the storeys of a house from the lowest, with 4 to 12 rooms in all.

    Raises SceneError if no plan is found in 1,200 tries.
    """
    for _ in range(1200):
        plans = _one_storey(rng, layout) if layout.storeys == 1 else _two_storeys(rng, layout)
        if plans is not None:
            return plans
    raise SceneError("no floor plan was found for this seed.", "Use another index and report this one.")


def _one_storey(rng: np.random.Generator, layout: Layout) -> tuple[FloorPlan, ...] | None:
    rects = SHAPED[layout.shape](rng, layout)
    if rects is None or len(rects) > 12:
        return None
    areas = name_areas(turned([rects], rng)[0])
    walls = with_windows(with_doors(walls_between(areas), areas, rng, opened=layout.opened), areas, rng)
    return None if walls is None else (FloorPlan(areas, tuple(walls)),)


def _two_storeys(rng: np.random.Generator, layout: Layout) -> tuple[FloorPlan, ...] | None:
    """Plan living downstairs and sleeping upstairs, with the stairs at the start of the first row."""
    stair, hall, block = Stair.draw(rng), float(rng.uniform(1.6, 1.95)), bool(rng.random() < 0.4)
    depths = float(rng.uniform(3.3, 3.75)), float(rng.uniform(3.4, 4.3))
    lower = arrange_rows(_downstairs(rng, block), depths, rng, stairs=STAIR_WIDTH)
    if lower is None:
        return None
    length = sum(width for _, width in lower[0])
    tries = (arrange_rows(_upstairs(rng, layout), depths, rng, stairs=STAIR_WIDTH, length=length) for _ in range(30))
    upper = next((rows for rows in tries if rows), None)
    if upper is None:
        return None
    rects = [lay_out(rows, depths, hall) for rows in (lower, upper)]
    if block:
        rects[0] += living_block(lower, depths, hall, float(rng.uniform(4.4, 5.4)))
    ground, first = (name_areas(turned) for turned in turned(rects, rng))
    if len(ground) + len(first) - 1 > 12:  # the stairs count once
        return None
    walls = [with_windows(with_doors(walls_between(areas), areas, rng, upper, layout.opened), areas, rng, upper)
             for areas, upper in ((ground, False), (first, True))]  # fmt: skip
    if walls[0] is None or walls[1] is None:
        return None
    plan = FloorPlan(first, tuple(walls[1]), stair.rise, CEILING, stair)
    return FloorPlan(ground, tuple(walls[0]), 0.0, stair.rise, stair), _renamed(plan, {area.name for area in ground})


def _downstairs(rng: np.random.Generator, block: bool) -> list[str]:
    """Draw the kinds of rooms on the ground floor of two storeys. block: living room and kitchen are placed apart."""
    kinds = [] if block else ["living", "kitchen"]
    shares = {"bathroom": 0.6, "dining": 0.35, "office": 0.5, "laundry": 0.4, "bedroom": 0.25}
    return kinds + [kind for kind, share in shares.items() if rng.random() < share]


def _upstairs(rng: np.random.Generator, layout: Layout) -> list[str]:
    extra = ["bedroom", "kids", "kids", "office", "bathroom", "bedroom", "laundry"]
    sitting = ["living"] * (layout.livings - 1)
    return [
        *sitting,
        "bedroom",
        "bathroom",
        *(extra[k] for k in rng.permutation(len(extra))[: int(rng.integers(0, 6))]),
    ]


def _renamed(plan: FloorPlan, taken: set[str]) -> FloorPlan:
    """Rename the rooms of the upper storey so that no name is used twice; its hall becomes the landing."""
    names = {"": "", "stairs": "stairs"}
    for area in plan.areas:
        number, stem = 1, "landing" if area.kind == "hall" else area.kind
        while area.name not in names:
            name = stem if number == 1 else f"{stem}_{number}"
            if name not in taken and name not in names.values():
                names[area.name] = name
            number += 1
    areas = tuple(
        replace(area, name=names[area.name], kind="landing" if area.kind == "hall" else area.kind)
        for area in plan.areas
    )
    walls = tuple(replace(wall, low=names[wall.low], high=names[wall.high]) for wall in plan.walls)
    return replace(plan, areas=areas, walls=walls)
