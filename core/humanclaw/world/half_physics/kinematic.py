"""Pure kinematics: the baseline that shows what contacts change (paper, figure 6)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from humanclaw.body.pose import Motion
from humanclaw.body.skeleton import Side
from humanclaw.world.half_physics.quaternions import poses_of
from humanclaw.world.half_physics.simulation import Simulation, others_of
from humanclaw.world.half_physics.simulator import HalfPhysics
from humanclaw.world.simulator import Contact, Execution

_AT_REST: Final = np.zeros(3)


class Playback(Simulation):
    """Bodies that are wherever a motion puts them."""

    def execute(self, motions: Sequence[Motion]) -> tuple[Execution, ...]:
        """Put each body into each frame of its motion, world frame, and report what it is inside of."""
        contacts: list[list[Contact]] = [[] for _ in motions]
        for frame, poses in enumerate(zip(*map(poses_of, motions), strict=True)):
            for body, pose in zip(self.bodies, poses, strict=True):
                body.world.move(pose.root, pose.quaternions[0], _AT_REST, _AT_REST)
                body.world.bend(pose.quaternions[1:], np.zeros((len(pose.quaternions) - 1, 3)))
            for own, met in zip(contacts, self._each(self.world.overlaps()), strict=True):
                own += self._contacts(frame, met)
        return tuple(
            Execution(motion, tuple(contacts[number]), (), {}, people=others_of(number, motions))
            for number, motion in enumerate(motions)
        )


class Kinematic(HalfPhysics):
    """A Simulator without physics, on the collision detection of any engine.

    Commands are played back, vertical root motion included: the body walks through walls, climbs in the air and moves
    nothing. Starts are checked, and contacts reported, as in half-physics.
    """

    _simulation_type = Playback

    def grip(self, side: Side, closed: bool, body: int = 0) -> None:
        """Do nothing: without forces a hand holds nothing."""
