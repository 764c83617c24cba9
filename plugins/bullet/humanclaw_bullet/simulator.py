"""Half-physics: the body follows commanded poses as contact and gravity allow."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from humanclaw.body import JOINTS
from humanclaw.errors import SceneError
from humanclaw.interfaces import Contact, Execution, WorldState
from humanclaw.pose import FPS, Array, Frame, Motion, rest_pose, vector_from_quaternion
from humanclaw.scene import STRUCTURE, Placement, Scene
from humanclaw_bullet.engine import Client
from humanclaw_bullet.profile import find_profile
from humanclaw_bullet.puppet import LINK_OF, Pose, Puppet, motion_of, poses_of
from humanclaw_bullet.quaternions import capped, conjugate, from_vector, multiply
from humanclaw_bullet.world import Things

TOUCHING: Final = 0.002
"""Shapes closer than this count as touching, metres: the solver lets resting contacts hover by a hair."""
MOVED: Final = 0.001
"""An object whose path strays less than this from its beginning has not moved, metres."""
_SETTLE_FRAMES: Final = 30
_ROOM_TO_STAND: Final = 0.02


class HalfPhysics:
    """The Simulator on Bullet (paper, section "Locomotion-Decoupled Physical Simulation").

    What is commanded, and how:
    * joints: the velocity that closes the gap between actual and target pose, so a limb that was held back catches up;
    * root orientation: likewise, so the body never falls over;
    * root x, z: the velocity between consecutive frames of the command, not the gap to its absolute position, so a body that
      a wall has stopped does not leap forward once it is free; the first frame of a chunk is taken from where the body is;
    * root y: never.
    """

    def __init__(self, profile: str = "default") -> None:
        self._profile = find_profile(profile)
        self._client: Client | None = None

    def reset(self, scene: Scene, start: Placement) -> WorldState:
        """Load a scene, stand the body on its start and let everything settle for a second.

        Raises SceneError if the body overlaps something there, is pushed aside, or finds no floor under it.
        """
        self.close()
        self._scene, self._client = scene, _new_client(self._profile.substeps, self._profile.gravity)
        self._things = Things(self._client, scene)
        stand = Frame(start.x, start.z, start.yaw, start.floor).to_world(rest_pose())
        (pose,) = poses_of(stand)
        self._puppet = Puppet(self._client, self._profile, pose)
        self._refuse_overlap(start)
        for _ in range(_SETTLE_FRAMES * self._profile.substeps):
            self._puppet.drive(pose.quaternions, np.zeros(3))
            self._client.stepSimulation()
        drift = self._puppet.pose().root - pose.root
        if np.abs(drift).max() > 0.05:
            raise SceneError(
                f"the body does not stay on its start ({start.x:.2f}, {start.floor:.2f}, {start.z:.2f}) of scene "
                f"{scene.name!r}: it moved by {np.round(drift, 2).tolist()} m.",
                "Start on a free, level floor.",
            )
        return self.state()
