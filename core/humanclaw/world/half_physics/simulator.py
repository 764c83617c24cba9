"""Half-physics: the body follows commanded poses as contact and gravity allow."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

import numpy as np

from humanclaw.body.pose import FPS, Array, Motion, Pose2D, rest_pose
from humanclaw.body.skeleton import JOINTS, Side
from humanclaw.errors import HumanclawError, SceneError
from humanclaw.world.half_physics.drive import Drive
from humanclaw.world.half_physics.exertion import Exertion
from humanclaw.world.half_physics.hands import Hands
from humanclaw.world.half_physics.profile import Profile, find_profile
from humanclaw.world.half_physics.quaternions import Pose, motion_of, poses_of
from humanclaw.world.half_physics.reflexes import CALM, feel
from humanclaw.world.half_physics.rest import at_rest
from humanclaw.world.half_physics.skeleton import LINK_OF
from humanclaw.world.half_physics.surroundings import Surroundings
from humanclaw.world.half_physics.world import TOUCHING, TRAVEL, ObjectMotion, OpenWorld, Touch, World
from humanclaw.world.scene import STRUCTURE, Scene
from humanclaw.world.simulator import Contact, Execution, WorldState

MOVED: Final = 0.001
"""An object whose path strays less than this from its beginning has not moved, metres."""
_CATCH_UP: Final = 3.0
"""A limb that was held back may come to its pose in the last third of a frame, three times as fast."""
_SETTLE_FRAMES: Final = 5
"""A body without a floor has fallen 14 cm by then."""
_MAX_OVERLAP: Final = 0.02
_MAX_DRIFT: Final = 0.05


class HalfPhysics:
    """The Simulator on any engine (paper, section "Locomotion-Decoupled Physical Simulation").

    Commands:

    * joints: the velocity that closes the gap between actual and target pose by the end of the frame, so a limb that
      was held back catches up;
    * root orientation: likewise, so the body never falls over;
    * root x, z: the velocity between consecutive frames of the command, not the gap to its absolute position, so a body
      that a wall has stopped does not leap forward once it is free; the first frame of a chunk is taken from where the
      body is;
    * root y: never.

    Not thread-safe. Same scene, start and motions: same outcome, bit for bit, on one machine.
    """

    def __init__(self, open_world: OpenWorld, profile: str | Profile = "default", digest: str = "") -> None:
        """Take an engine.

        Args:
            open_world: the engine.
            profile: 'default', 'paper', 'reference', or constants of your own.
            digest: of everything in the engine that may change where objects come to rest (`storage.source_digest`);
                empty to work that out anew in each process.

        Raises HumanclawError for any other name of a profile.
        """
        self._open, self._digest = open_world, digest
        self._profile = find_profile(profile) if isinstance(profile, str) else profile
        self._world: World | None = None
        self._measured: Surroundings | None = None
        self._rest: Mapping[int, ObjectMotion] = {}
        """How the objects of the measured scene lie at a start."""
        self._still: Mapping[int, Array] | None = None
        """Where the movable objects were when `_pairs` were found."""
        self._pairs: list[tuple[int, int]] = []

    def reset(self, scene: Scene, start: Pose2D) -> WorldState:
        """Load a scene with every object at rest, stand the body on its start and let its feet settle.

        Raises SceneError if the body overlaps something there, is pushed aside, or finds no floor under it.
        """
        self.close()
        (pose,) = poses_of(Pose2D(start.x, start.z, start.yaw, start.floor).to_world(rest_pose()))
        if self._measured is None or self._measured.scene is not scene:
            self._rest, self._measured = at_rest(self._open, scene, self._profile, self._digest), Surroundings(scene)
        self._world = world = self._open(scene, self._profile, pose)
        for key, motion in self._rest.items():
            world.set_motion(key, motion)
        self._scene, self._reflex = scene, CALM
        self._building = {scene_object.id for scene_object in scene.objects if scene_object.category in STRUCTURE}
        self._surroundings = self._measured
        self._drive, self._exertion = Drive(world, self._profile, pose), Exertion(world, self._profile, scene)
        self._hands = Hands(world, self._profile, scene)
        self._objects = world.objects()
        self._still, self._pairs, self._restless = None, [], True
        self._refuse_overlap(world, start)
        world.settled()
        self._settle(world, pose, start)
        return self.state()

    def execute(self, motion: Motion) -> Execution:
        """Drive the body through consecutive frames at 30 a second, world frame; the vertical root motion is not
        commanded.

        Raises HumanclawError before the first reset, and for a motion that holds numbers which are not finite.
        """
        world = self._ready(motion)
        simulated, contacts, touches, paths = [], [], [], []
        self._hands.tidy()
        began, before = self._objects, self._drive.pose.root
        swings = self._drive.swings(motion)
        for frame, target in enumerate(poses_of(motion)):
            velocity = (target.root - before) * FPS
            met = self._frame(world, target, velocity, float(swings[frame]))
            before = target.root
            simulated.append(self._drive.pose)
            contacts += self._contacts(frame, met)
            touches += self._touches(world, frame)
            paths.append(self._objects)
        return Execution(motion_of(simulated), tuple(contacts), tuple(touches), _moved(began, paths), self._hands.held)

    def state(self) -> WorldState:
        """Return the pose of the body and of every movable object, now.

        Raises HumanclawError before the first reset.
        """
        return WorldState(motion_of([self._loaded().pose()]), self._objects, self._hands.held)

    def grip(self, side: Side, closed: bool) -> None:
        """Open a hand, or close it on the nearest movable object before its palm.

        Raises HumanclawError before the first reset.
        """
        self._loaded()
        self._hands.grip(side, closed)

    def close(self) -> None:
        """Free the world; a closed simulator can be reset again."""
        if self._world is not None:
            self._world.close()
            self._world = None

    def _frame(self, world: World, target: Pose, velocity: Array, swing: float = 0.0) -> list[Touch]:
        """One frame of physics; everything the body touched in any of its substeps."""
        profile, met = self._profile, list[Touch]()
        if self._reflex.borne:
            target = self._drive.laid(target)
        held, target = self._hands.held, self._hands.guided(target, velocity)
        self._drive.aim(target.quaternions, swing)
        course = self._drive.course(velocity, self._reflex)
        towards, near = self._surroundings.look(course, self._objects, held.values())
        self._exertion.look(near)
        self._exertion.burden = self._hands.weight
        for substep in range(profile.substeps):
            horizontal = velocity if substep % profile.horizontal_every == 0 else None
            speed = self._drive.command(profile.substeps - substep, horizontal, self._reflex)
            touches = self._step(world, min(speed, _CATCH_UP * towards * FPS))
            self._drive.restrain(bool(touches))
            self._reflex = feel(world, profile, self._exertion.movable, touches, self._reflex)
            met += touches
        if held:
            self._hands.let_slip(self._drive.pose)
        if near or held or self._restless:  # Else nothing moves, and to read every place takes long.
            before, self._objects = self._objects, world.objects()
            self._restless = self._objects is not before
        return met

    def _step(self, world: World, speed: float) -> Sequence[Touch]:
        """One physics step, in so many parts that no link comes far towards anything between two looks for contacts;
        the contacts of the body.

        In one part a kick ends 10 cm inside a wall, and a fast enough one behind it. A foot may touch a wall in an
        early part and have left it in the last one: the contacts are those of the last part that had any.
        """
        seconds = 1 / (FPS * self._profile.substeps)
        speed = max(speed, self._hands.speed)
        parts = min(max(1, math.ceil(speed * seconds / TRAVEL)), self._profile.max_looks)
        touches: Sequence[Touch] = ()
        for part in range(parts):
            self._exertion.brace()
            if self._hands.held:
                self._hands.steer(self._drive.foreseen((part + 1) * seconds / parts), seconds / parts)
            met = world.step(seconds / parts)
            self._exertion.bound(met, seconds / parts)
            touches = met or touches
        return touches

    def _contacts(self, frame: int, touches: Iterable[Touch]) -> list[Contact]:
        """One contact for each pair of link and object: the deepest of the frame."""
        deepest: dict[tuple[int, int], Touch] = {}
        for touch in touches:
            key = touch.joint, touch.object_id
            if touch.distance <= TOUCHING and (key not in deepest or touch.distance < deepest[key].distance):
                deepest[key] = touch
        return [self._contact(frame, deepest[key]) for key in sorted(deepest)]

    def _contact(self, frame: int, touch: Touch) -> Contact:
        joint = JOINTS[touch.joint]
        return Contact(
            (frame,), joint, LINK_OF[joint].group, touch.object_id, self._scene.by_id[touch.object_id].movable,
            depth=max(0.0, -touch.distance), height=touch.point[1],
        )  # fmt: skip

    def _touches(self, world: World, frame: int) -> list[tuple[int, int, int]]:
        if self._objects is not self._still:  # While none moves, each touches what it touched before.
            self._still = self._objects
            self._pairs = sorted(pair for pair in world.touching() if not set(pair) & self._building)
        return [(frame, *pair) for pair in self._pairs]

    def _settle(self, world: World, pose: Pose, start: Pose2D) -> None:
        for _ in range(_SETTLE_FRAMES):
            self._frame(world, pose, np.zeros(3))
        drift = world.pose().root - pose.root
        if np.abs(drift).max() > _MAX_DRIFT:
            raise SceneError(
                f"the body does not stay on its start {_say(start)} of scene {self._scene.name!r}: it moved by "
                f"{np.round(drift, 2).tolist()} m at once.",
                "Start on a free, level floor.",
            )

    def _refuse_overlap(self, world: World, start: Pose2D) -> None:
        for contact in self._contacts(0, world.overlaps()):
            if contact.depth > _MAX_OVERLAP:
                obj = self._scene.by_id[contact.object_id]
                raise SceneError(
                    f"the body does not fit on its start {_say(start)} of scene {self._scene.name!r}: its "
                    f"{contact.joint} "
                    f"is {contact.depth:.2f} m inside {obj.category} {obj.id}.",
                    "Choose a start with more room around it.",
                )

    def _loaded(self) -> World:
        if self._world is None:
            raise HumanclawError("the simulator holds no scene.", "Call reset(scene, start) first.")
        return self._world

    def _ready(self, motion: Motion) -> World:
        if not (np.isfinite(motion.root).all() and np.isfinite(motion.rotations).all()):
            raise HumanclawError(
                "a commanded motion must be finite, and this one holds NaN or infinity.",
                "Check what generated it: its weights, or the numbers it was conditioned on.",
            )
        return self._loaded()


def _moved(began: Mapping[int, Array], paths: list[Mapping[int, Array]]) -> Mapping[int, Array]:
    """(frames, 7) path of each object that strayed from where it began."""
    found = dict[int, Array]()
    if all(states is began for states in paths):
        return found
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
