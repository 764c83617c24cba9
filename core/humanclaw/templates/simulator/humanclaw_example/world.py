"""The world."""

from __future__ import annotations

import numpy as np

from humanclaw import Motion, Scene
from humanclaw.interfaces import Execution, WorldState
from humanclaw.pose import Array, Pose2D, rest_pose


class ExampleWorld:
    """The body does what it is told: no contact, no gravity. For an engine with rigid bodies humanclaw.half_physics
    has the rest, and humanclaw.testing.SimulatorConformance says what it has to pass."""

    def reset(self, scene: Scene, start: Pose2D) -> WorldState:
        """Stand the body on its start, and everything movable where the scene says."""
        self._body = start.to_world(rest_pose())
        self._objects: dict[int, Array] = {
            one.id: np.array([*one.position, *one.rotation]) for one in scene.objects if one.movable
        }
        return self.state()

    def execute(self, motion: Motion) -> Execution:
        """Be where the frames say."""
        self._body = motion[-1:]
        return Execution(motion, contacts=(), touches=(), objects={})

    def state(self) -> WorldState:
        """Return the last frame, and where the movable objects are."""
        return WorldState(self._body, dict(self._objects))

    def close(self) -> None:
        """Let go of nothing: there is no engine."""
