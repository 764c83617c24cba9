"""A body in a scene, driven by skill calls: the Python door, and the part of the loop between a checked call and its
outcome.

body = Body(scene="house:0")
observation = body.call("walk", z_cm=40)
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from humanclaw._backends import Backends, check_sensors
from humanclaw._feedback import Feedback, Proprioception, Touch
from humanclaw.contract import Control, Plan, Skill
from humanclaw.errors import CheckpointError, blaming
from humanclaw.interfaces import (
    Execution,
    MotionGenerator,
    Observation,
    Renderer,
    Simulator,
    View,
    WorldState,
    ego_camera,
)
from humanclaw.motion import Course
from humanclaw.plugins import Plugins
from humanclaw.pose import FUTURE, HISTORY, Array, Motion, Pose2D, re_rooted
from humanclaw.records import Call
from humanclaw.scene import Scene
from humanclaw.sensors import proprioception, tactile


@dataclass(frozen=True)
class Chunk:
    """Half a second: the motion that was commanded (15 frames, world frame), and what physics made of it."""

    commanded: Motion
    execution: Execution


@dataclass(frozen=True)
class SkillExecution:
    """What one executed call did: at least one chunk, and the wall time of its parts in seconds."""

    call: Call
    chunks: tuple[Chunk, ...]
    seconds: Mapping[str, float]
    proprioception: Proprioception | None = None
    tactile: tuple[Touch, ...] | None = None
    """What sensors other than vision tell of it; None for one that is off."""

    @property
    def feedback(self) -> Feedback:
        """What its agent is told."""
        return Feedback(self.call, proprioception=self.proprioception, tactile=self.tactile)


class Body:
    """A human body in a scene. Not thread-safe; close it, or use it as a context manager."""

    def __init__(
        self,
        scene: str | Scene = "house:0",
        start: Pose2D | None = None,
        *,
        seed: int = 0,
        plugins: Plugins | None = None,
        backends: Backends | None = None,
    ) -> None:
        """scene: a reference such as house:0, or a Scene. start: where to stand; by default where the scene says.

        seed: all randomness of the motion derives from it and the step number. Raises HumanclawError for unknown names.
        """
        self.plugins = plugins or Plugins.discover()
        self.backends = (backends or Backends()).chosen(self.plugins)
        self.sensors = check_sensors(self.backends.sensors)
        self._generator: MotionGenerator = self._make("motion_generators", self.backends.generator)
        self._simulator: Simulator = self._make("simulators", self.backends.simulator)
        self._renderer: Renderer = self.plugins.make("renderers", self.backends.renderer)
        self._shown: Scene | None = None
        self.reset(scene, start, seed=seed)

    def _make(self, kind: str, name: str) -> Any:
        return self.plugins.make(kind, name, profile=self.backends.profile)

    def reset(self, scene: str | Scene, start: Pose2D | None = None, *, seed: int = 0) -> Observation:
        """Stand in a scene, everything in it at rest."""
        wanted: Scene = self.plugins.scene(scene) if isinstance(scene, str) else scene
        if self._shown is not wanted:
            self._renderer.load(wanted)
        self.scene = self._shown = wanted
        self.start = start or self.scene.start
        self.seed = seed
        self.step = 0
        self.last: SkillExecution | None = None
        self._state = self._simulator.reset(self.scene, self.start)
        self._history = re_rooted(self._generator.start(), self._state.body)
        self._course = Course()
        return self.observe()

    @property
    def skills(self) -> dict[str, Skill]:
        """Every skill that can be called, by name."""
        return self.plugins.skills

    @property
    def history(self) -> Motion:
        """The five frames that the next motion continues, world frame."""
        return self._history

    @property
    def weights(self) -> str:
        """Digest of the motion prior's weights."""
        return self._generator.digest

    def state(self) -> WorldState:
        """Return the true state of the world: for scoring and for privileged agents, never for models."""
        return self._state

    def view(self) -> View:
        """Render what the eyes see: colours, depth and object ids."""
        return self._renderer.render(self._state, ego_camera(self._state.body))

    def observe(self, instruction: str = "", feedback: Feedback | None = None) -> Observation:
        """Look, and be told what became of the last call."""
        return Observation(self.step, instruction, self.view().rgb, feedback or Feedback())

    def call(self, skill: str, /, **params: Any) -> Observation:
        """Check a call, execute it, and look. What it did is in `last`.

        Raises PluginError for an unknown skill, CallError for parameters outside its schema.
        """
        done = self.execute(Call(skill, self.plugins.skill(skill).check(params)))
        return self.observe(feedback=done.feedback)

    def execute(self, call: Call) -> SkillExecution:
        """Carry out a call that has been checked already."""
        skill = self.plugins.skill(call.skill)
        with blaming(self.plugins.owner(call.skill)):
            plan = skill.plan(call.params)
        before, chunks, seconds = self._state.body, [], {"generate": 0.0, "simulate": 0.0}
        moment = time.perf_counter()
        for commanded in self._chunks(skill, plan):
            seconds["generate"] += time.perf_counter() - moment
            moment = time.perf_counter()
            execution = self._simulator.execute(commanded)
            self._state = self._simulator.state()
            self._history = re_rooted(self._history.then(commanded)[-HISTORY:], execution.simulated)
            chunks.append(Chunk(commanded, execution))
            seconds["simulate"] += time.perf_counter() - moment
            moment = time.perf_counter()
        self.step += 1
        self.last = SkillExecution(call, tuple(chunks), seconds, *self._sense(before, chunks))
        return self.last

    def _sense(self, before: Motion, chunks: Sequence[Chunk]) -> tuple[Proprioception | None, tuple[Touch, ...] | None]:
        told = [(chunk.commanded, chunk.execution) for chunk in chunks]
        return (
            proprioception(before, told) if "body" in self.sensors else None,
            tactile([execution for _, execution in told]) if "touch" in self.sensors else None,
        )

    def _chunks(self, skill: Skill, plan: Plan) -> Iterator[Motion]:
        """Yield the motion of a plan, 15 frames at a time, each placed where the chunk before it has ended."""
        if isinstance(plan, Control):
            require_trained(skill)
            values = self._course.steer(skill.declaration, plan.values)
            motion = self._generator.generate(self._history, plan.adapter, values, (self.seed, self.step))
            self._course = self._course.after(skill.declaration, plan.values, self._history, motion)
            yield motion
            return
        motion = plan.over(self._history)
        for first in range(0, len(motion), FUTURE):
            piece = motion[first : first + FUTURE]
            yield _moved(piece, _offset(self._history[-1:], piece))

    def close(self) -> None:
        self._simulator.close()
        self._renderer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def require_trained(skill: Skill) -> None:
    """Refuse a skill without an adapter. Raises CheckpointError if it has not been trained."""
    if not skill.trained:
        raise CheckpointError(
            f"skill {skill.name!r} has no trained adapter: there is no {skill.adapter}.",
            f"Train it with `humanclaw train adapter {skill.name}`.",
        )


def _offset(pose: Motion, motion: Motion) -> Array:
    """From where the motion begins to where the body is, on the plane."""
    return np.asarray([1.0, 0.0, 1.0] * (pose.root[-1] - motion.root[0]))


def _moved(motion: Motion, by: Array) -> Motion:
    return Motion(motion.root + by, motion.rotations)
