"""One body of a world: what it is told to do in a frame, and its steps of physics."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from humanclaw.body.pose import FPS, Array
from humanclaw.world.half_physics.broad_phase import BroadPhase
from humanclaw.world.half_physics.drive import Drive
from humanclaw.world.half_physics.hands import Hands
from humanclaw.world.half_physics.profile import Profile
from humanclaw.world.half_physics.push_force_limit import PushForceLimit
from humanclaw.world.half_physics.quaternions import Pose
from humanclaw.world.half_physics.reflexes import CALM, feel
from humanclaw.world.half_physics.world import Touch, World
from humanclaw.world.scene import Scene

_CATCH_UP: Final = 3.0
"""A limb that was held back may come to its pose in the last third of a frame, three times as fast."""


class Command(NamedTuple):
    """A frame of a body: the pose at its end, the root's velocity (3,) on the way, and the fastest link's, m/s."""

    target: Pose
    velocity: Array
    swing: float = 0.0

    @classmethod
    def still(cls, pose: Pose) -> Command:
        return cls(pose, np.zeros(3))


class DrivenBody:
    """A body on its way: its drive, its hands, the bounds of its pushes, and its reflexes."""

    def __init__(self, world: World, pose: Pose, profile: Profile, scene: Scene) -> None:
        """Take a world, as the body has it, with the body in a pose."""
        self.world, self._profile = world, profile
        self.drive, self.limit = Drive(world, profile, pose), PushForceLimit(world, profile, scene)
        self.hands, self._reflex = Hands(world, profile, scene), CALM
        self._velocity, self._towards, self._touches = np.zeros(3), 0.0, list[Touch]()
        self.near: tuple[int, ...] = ()
        """Ids of the objects that it may push in the frame."""

    # -- a frame -------------------------------------------------------------------------------------------------------
    def aim(self, command: Command) -> Array:
        """Take up the command of the coming frame; return (T, P, 3) where the links are in it (Drive.course)."""
        target, self._velocity, swing = command
        if self._reflex.borne:
            target = self.drive.laid(target)
        self.drive.aim(self.hands.guided(target, self._velocity).quaternions, swing)
        return self.drive.course(self._velocity, self._reflex)

    def look(self, broad_phase: BroadPhase, course: Array, objects: Mapping[int, Array], held: Collection[int]) -> None:
        """Find what it may meet in the coming frame. held: ids of what any hand holds."""
        self._towards, self.near = broad_phase.look(course, objects, held)
        self.limit.look(self.near)
        self.limit.burden = self.hands.weight

    # -- a step --------------------------------------------------------------------------------------------------------
    def command(self, substep: int) -> tuple[float, float]:
        """Command one physics step; return bounds of the links' speeds in the world and towards objects, m/s."""
        horizontal = self._velocity if substep % self._profile.horizontal_every == 0 else None
        speed = self.drive.command(self._profile.substeps - substep, horizontal, self._reflex)
        return speed, max(min(speed, _CATCH_UP * self._towards * FPS), self.hands.speed)

    def brace(self, due: float, seconds: float) -> None:
        """Prepare for a part of the step. due: seconds from the command to its end."""
        self.limit.brace()
        if self.hands.held:
            self.hands.steer(self.drive.foreseen(due), seconds)

    def bound(self, met: Sequence[Touch], seconds: float) -> None:
        """Bound what the part did to objects. met: the body's contacts in it."""
        self.limit.bound(met, seconds)

    def settle(self, touches: Sequence[Touch]) -> None:
        """End the step, after which the body has these contacts."""
        self.drive.restrain(bool(touches))
        self._reflex = feel(self.world, self._profile, self.limit.movable, touches, self._reflex)
