"""Pure kinematics: the baseline that shows what contacts change (paper, figure 6)."""

from __future__ import annotations

from typing import Final

import numpy as np

from humanclaw.body.pose import Motion
from humanclaw.body.skeleton import Side
from humanclaw.world.half_physics.quaternions import poses_of
from humanclaw.world.half_physics.simulation import Simulation
from humanclaw.world.half_physics.simulator import HalfPhysics
from humanclaw.world.simulator import Execution

_AT_REST: Final = np.zeros(3)


class Playback(Simulation):
    """A body that is wherever a motion puts it."""

    def execute(self, motion: Motion) -> Execution:
        """Put the body into each frame of a motion, world frame, and report what it is inside of."""
        contacts = []
        for frame, pose in enumerate(poses_of(motion)):
            self.world.move(pose.root, pose.quaternions[0], _AT_REST, _AT_REST)
            self.world.bend(pose.quaternions[1:], np.zeros((len(pose.quaternions) - 1, 3)))
            contacts += self._contacts(frame, self.world.overlaps())
        return Execution(motion, tuple(contacts), (), {})


class Kinematic(HalfPhysics):
    """A Simulator without physics, on the collision detection of any engine.

    Commands are played back, vertical root motion included: the body walks through walls, climbs in the air and moves
    nothing. Starts are checked, and contacts reported, as in half-physics.
    """

    _simulation_type = Playback

    def grip(self, side: Side, closed: bool) -> None:
        """Do nothing: without forces a hand holds nothing."""
