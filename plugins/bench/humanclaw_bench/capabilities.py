"""Short training tasks for single capabilities: approach and stop, turn until seen, sit behind you, name a touch.

Each begins where the benchmark's episodes lead to: near the target, facing it or with the back to it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import EpisodeSpec, HumanclawError
from humanclaw.body import Pose2D, wrap_angle
from humanclaw.plugins import Tasks
from humanclaw.records import ALIASES, SEATS
from humanclaw.world import Viewpoint, viewpoints
from humanclaw_bench.splits import ROOM
from humanclaw_bench.training import Draw, FileTasks, House, HouseTasks, TaskOptions, draw_episode, picked

AHEAD: Final = float(np.radians(20))
"""Largest bearing of a target straight ahead, radians."""
ASIDE: Final = float(np.radians(55))
"""Smallest bearing of a target out of view, radians: a view reaches 45 degrees to each side."""


@dataclass(frozen=True)
class Source:
    """A source of training tasks: how a task is drawn, what solves it, what it is trained by."""

    draw: Draw
    goal: str
    rewards: Mapping[str, float]


def approach(house: House, options: TaskOptions, rng: np.random.Generator) -> EpisodeSpec | None:
    """Begin in sight of the target, up to NEAR metres of way from it, facing it."""
    near = _near(house, options, rng)
    told = "walk up to the {noun} in front of you, and stop within 0.2 m of it."
    return near and _turned(near[0], near[1] - float(rng.uniform(-AHEAD, AHEAD)), told, max_steps=15)


def turn(house: House, options: TaskOptions, rng: np.random.Generator) -> EpisodeSpec | None:
    """Begin near the target, in any heading in which no target is in view: a turn of fixed size finds few of them."""
    if (near := _near(house, options, rng)) is None:
        return None
    yaws = np.radians(np.arange(-180.0, 180.0, 5.0))
    away = yaws[(np.abs(wrap_angle(yaws[:, None] - near[2])) > ASIDE).all(1)]
    told = "turn until you see a {noun}, say that you see it, and stop."
    return _turned(near[0], float(rng.choice(away)), told, max_steps=10) if len(away) else None


def sit(house: House, options: TaskOptions, rng: np.random.Generator) -> EpisodeSpec | None:
    """Begin in front of a seat, with the back to it."""
    seats = [obj for obj in house.scene.objects if obj.category in SEATS]
    seats = [obj for obj in seats if options.category in ("", obj.category)]
    for index in rng.permutation(len(seats)):
        obj = seats[int(index)]
        stands = viewpoints(house.floors, house.scene, obj.id, sit=True)
        if stands:
            stand = stands[int(rng.integers(min(3, len(stands))))]
            return _seated(house, obj.category, stand, float(rng.uniform(-0.15, 0.15)))
    return None


def _seated(house: House, category: str, stand: Viewpoint, aside: float) -> EpisodeSpec:
    """Return the task to sit down from a place before a seat. aside: angle from having the seat right behind."""
    scene, noun = house.scene, ALIASES[category][0]
    return EpisodeSpec(
        id="sit", instruction=f"a {noun} is right behind you: step back to it, sit down on it, and stop.",
        scene=scene.name, scene_digest=scene.digest, start=_pose(stand.x, stand.z, stand.yaw + aside, stand.floor),
        target_category=category, target_ids=tuple(obj.id for obj in scene.of_category(category)), interact=True,
        max_steps=12,
    )  # fmt: skip


def touch(house: House, options: TaskOptions, rng: np.random.Generator) -> EpisodeSpec | None:
    """Begin a few steps before a piece of furniture, facing it. The task does not tell what it is."""
    things = [obj for obj in house.scene.objects if obj.category in ALIASES and options.category in ("", obj.category)]
    for index in rng.permutation(len(things)):
        stands = viewpoints(house.floors, house.scene, things[int(index)].id)[:5]
        back = [(stand, float(rng.uniform(0.4, 0.8))) for stand in stands]
        if poses := [pose for pose in (_before(house, *pair) for pair in back) if pose]:
            told = (
                "walk straight ahead until something stops you; then say in your reasoning what touches you, and stop."
            )
            scene = house.scene
            return EpisodeSpec(
                id="touch", instruction=told, scene=scene.name, scene_digest=scene.digest, start=poses[0], max_steps=8
            )
    return None


def _before(house: House, stand: Viewpoint, away: float) -> Pose2D | None:
    """Return a place some metres before a place beside an object, facing it; None if no body fits there."""
    x, z = stand.point - away * np.array([np.sin(stand.yaw), np.cos(stand.yaw)])
    grid = house.floors.grids[int(house.floors.level(np.array([x, stand.floor, z])))]
    fits = float(grid.at(grid.clearance, np.array([x, z]))) >= ROOM
    return _pose(x, z, stand.yaw, stand.floor) if fits else None


def _near(house: House, options: TaskOptions, rng: np.random.Generator
          ) -> tuple[EpisodeSpec, float, NDArray[np.float64]] | None:  # fmt: skip
    """Draw a candidate of House.near."""
    return picked([one for one in house.near if options.category in ("", one[0].target_category)], rng)


def _turned(spec: EpisodeSpec, yaw: float, told: str, *, max_steps: int) -> EpisodeSpec:
    """Return a candidate as a task of its own that begins in another heading, radians."""
    assert spec.start is not None
    start = replace(spec.start, yaw=round(float(wrap_angle(yaw)), 3))
    words = told.format(noun=ALIASES[spec.target_category][0])
    return spec.model_copy(update={"instruction": words, "start": start, "interact": False, "max_steps": max_steps})


def _pose(x: float, z: float, yaw: float, floor: float) -> Pose2D:
    return Pose2D(x=round(float(x), 3), z=round(float(z), 3), yaw=round(float(wrap_angle(yaw)), 3), floor=floor)


SOURCES: Final[Mapping[str, Source]] = {
    "train": Source(draw_episode, "success", {"success": 1.0, "progress": 0.1}),
    "approach": Source(approach, "success", {"success": 1.0, "progress": 0.3}),
    "turn": Source(turn, "seen", {"seen": 1.0, "honest": 1.0}),
    "sit": Source(sit, "success", {"success": 1.0}),
    "touch": Source(touch, "touch", {"touch": 1.0}),
}


def tasks(name: str, options: Mapping[str, Any]) -> Tasks:
    """Make a source of training tasks. Raises HumanclawError for a wrong option."""
    if name == "file":
        return FileTasks(options)
    if name != "train" and options.get("difficulty"):
        raise HumanclawError(f"difficulty has no effect on tasks of {name!r}.", "Leave it out, or take 'train'.")
    one = SOURCES[name]
    return HouseTasks(name, one.draw, one.goal, one.rewards, options)
