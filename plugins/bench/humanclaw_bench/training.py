"""Endless tasks to train on, by the benchmark's own rules, in houses that no split has (hook humanclaw_tasks).

A seed gives its task by itself, in any process. Ten seeds in a row share a house, so that a trainer that counts up
seldom loads another one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Final, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from humanclaw import EpisodeSpec, HumanclawError, Plugins, Scene, TaskError
from humanclaw.body import Pose2D, wrap_angle
from humanclaw.plugins import Tasks, read_options
from humanclaw.records import ALIASES, SEATS, read_episodes
from humanclaw.world import MultiFloorMap, Viewpoint, viewpoints
from humanclaw_bench.difficulty import overall
from humanclaw_bench.splits import (
    CATEGORIES,
    DEV_HOUSES,
    DISTANCE_SHARES,
    EPISODES,
    HIDDEN_HOUSES,
    HOUSES,
    ROOM,
    bin_of,
    candidates,
)

NEAR: Final = 3.0
"""Longest way of a task that begins near its target, metres."""
EYES: Final = 1.5
"""Height of the eyes over the floor, metres, to tell what a standing body could see."""
VISIBLE: Final = 5
"""Of 27 points of a target's box, those that must be free to see."""
MOST: Final = 500_000
"""Training houses: house:train-0 to the first house of dev."""
TOGETHER: Final = 10
"""Consecutive seeds that share a house."""
TRIES: Final = 50
"""Houses in which a seed looks for its task."""


class TaskOptions(BaseModel):
    """Options of the sources of training tasks."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    houses: int = Field(1000, ge=1, le=MOST)
    """Number of houses to draw from."""
    first: int = Field(0, ge=0, lt=MOST)
    """The first of them: house:train-N. With another one, tasks are in other houses."""
    difficulty: Literal["", "easy", "medium", "hard"] = ""
    """The paper's overall difficulty; empty for all. For `train` alone."""
    category: Literal["", "chair", "couch", "bed", "potted_plant", "tv", "toilet"] = ""
    """Target category; empty for all."""

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> TaskOptions:
        """Check options. Raises HumanclawError that names the first wrong one and lists all."""
        task_options = read_options(cls, given)
        if task_options.first + task_options.houses > MOST:
            last = task_options.first + task_options.houses - 1
            problem = f"houses {task_options.first} to {last} are not all training houses."
            raise HumanclawError(problem, f"Stay below {MOST}.")
        return task_options


def house_of(reference: str) -> str:
    """Return `source:argument` alone. An owner before it and options after "?" name or furnish the same house."""
    return ":".join(reference.partition("?")[0].split(":")[-2:])


def require_training(reference: str) -> None:
    """Raise HumanclawError for a house of val, of dev or of hidden tests."""
    house = house_of(reference)
    number = house.removeprefix("house:train-")
    hidden = house != number and number.isdecimal() and int(number) >= HIDDEN_HOUSES
    whose = "hidden tests" if hidden else "val" if house in HOUSES else "dev" if house in DEV_HOUSES else ""
    if whose:
        problem = f"{reference} is a house of {whose}: what is trained in it cannot be tested in it."
        raise HumanclawError(problem, f"Use house:train-N with N below {MOST}.")


@dataclass(frozen=True, eq=False)
class House:
    """A training house with the benchmark's candidates."""

    scene: Scene
    number: int

    @cached_property
    def specs(self) -> tuple[EpisodeSpec, ...]:
        return tuple(candidates(self.scene, self.number, seed=(0, 3)))

    @cached_property
    def floors(self) -> MultiFloorMap:
        return MultiFloorMap.of(self.scene)

    @cached_property
    def near(self) -> tuple[tuple[EpisodeSpec, float, NDArray[np.float64]], ...]:
        """Candidates within NEAR metres of their target; the heading in which it can be seen from there; and those of
        all points of targets that can be seen, radians."""
        near = (spec for spec in self.specs if spec.difficulty and spec.difficulty.distance <= NEAR)
        return tuple((spec, *sight) for spec in near if (sight := self._sight(spec)) is not None)

    def _sight(self, spec: EpisodeSpec) -> tuple[float, NDArray[np.float64]] | None:
        """Return the headings from a start to the nearest target that can be seen, and to all their points."""
        start = spec.start
        assert start is not None
        eyes = np.array([start.x, start.floor + EYES, start.z])
        grid = self.floors.grids[int(self.floors.level(np.array([start.x, start.floor, start.z])))]
        share = np.array([0.05, 0.5, 0.95])
        corners = np.stack(np.meshgrid(share, share, share), -1).reshape(-1, 3)
        best, heading, seen = np.inf, None, []
        for key in spec.target_ids:
            low, high = self.scene.aabb(key)
            points = low + corners * (high - low)
            points = points[grid.sees(eyes, points)] - eyes
            seen.append(np.arctan2(points[:, 0], points[:, 2]))
            way = (low + high)[[0, 2]] / 2 - eyes[[0, 2]]
            far = float(np.linalg.norm(way))
            if far < best and len(points) >= VISIBLE:
                best, heading = far, float(np.arctan2(*way))
        return None if heading is None else (heading, np.concatenate(seen))


T = TypeVar("T")
Draw = Callable[[House, TaskOptions, np.random.Generator], EpisodeSpec | None]


class HouseTasks:
    """Tasks in training houses: a rule draws them from a house's candidates."""

    def __init__(self, name: str, source: Source, options: Mapping[str, Any]) -> None:
        self.name, self.goal, self.rewards = name, source.goal, source.rewards
        self._draw, self._options = source.draw, TaskOptions.of(options)
        self._house = lru_cache(4)(_loaded)  # Of no method: houses would live on in a cycle until it is collected.

    def __call__(self, seed: int) -> EpisodeSpec:
        """Return the task of a seed. Raises TaskError if no house that was tried has one."""
        for house, rng in self._places(seed):
            spec = self._draw(house, self._options, rng)
            if spec is not None:
                return spec.model_copy(update={"id": f"{self.name}-{seed}", "seed": seed})
        problem = (
            f"no house of {TRIES} has a task for seed {seed} with {self._options.model_dump(exclude_defaults=True)}."
        )
        raise TaskError(problem, "Draw from more houses, or of another difficulty or category.")

    def _places(self, seed: int) -> Iterator[tuple[House, np.random.Generator]]:
        # Two streams: seeds that share a house must not share its tasks.
        houses = np.random.default_rng([seed // TOGETHER, 31])
        for attempt in range(TRIES):
            number = self._options.first + int(houses.integers(self._options.houses))
            yield self._house(number), np.random.default_rng([seed, attempt, 32])


def _loaded(number: int) -> House:
    return House(_plugins().scene(f"house:train-{number}"), number)


@lru_cache(1)
def _plugins() -> Plugins:
    """Return the installed plugins: a factory of tasks gets options alone, and not the plugins of the run."""
    return Plugins.discover()


def draw_episode(house: House, options: TaskOptions, rng: np.random.Generator) -> EpisodeSpec | None:
    """Draw an episode with the categories and distances of val; other distances where the house has none."""
    shares = np.array([EPISODES[name] for name in CATEGORIES], float)
    category = options.category or str(rng.choice(CATEGORIES, p=shares / shares.sum()))
    distance = int(rng.choice(len(DISTANCE_SHARES), p=np.array(DISTANCE_SHARES) / sum(DISTANCE_SHARES)))
    fitting = [spec for spec in house.specs if spec.target_category == category and _has(spec, options)]
    nearest = [spec for spec in fitting if spec.difficulty and bin_of(spec.difficulty.distance) == distance]
    return picked(nearest or fitting, rng)


def _has(spec: EpisodeSpec, options: TaskOptions) -> bool:
    return not options.difficulty or (spec.difficulty is not None and overall(spec.difficulty) == options.difficulty)


def picked(choices: Sequence[T], rng: np.random.Generator) -> T | None:
    """Return one at random; None if there are none."""
    return choices[int(rng.integers(len(choices)))] if choices else None


class FileTasks:
    """Tasks of a file of episodes, over and over. Options: file, and nothing else."""

    goal = "success"
    rewards: Mapping[str, float] = {"success": 1.0, "progress": 0.1}

    def __init__(self, options: Mapping[str, Any]) -> None:
        """Read the file. Raises HumanclawError for another option, and for a house of val, dev or hidden tests."""
        if set(options) != {"file"}:
            raise HumanclawError(f"tasks of a file need the option file; got {sorted(options)}.", "Give file=PATH.")
        self._specs = read_episodes(Path(str(options["file"])))
        for spec in self._specs:
            require_training(spec.scene)

    def __call__(self, seed: int) -> EpisodeSpec:
        return self._specs[seed % len(self._specs)]


# -- tasks for single capabilities -----------------------------------------------------------------------------------
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
    words = "walk up to the {noun} in front of you, and stop within 0.2 m of it."
    return near and _turned(near[0], near[1] - float(rng.uniform(-AHEAD, AHEAD)), words, max_steps=15)


def turn(house: House, options: TaskOptions, rng: np.random.Generator) -> EpisodeSpec | None:
    """Begin near the target, in any heading in which no target is in view: a turn of fixed size finds few of them."""
    if (near := _near(house, options, rng)) is None:
        return None
    yaws = np.radians(np.arange(-180.0, 180.0, 5.0))
    away = yaws[(np.abs(wrap_angle(yaws[:, None] - near[2])) > ASIDE).all(1)]
    words = "turn until you see a {noun}, say that you see it, and stop."
    return _turned(near[0], float(rng.choice(away)), words, max_steps=10) if len(away) else None


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
            words = (
                "walk straight ahead until something stops you; then say in your reasoning what touches you, and stop."
            )
            scene = house.scene
            return EpisodeSpec(
                id="touch", instruction=words, scene=scene.name, scene_digest=scene.digest, start=poses[0], max_steps=8
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
    return picked([place for place in house.near if options.category in ("", place[0].target_category)], rng)


def _turned(spec: EpisodeSpec, yaw: float, words: str, *, max_steps: int) -> EpisodeSpec:
    """Return a candidate as a task of its own that begins in another heading, radians."""
    assert spec.start is not None
    start = replace(spec.start, yaw=round(float(wrap_angle(yaw)), 3))
    words = words.format(noun=ALIASES[spec.target_category][0])
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
    return HouseTasks(name, SOURCES[name], options)
