"""Endless tasks to train on, by the benchmark's own rules, in houses that no split has (hook humanclaw_tasks).

A seed gives its task by itself, in any process. Ten seeds in a row share a house, so that a trainer that counts up
seldom loads another one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Final, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from humanclaw import EpisodeSpec, HumanclawError, Plugins, Scene, TaskError
from humanclaw.plugins import read_options
from humanclaw.records import read_episodes
from humanclaw.world import MultiFloorMap
from humanclaw_bench.attribution import CAUSES
from humanclaw_bench.difficulty import overall
from humanclaw_bench.splits import (
    CATEGORIES,
    DEV_HOUSES,
    DISTANCE_SHARES,
    EPISODES,
    HIDDEN_HOUSES,
    HOUSES,
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
AGAINST: Final[Mapping[str, str]] = {
    "find: target in view but not seen": "turn",
    "find: near but not in view": "turn",
    "find: too far": "train",
    "find: unaware jammed": "touch",
    "find: ineffective actions": "train",
    "find: midpoint give up": "train",
    "find: ineffective exploration": "train",
    "nav: unaware arrived/touch": "approach",
    "nav: stop while far": "approach",
    "nav: find too late": "train",
    "nav: unaware jammed": "touch",
    "nav: ineffective actions": "approach",
    "nav: target hallucination": "turn",
    "nav: lost target": "train",
    "interact: stand after sit": "sit",
    "interact: sit on air": "sit",
    "interact: sit wrong": "sit",
    "interact: stop but never sit": "sit",
}
"""Label of each root cause to the source of tasks that trains against it."""
assert set(AGAINST) == {cause.label for cause in CAUSES}


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
        found = read_options(cls, given)
        if found.first + found.houses > MOST:
            told = f"houses {found.first} to {found.first + found.houses - 1} are not all training houses."
            raise HumanclawError(told, f"Stay below {MOST}.")
        return found


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
        told = f"{reference} is a house of {whose}: what is trained in it cannot be tested in it."
        raise HumanclawError(told, f"Use house:train-N with N below {MOST}.")


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

    def __init__(
        self, name: str, draw: Draw, goal: str, rewards: Mapping[str, float], options: Mapping[str, Any]
    ) -> None:  # fmt: skip
        self.name, self.goal, self.rewards = name, goal, rewards
        self._draw, self._options = draw, TaskOptions.of(options)
        self._house = lru_cache(4)(_loaded)  # Of no method: houses would live on in a cycle until it is collected.

    def __call__(self, seed: int) -> EpisodeSpec:
        """Return the task of a seed. Raises TaskError if no house that was tried has one."""
        for house, rng in self._places(seed):
            spec = self._draw(house, self._options, rng)
            if spec is not None:
                return spec.model_copy(update={"id": f"{self.name}-{seed}", "seed": seed})
        told = f"no house of {TRIES} has a task for seed {seed} with {self._options.model_dump(exclude_defaults=True)}."
        raise TaskError(told, "Draw from more houses, or of another difficulty or category.")

    def _places(self, seed: int) -> Iterator[tuple[House, np.random.Generator]]:
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


def picked(found: Sequence[T], rng: np.random.Generator) -> T | None:
    """Return one at random; None if there are none."""
    return found[int(rng.integers(len(found)))] if found else None


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
