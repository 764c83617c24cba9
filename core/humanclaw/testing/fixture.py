"""Measure on any simulator: a fixture of simulator and generator that performs commands."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, TypeVar

import numpy as np

from humanclaw.body.pose import HISTORY, Array, Motion, next_history
from humanclaw.episodes.backends import default_simulator
from humanclaw.episodes.moving import stand
from humanclaw.errors import HumanclawError
from humanclaw.motion.generator import MotionGenerator
from humanclaw.plugins.host import Plugins
from humanclaw.skills.contract import Skill
from humanclaw.skills.measures import from_si
from humanclaw.skills.plan import Control
from humanclaw.world.half_physics.profile import Profile, find_profile
from humanclaw.world.scene import Scene
from humanclaw.world.simulator import Execution, Simulator

GRAVITY: Final = 9.81
T = TypeVar("T")
Command = Mapping[str, float]
"""Command of one chunk: value by measure, metres or radians."""
Tick = Callable[[], object]
FORWARD, TURN, RISE, DROP, HEIGHT = "hips.forward", "heading.left", "hips.rise", "hips.drop", "hips.height"


@dataclass(frozen=True)
class Finding:
    """A measured number with the bounds of its check."""

    check: str
    measure: str
    value: float
    unit: str
    low: float = -np.inf
    high: float = np.inf

    @property
    def holds(self) -> bool:
        return bool(self.low <= self.value <= self.high)


@dataclass(frozen=True)
class Played:
    """Commanded motion and its execution, chunk by chunk (world frame)."""

    start: Array
    """(3,) root before the first chunk."""
    commanded: tuple[Motion, ...]
    executions: tuple[Execution, ...]
    objects: dict[int, Array]
    """Final pose (7,) by id of the movable object."""

    @property
    def simulated(self) -> Motion:
        parts = [execution.simulated for execution in self.executions]
        return Motion(np.concatenate([p.root for p in parts]), np.concatenate([p.rotations for p in parts]))

    def achieved(self) -> Array:
        """Return (3,) displacement of the root as a share of the commanded displacement."""
        ends = np.stack([self.start, *(execution.simulated.root[-1] for execution in self.executions)])
        asked = np.stack([motion.root[-1] for motion in self.commanded]) - ends[:-1]
        return np.asarray((ends[-1] - ends[0]) / asked.sum(axis=0))

    def path(self, object_id: int, begin: Array, above: float = 0.0) -> Array:
        """Return (frames + 1, 3) the path of a point above the base of an upright movable object, metres. begin: its
        first position; above: height of the point."""
        places = self.places(object_id, np.array([*begin, 0.0, 0.0, 0.0, 1.0]))
        return np.asarray(places[:, :3] + above * _upward(places[:, 3:]))

    def places(self, object_id: int, begin: Array) -> Array:
        """Return (frames + 1, 7) the poses of a movable object. begin: its first pose."""
        rows = [begin[None]]
        for execution in self.executions:
            still = np.repeat(rows[-1][-1:], len(execution.simulated), axis=0)
            rows.append(execution.objects.get(object_id, still))
        return np.concatenate(rows)

    def depths(self, object_id: int) -> Array:
        """Return the penetration of links into an object in every contact, metres."""
        return np.array([c.depth for e in self.executions for c in e.contacts if c.object_id == object_id])


@dataclass
class Fixture:
    """The simulator under test and the size of the checks. samples: number of random walls, and of listed cases at
    most; chunks: of random commands."""

    make: Callable[[Profile], Simulator]
    """The simulator under test, as a plugin's factory makes it."""
    profile: Profile
    samples: int = 200
    chunks: int = 10_000
    seed: int = 0
    plugins: Plugins = field(default_factory=Plugins.discover)

    def __post_init__(self) -> None:
        self._generator: MotionGenerator = self.plugins.make("motion_generators", "dit")

    @classmethod
    def of(cls, simulator: str, profile: str = "default", **numbers: int) -> Fixture:
        """Return a fixture for an installed simulator; empty means the default. Raises HumanclawError for unknown
        names."""
        plugins = Plugins.discover()
        simulator = simulator or default_simulator(plugins)
        return cls(
            lambda chosen: plugins.make("simulators", simulator, profile=chosen),
            find_profile(profile), plugins=plugins, **numbers,
        )  # fmt: skip

    def simulator(self) -> Simulator:
        """Return a simulator of the fixture's profile."""
        return self.make(self.profile)

    def some(self, cases: Sequence[T]) -> Sequence[T]:
        """Return at most `samples` of the listed cases of a check, evenly spaced."""
        return cases[:: -(-len(cases) // self.samples)]

    def stand(self, simulator: Simulator, scene: Scene) -> Motion:
        """Put the body on a scene's start. Returns the five frames that its first motion continues."""
        return stand(simulator, self._generator, scene, scene.start)

    def generate(self, history: Motion, command: Command, number: int) -> Motion:
        """Return 15 frames of the skill that commands these measures."""
        skill, keys = skill_with(self.plugins, *command)
        plan = skill.plan(skill.check({keys[measure]: _written(keys[measure], x) for measure, x in command.items()}))
        if not isinstance(plan, Control):
            raise HumanclawError(f"the checks need generated motion, and skill {skill.name} plays keyframes.")
        return self._generator.generate(history, plan.adapter, plan.values, (self.seed, number))

    def perform(self, scene: Scene, commands: Sequence[Command], profile: Profile | None = None) -> Played:
        """Perform commands with a body that stands on the scene's start."""
        simulator = self.make(profile or self.profile)
        history = self.stand(simulator, scene)
        start, commanded, executions = history.root[-1], [], []
        for number, command in enumerate(commands):
            motion = self.generate(history, command, number)
            execution = simulator.execute(motion)
            history = next_history(history, motion, execution.simulated)
            commanded.append(motion)
            executions.append(execution)
        objects = dict(simulator.state().objects)
        simulator.close()
        return Played(start, tuple(commanded), tuple(executions), objects)

    def imagine(self, commands: Sequence[Command]) -> Motion:
        """Return the generated motion of commands without a world."""
        motion = self._generator.start()
        for number, command in enumerate(commands):
            motion = motion.then(self.generate(motion[-HISTORY:], command, number))
        return motion


def skill_with(plugins: Plugins, *measures: str) -> tuple[Skill, Mapping[str, str]]:
    """Return the installed skill with an adapter that commands these measures and the fewest others, with its parameter
    by measure.

    Raises HumanclawError if there is none.
    """
    found = {name: _commands(skill) for name, skill in sorted(plugins.skills.items()) if skill.adapter}
    able = [name for name, keys in found.items() if set(measures) <= set(keys)]
    if not able:
        raise HumanclawError(
            f"no installed skill commands {' and '.join(measures)}.", "Install the skills of HumanCLAW."
        )
    name = min(able, key=lambda name: len(found[name]))
    return plugins.skill(name), found[name]


def _commands(skill: Skill) -> Mapping[str, str]:
    """Return the parameter that commands each measure."""
    return {one.measure: one.key for one in skill.parameters if one.measure}


def _written(key: str, value: float) -> int:
    """Convert metres or radians to the integer unit of a parameter."""
    return round(from_si(key, value))


def _upward(quaternions: Array) -> Array:
    """Return (N, 3) the up axes of (N, 4) quaternions x, y, z, w."""
    x, y, z, w = quaternions.T
    return np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], -1)


def walk(count: int, metres: float = 0.5, turn: float = 0.0) -> Sequence[Command]:
    """Return `count` half seconds of walking, each with a distance and a turn in radians."""
    return [{FORWARD: metres, TURN: turn}] * count
