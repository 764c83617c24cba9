"""Short training tasks for single capabilities: approach and stop, turn until seen, sit behind you, name a touch.

Each begins where the benchmark's episodes lead to: near the target, facing it or with the back to it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from humanclaw import EpisodeSpec
from humanclaw.body import Pose2D, wrap_angle
from humanclaw.plugins import Tasks
from humanclaw.records import ALIASES, SEATS
from humanclaw.world import Viewpoint, viewpoints
from humanclaw_bench.splits import ROOM
from humanclaw_bench.training import Draw, FileTasks, House, HouseTasks, TaskOptions, draw_episode, picked

NEAR: Final = 3.0
"""Longest way of a task that begins near its target, metres."""
EYES: Final = 1.5
"""Height of the eyes over the floor, metres, to tell what a standing body could see."""
VISIBLE: Final = 5
"""Of 27 points of a target's box, those that must be free to see."""
AHEAD: Final = float(np.radians(20))
"""Largest bearing of a target straight ahead, radians."""
BEHIND: Final = float(np.radians(110))
"""Smallest bearing of a target out of view, radians."""


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
    return near and _turned(*near, float(rng.uniform(-AHEAD, AHEAD)), told, max_steps=15)


def turn(house: House, options: TaskOptions, rng: np.random.Generator) -> EpisodeSpec | None:
    """Begin near the target with it out of view."""
    near = _near(house, options, rng)
    away = float(rng.uniform(BEHIND, 2 * np.pi - BEHIND))
    told = "turn until you see a {noun}, say that you see it, and stop."
    return near and _turned(*near, away, told, max_steps=10)


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


def _near(house: House, options: TaskOptions, rng: np.random.Generator) -> tuple[EpisodeSpec, float] | None:
    """Draw a candidate within NEAR metres of its target, and the heading in which the target can be seen from there."""
    near = [
        (spec, heading) for spec in house.specs
        if spec.difficulty and spec.difficulty.distance <= NEAR and options.category in ("", spec.target_category)
        and (heading := _sight(house, spec)) is not None
    ]  # fmt: skip
    return picked(near, rng)


def _sight(house: House, spec: EpisodeSpec) -> float | None:
    """Return the heading from the start to the nearest target that can be seen, radians; None if there is none."""
    start = spec.start
    assert start is not None
    eyes = np.array([start.x, start.floor + EYES, start.z])
    grid = house.floors.grids[int(house.floors.level(np.array([start.x, start.floor, start.z])))]
    share = np.array([0.05, 0.5, 0.95])
    corners = np.stack(np.meshgrid(share, share, share), -1).reshape(-1, 3)
    best, heading = np.inf, None
    for key in spec.target_ids:
        low, high = house.scene.aabb(key)
        points = low + corners * (high - low)
        way = (low + high)[[0, 2]] / 2 - eyes[[0, 2]]
        far = float(np.linalg.norm(way))
        if far < best and np.count_nonzero(grid.sees(eyes, points)) >= VISIBLE:
            best, heading = far, float(np.arctan2(*way))
    return heading


def _turned(spec: EpisodeSpec, heading: float, bearing: float, told: str, *, max_steps: int) -> EpisodeSpec:
    """Return a candidate as a task of its own, turned so that the target in this heading has this bearing."""
    assert spec.start is not None
    start = replace(spec.start, yaw=round(float(wrap_angle(heading - bearing)), 3))
    words = told.format(noun=ALIASES[spec.target_category][0])
    return spec.model_copy(update={"instruction": words, "start": start, "interact": False, "max_steps": max_steps})


def _pose(x: float, z: float, yaw: float, floor: float) -> Pose2D:
    return Pose2D(x=round(float(x), 3), z=round(float(z), 3), yaw=round(float(wrap_angle(yaw)), 3), floor=floor)


SOURCES: Final[Mapping[str, Source]] = {
    "train": Source(draw_episode, "success", {"success": 1.0, "progress": 0.1}),
    "approach": Source(approach, "success", {"success": 1.0, "progress": 0.3}),
    "turn": Source(turn, "seen", {"seen": 1.0, "honest": 0.2}),
    "sit": Source(sit, "success", {"success": 1.0}),
    "touch": Source(touch, "touch", {"touch": 1.0}),
}


def tasks(name: str, options: Mapping[str, Any]) -> Tasks:
    """Make a source of training tasks. Raises HumanclawError for a wrong option."""
    if name == "file":
        return FileTasks(options)
    one = SOURCES[name]
    return HouseTasks(name, one.draw, one.goal, one.rewards, options)
