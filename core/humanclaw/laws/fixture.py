"""Measure on any simulator: a fixture of simulator and generator that performs commands."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from humanclaw.body.pose import HISTORY, Motion
from humanclaw.episodes.adapters import Adapters
from humanclaw.episodes.backends import Backends, default_simulator
from humanclaw.episodes.moving import Mover, Playing, stand
from humanclaw.errors import HumanclawError
from humanclaw.laws.played import Played
from humanclaw.motion.protocol import MotionGenerator
from humanclaw.plugins.host import Plugins
from humanclaw.skills.contract import Skill, find_suited
from humanclaw.skills.plan import Control
from humanclaw.world.half_physics.profile import Profile, find_profile
from humanclaw.world.scene import Scene
from humanclaw.world.simulator import Chunk, Simulator

T = TypeVar("T")
Command = Mapping[str, float]
"""Command of one chunk: value by measure, metres or radians."""
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
    progress: Callable[[], object] = lambda: None
    """Called after each case of a check."""

    def __post_init__(self) -> None:
        self._generator: MotionGenerator = self.plugins.make("motion_generators", "dit")

    @classmethod
    def of(cls, simulator: str, profile: str = "default", **others: Any) -> Fixture:
        """Return a fixture for an installed simulator; empty means the default. others: fields of a fixture.

        Raises HumanclawError for unknown names.
        """
        plugins = Plugins.discover()
        simulator = simulator or default_simulator(plugins)
        return cls(
            lambda chosen: plugins.make("simulators", simulator, profile=chosen),
            find_profile(profile), plugins=plugins, **others,
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
        _, plan = self._planned(command)
        return self._generator.generate(history, plan.adapter, plan.values, (self.seed, number))

    def _planned(self, command: Command) -> tuple[Skill, Control]:
        skill = find_suited(self.plugins.skills.values(), *command, role="sit" if HEIGHT in command else "locomotion")
        plan = skill.plan(skill.check(skill.call(command).params))
        if not isinstance(plan, Control):
            raise HumanclawError(f"the checks need generated motion, and skill {skill.name} plays keyframes.")
        return skill, plan

    def perform(self, scene: Scene, commands: Sequence[Command], profile: Profile | None = None) -> Played:
        """Perform commands with a body that stands on the scene's start, as a Body plays them."""
        simulator = self.make(profile or self.profile)
        mover = Mover(Backends(), Adapters(self.plugins), self._generator, simulator, scene, scene.start)
        began, chunks = mover.state, list[Chunk]()
        for number, command in enumerate(commands):
            skill, plan = self._planned(command)
            playing = Playing(mover, skill, [plan], (self.seed, number))
            chunks += [mover.simulate(motion, plan) for _, motion, _ in playing.chunks()]
        simulator.close()
        self.progress()
        return Played(began, tuple(chunks))

    def imagine(self, commands: Sequence[Command]) -> Motion:
        """Return the generated motion of commands without a world."""
        motion = self._generator.start()
        for number, command in enumerate(commands):
            motion = motion.then(self.generate(motion[-HISTORY:], command, number))
        return motion


def walk(count: int, metres: float = 0.5) -> Sequence[Command]:
    """Return `count` half seconds of walking straight ahead, each with a distance."""
    return [{FORWARD: metres, TURN: 0.0}] * count
