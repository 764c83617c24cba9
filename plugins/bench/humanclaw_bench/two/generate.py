"""The split `two`, drawn from seeds in the houses of val: to meet a partner, to follow one, to bring one a thing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import islice, pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import EpisodeSpec, Scene
from humanclaw.body import Array, Pose2D
from humanclaw.records import Goal, Partner, name_of
from humanclaw.world import DistanceField, MultiFloorMap
from humanclaw_bench.hands.generate import House, tasks
from humanclaw_bench.splits import NEAREST, roomy

EACH: Final[Mapping[str, int]] = {"meet": 34, "follow": 33, "give": 33}
"""Episodes of each task."""
_FAR: Final = (3.0, 15.0)
"""Metres on foot to a partner who is to be met."""
_WAY: Final = (5.0, 10.0)
"""Metres of a way that is walked."""
_AHEAD: Final = 1.3
"""Metres along the way from who follows to who is followed, at the start."""
_CLEAR: Final = 0.3
"""Metres that a way keeps from everything: two bodies come through."""
_CALL: Final = (2.0, 7.0)
"""Metres on foot to a partner who asks for something: within hearing."""
_CARRY: Final = (2.0, 10.0)
"""Metres on foot from a thing to who asks for it."""
_STEPS: Final = 200
"""Decisions at most in a task of two ways."""
_TRIES: Final = 200
"""Draws for a task in a house. One where so many find nothing is too small for it and gets none."""
_EACH_HOUSE: Final = 2
"""Candidates of each task in a house."""
_WORDS: Final = {
    "meet": "find the other person in this house, walk up to them, and stop within 1 m of them, facing them.",
    "follow": "follow the person ahead of you: stay within 2 m of them, do not touch them, and stop once they have "
    "come to the end of their way.",
    "give": "the other person in this house asks for something. Bring it to them, hold it out half a metre in front of "
    "them until they have taken it, let go, and stop.",
}


def episodes(scene: Scene, number: int, seed: int = 0) -> Iterator[EpisodeSpec]:
    """Yield the candidates of a house. number: of the house, for the seed."""
    rng, floors = np.random.default_rng([seed, number, 63]), MultiFloorMap.of(scene)
    for draw in (_meeting, _walk):
        drawn = filter(None, (draw(floors, rng) for _ in range(_TRIES)))
        for start, partner in islice(drawn, _EACH_HOUSE):
            yield EpisodeSpec(
                id=partner.task, instruction=_WORDS[partner.task], scene=scene.name, scene_digest=scene.digest,
                start=start, partner=partner,
            )  # fmt: skip
    for thing, start, there in islice(_errands(House(scene), rng), _EACH_HOUSE):
        yield EpisodeSpec(
            id="give", instruction=_WORDS["give"], scene=scene.name, scene_digest=scene.digest, start=start,
            target_ids=(thing,), goal=Goal(things=(thing,)), partner=Partner(task="give", start=there),
            max_steps=_STEPS,
        )  # fmt: skip


def _somewhere(floors: MultiFloorMap, allowed: NDArray[np.bool_], rng: np.random.Generator) -> Array | None:
    """Return a random (3,) place on the floor among (G, x, z) cells; None if there is none."""
    cells = np.argwhere(allowed)
    if not len(cells):
        return None
    level, *cell = rng.choice(cells).tolist()
    x, z = floors.grids[level].point(np.array(cell)).round(3).tolist()
    return np.array([x, floors.grids[level].floor, z])


def _meeting(floors: MultiFloorMap, rng: np.random.Generator) -> tuple[Pose2D, Partner] | None:
    """Return a start, and a partner some way off, out of view or not."""
    room = np.stack([roomy(grid) for grid in floors.grids])
    there = _somewhere(floors, room, rng)
    if there is None:
        return None
    metres = DistanceField.of(floors, there[None]).metres
    here = _somewhere(floors, room & (metres >= _FAR[0]) & (metres <= _FAR[1]), rng)
    if here is None:
        return None
    return _facing(here, rng.uniform(-np.pi, np.pi)), Partner(
        task="meet", start=_facing(there, rng.uniform(-np.pi, np.pi))
    )


def _walk(floors: MultiFloorMap, rng: np.random.Generator) -> tuple[Pose2D, Partner] | None:
    """Return a start, and a partner a step ahead on a way on the same floor."""
    room = np.stack([roomy(grid) for grid in floors.grids])
    here = _somewhere(floors, room, rng)
    if here is None:
        return None
    ways = DistanceField.comfortable(floors, here)
    level = int(floors.level(here))
    same = np.arange(len(floors.grids))[:, None, None] == level
    end = _somewhere(floors, room & same & np.isfinite(ways.metres), rng)
    route = ways.route(end) if end is not None else ()
    if len(route) != 1:
        return None
    points, grid = route[0].points.round(3), floors.grids[level]
    legs = np.linalg.norm(np.diff(points, axis=0), axis=1)
    clear = all(grid.clear(a, b, _CLEAR) for a, b in pairwise(points))
    # Who is followed stands on the first leg, 30 cm before its end or more.
    if not (clear and len(legs) and _WAY[0] <= legs.sum() - _AHEAD <= _WAY[1] and legs[0] >= _AHEAD + 0.3):
        return None
    yaw = float(np.arctan2(*(points[1] - points[0])))
    x, z = points[0] + _AHEAD * np.array([np.sin(yaw), np.cos(yaw)])
    way = tuple((float(a), float(b)) for a, b in points[1:])
    return _facing(here, yaw), Partner(task="follow", start=_facing(np.array([x, here[1], z]), yaw), way=way)


def _errands(house: House, rng: np.random.Generator) -> Iterator[tuple[int, Pose2D, Pose2D]]:
    """Yield a thing, a start, and the place of who asks for it."""
    floors = house.floors
    room = np.stack([roomy(grid) for grid in floors.grids])
    things = [task.goal.things[0] for task in tasks(house, rng) if task.goal.on is not None]
    for thing in things * _EACH_HOUSE:
        from_thing = DistanceField.of(floors, house.near(thing)).metres
        there = _somewhere(floors, room & (from_thing >= _CARRY[0]) & (from_thing <= _CARRY[1]), rng)
        if there is None:
            continue
        metres = DistanceField.of(floors, there[None]).metres
        here = _somewhere(floors, room & (metres >= _CALL[0]) & (metres <= _CALL[1]) & (from_thing > NEAREST), rng)
        if here is not None:
            yield thing, _facing(here, rng.uniform(-np.pi, np.pi)), _facing(there, rng.uniform(-np.pi, np.pi))


def _facing(place: Array, yaw: float) -> Pose2D:
    x, floor, z = place.round(3).tolist()
    return Pose2D(x=x, z=z, yaw=round(float(yaw), 3), floor=floor)


def choose(candidates: Iterable[EpisodeSpec]) -> tuple[EpisodeSpec, ...]:
    """Return the split: of each task one episode from every house in turn, until there are enough."""
    pools: dict[tuple[str, str], list[EpisodeSpec]] = {}
    for spec in candidates:
        assert spec.partner is not None
        pools.setdefault((spec.partner.task, spec.scene), []).append(spec)
    taken = []
    for task, count in EACH.items():
        of_task = [specs for (name, _), specs in pools.items() if name == task]
        taken += [specs[k] for k in range(_EACH_HOUSE) for specs in of_task if k < len(specs)][:count]
    return tuple(
        spec.model_copy(update={"id": f"{name_of(spec.scene)}-{spec.id}-{k}", "seed": k})
        for k, spec in enumerate(taken)
    )
