"""Half-physics: the body follows commanded poses as contact and gravity allow."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from humanclaw.body import JOINTS
from humanclaw.errors import HumanclawError, SceneError
from humanclaw.interfaces import Execution, WorldState
from humanclaw.pose import FPS, Array, Motion, Pose2D, rest_pose
from humanclaw.records import Contact
from humanclaw.scene import STRUCTURE, Scene
from humanclaw_bullet.engine import Client
from humanclaw_bullet.profile import Profile, find_profile
from humanclaw_bullet.puppet import LINK_OF, Pose, Puppet, motion_of, poses_of
from humanclaw_bullet.reflexes import CALM, feel
from humanclaw_bullet.world import Things

TOUCHING: Final = 0.002
"""Shapes closer than this count as touching, metres: the solver lets resting contacts hover by a hair."""
MOVED: Final = 0.001
"""An object whose path strays less than this from its beginning has not moved, metres."""
_SETTLE_FRAMES: Final = 15
_MAX_OVERLAP: Final = 0.02
_MAX_DRIFT: Final = 0.05

# Fields of a row of getContactPoints.
_BODY_A, _BODY_B, _LINK_A, _POINT, _DISTANCE = 1, 2, 3, 6, 8


class HalfPhysics:
    """The Simulator on Bullet (paper, section "Locomotion-Decoupled Physical Simulation").

    What is commanded, and how:

    * joints: the velocity that closes the gap between actual and target pose by the end of the frame, so a limb that was held
      back catches up;
    * root orientation: likewise, so the body never falls over;
    * root x, z: the velocity between consecutive frames of the command, not the gap to its absolute position, so a body that
      a wall has stopped does not leap forward once it is free; the first frame of a chunk is taken from where the body is;
    * root y: never.

    Not thread-safe. Same scene, start and motions: same outcome, bit for bit, on one machine.
    """

    def __init__(self, profile: str | Profile = "default") -> None:
        """profile: 'default', 'paper', 'reference', or constants of your own. Raises HumanclawError for any other name."""
        self._profile = find_profile(profile) if isinstance(profile, str) else profile
        self._client: Client | None = None

    def reset(self, scene: Scene, start: Pose2D) -> WorldState:
        """Load a scene, stand the body on its start and let everything settle for half a second.

        Raises SceneError if the body overlaps something there, is pushed aside, or finds no floor under it.
        """
        self.close()
        self._client = _new_client(self._profile)
        self._scene = scene
        self._building = {thing.id for thing in scene.objects if thing.category in STRUCTURE}
        self._parts, self._reflex = 1, CALM
        self._things = Things(self._client, scene)
        (pose,) = poses_of(Pose2D(start.x, start.z, start.yaw, start.floor).to_world(rest_pose()))
        self._puppet = Puppet(self._client, self._profile, pose)
        self._refuse_overlap(start)
        self._settle(pose, start)
        self._things.lull()
        self._objects = self._things.states()
        return self.state()

    def execute(self, motion: Motion) -> Execution:
        """Drive the body through consecutive frames at 30 a second, world frame; the vertical root motion is not commanded.

        Raises HumanclawError before the first reset, and for a motion that holds numbers which are not finite.
        """
        self._refuse_nonsense(motion)
        realised, contacts, touches, paths = [], [], [], []
        before = self._puppet.pose().root
        swings = self._puppet.swings(motion)
        for frame, target in enumerate(poses_of(motion)):
            rows = self._frame(target, (target.root - before) * FPS, float(swings[frame]))
            before = target.root
            realised.append(self._puppet.pose())
            contacts += self._contacts(frame, rows)
            touches += self._touches(frame)
            paths.append(self._things.states())
        began, self._objects = self._objects, paths[-1]
        return Execution(motion_of(realised), tuple(contacts), tuple(touches), _moved(began, paths))

    def state(self) -> WorldState:
        """The pose of the body and of every movable object, now."""
        return WorldState(motion_of([self._puppet.pose()]), self._objects)

    def close(self) -> None:
        """Free the world; a closed simulator can be reset again."""
        if self._client is not None:
            self._client.close()
            self._client = None

    def _frame(self, target: Pose, velocity: Array, swing: float = 0.0) -> list[Any]:
        """One frame of physics; the rows of everything the body touched in any of its substeps."""
        assert self._client is not None
        profile, rows = self._profile, list[Any]()
        self._puppet.aim(target.quaternions, swing)
        for substep in range(profile.substeps):
            horizontal = velocity if substep % profile.horizontal_every == 0 else None
            speed = self._puppet.drive(profile.substeps - substep, horizontal, self._reflex)
            felt = self._step(speed)
            self._puppet.restrain(bool(felt))
            self._reflex = feel(self._client, self._puppet.body, profile, felt, self._reflex)
            rows += felt
        return rows

    def _step(self, speed: float) -> Sequence[Any]:
        """One physics step, in so many parts that no link comes far between two looks for contacts; the contacts of the body.

        In one part a kick ends 10 cm inside a wall, and a fast enough one behind it. A foot may touch a wall in an early part
        and have left it in the last one: the contacts are those of the last part that had any.
        """
        assert self._client is not None
        seconds = 1 / (FPS * self._profile.substeps)
        parts = min(max(1, math.ceil(speed * seconds / self._profile.travel)), self._profile.max_looks)
        if parts != self._parts:
            # Not numSubSteps: with it Bullet forgets gravity after the first part.
            self._client.setPhysicsEngineParameter(fixedTimeStep=seconds / parts)
            self._parts = parts
        felt: Sequence[Any] = ()
        for _ in range(parts):
            self._client.stepSimulation()
            felt = self._client.getContactPoints(self._puppet.body) or felt
        return felt

    def _contacts(self, frame: int, rows: Iterable[Any]) -> list[Contact]:
        """One contact for each pair of link and object: the deepest of the frame."""
        deepest: dict[tuple[int, int], Any] = {}
        for row in rows:
            other, key = row[_BODY_B], (row[_LINK_A], self._things.object_of.get(row[_BODY_B], 0))
            if row[_DISTANCE] > TOUCHING or other not in self._things.object_of:
                continue
            if key not in deepest or row[_DISTANCE] < deepest[key][_DISTANCE]:
                deepest[key] = row
        return [self._contact(frame, link, thing, row) for (link, thing), row in sorted(deepest.items())]

    def _contact(self, frame: int, link: int, thing: int, row: Any) -> Contact:
        joint = JOINTS[link + 1]
        return Contact(
            (frame,), joint, LINK_OF[joint].group, thing, self._scene.by_id[thing].movable,
            depth=max(0.0, -row[_DISTANCE]), height=row[_POINT][1],
        )  # fmt: skip

    def _touches(self, frame: int) -> list[tuple[int, int, int]]:
        assert self._client is not None
        known, found = self._things.object_of, set()
        # One query for all pairs is cheaper than one for each movable object.
        for row in self._client.getContactPoints() if self._objects else ():
            a, b = known.get(row[_BODY_A], 0), known.get(row[_BODY_B], 0)
            if row[_DISTANCE] <= TOUCHING and a and b and not {a, b} & self._building:
                found.add((frame, min(a, b), max(a, b)))
        return sorted(found)

    def _settle(self, pose: Pose, start: Pose2D) -> None:
        for _ in range(_SETTLE_FRAMES):
            self._frame(pose, np.zeros(3))
        drift = self._puppet.pose().root - pose.root
        if np.abs(drift).max() > _MAX_DRIFT:
            raise SceneError(
                f"the body does not stay on its start {_say(start)} of scene {self._scene.name!r}: it moved by "
                f"{np.round(drift, 2).tolist()} m in half a second.",
                "Start on a free, level floor.",
            )

    def _refuse_overlap(self, start: Pose2D) -> None:
        assert self._client is not None
        self._client.performCollisionDetection()
        rows = self._client.getContactPoints(self._puppet.body)
        for contact in self._contacts(0, rows):
            if contact.depth > _MAX_OVERLAP:
                thing = self._scene.by_id[contact.object_id]
                raise SceneError(
                    f"the body does not fit on its start {_say(start)} of scene {self._scene.name!r}: its {contact.joint} "
                    f"is {contact.depth:.2f} m inside {thing.category} {thing.id}.",
                    "Choose a start with more room around it.",
                )

    def _refuse_nonsense(self, motion: Motion) -> None:
        if self._client is None:
            raise HumanclawError("the simulator holds no scene.", "Call reset(scene, start) first.")
        if not (np.isfinite(motion.root).all() and np.isfinite(motion.rotations).all()):
            raise HumanclawError(
                "a commanded motion must be finite, and this one holds NaN or infinity.",
                "Check what generated it: its weights, or the numbers it was conditioned on.",
            )


def _new_client(profile: Profile) -> Client:
    client = Client()
    client.setGravity(0, -profile.gravity, 0)
    client.setPhysicsEngineParameter(
        fixedTimeStep=1 / (FPS * profile.substeps), numSubSteps=0, deterministicOverlappingPairs=1
    )
    return client


def _moved(began: Mapping[int, Array], paths: list[Mapping[int, Array]]) -> Mapping[int, Array]:
    """(frames, 7) path of each object that strayed from where it began."""
    found = {}
    for key, first in began.items():
        path = np.stack([states[key] for states in paths])
        if np.abs(path[:, :3] - first[:3]).max() > MOVED or _turned(path[:, 3:], first[3:]):
            found[key] = path
    return found


def _turned(path: Array, first: Array) -> bool:
    """Whether a path of quaternions leaves the first one by more than about half a degree."""
    return bool((np.abs(path @ first) < 1 - 1e-5).any())


def _say(start: Pose2D) -> str:
    return f"(x {start.x:.2f}, z {start.z:.2f}, floor {start.floor:.2f})"
