"""Half-physics: bodies follow commanded poses as contact and gravity allow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar, Final

import numpy as np

from humanclaw.body.pose import Motion, Pose2D, rest_pose
from humanclaw.body.skeleton import Side
from humanclaw.errors import HumanclawError, SceneError
from humanclaw.world.half_physics.broad_phase import BroadPhase
from humanclaw.world.half_physics.driven_body import Command
from humanclaw.world.half_physics.profile import Profile, find_profile
from humanclaw.world.half_physics.quaternions import Pose, poses_of
from humanclaw.world.half_physics.rest import at_rest
from humanclaw.world.half_physics.simulation import Simulation
from humanclaw.world.half_physics.world import ObjectMotion, OpenShared, OpenWorld, World
from humanclaw.world.scene import Scene
from humanclaw.world.simulator import Execution, WorldState

_SETTLE_FRAMES: Final = 5
"""A body without a floor has fallen 14 cm by then."""
_MAX_OVERLAP: Final = 0.02
"""Deepest contact of a start, metres. Contact pushes a body out of less; more would throw it or what it is in."""
_MAX_DRIFT: Final = 0.05
"""Metres along an axis that a body may move while it settles: a third of what it falls without a floor."""


class HalfPhysics:
    """The SharedSimulator on any engine (paper, section "Locomotion-Decoupled Physical Simulation").

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

    _simulation_type: ClassVar[type[Simulation]] = Simulation

    def __init__(
        self,
        open_world: OpenWorld,
        profile: str | Profile = "default",
        digest: str = "",
        open_shared: OpenShared | None = None,
    ) -> None:
        """Take an engine.

        Args:
            open_world: the engine.
            profile: 'default', 'paper', 'reference', or constants of your own.
            digest: of everything in the engine that may change where objects come to rest (`storage.source_digest`);
                empty to work that out anew in each process.
            open_shared: the same engine with several bodies; None if its worlds hold one.

        Raises HumanclawError for any other name of a profile.
        """
        self._open, self._open_shared, self._digest = open_world, open_shared, digest
        self._profile = find_profile(profile) if isinstance(profile, str) else profile
        self._measured: tuple[BroadPhase, Mapping[int, ObjectMotion]] | None = None
        """The broad phase of the scene of the last reset, and how its objects lie at a start."""
        self._simulation: Simulation | None = None

    @property
    def shared(self) -> bool:
        """Whether its worlds hold several bodies."""
        return self._open_shared is not None

    def reset(self, scene: Scene, start: Pose2D) -> WorldState:
        """Load a scene with every object at rest, stand the body on its start and let its feet settle.

        Raises SceneError if the body overlaps something there, is pushed aside, or finds no floor under it.
        """
        return self.reset_all(scene, [start])[0]

    def reset_all(self, scene: Scene, starts: Sequence[Pose2D]) -> tuple[WorldState, ...]:
        """Do so with a body on each start.

        Raises what reset raises, also for a body inside another; HumanclawError for several on an engine of one.
        """
        self.close()
        if self._measured is None or self._measured[0].scene is not scene:
            rest = at_rest(self._open, scene, self._profile, self._digest)
            self._measured = BroadPhase(scene), rest
        broad_phase, rest = self._measured
        poses = [poses_of(Pose2D(at.x, at.z, at.yaw, at.floor).to_world(rest_pose()))[0] for at in starts]
        worlds = self._opened(scene, poses)
        try:
            for key, motion in rest.items():
                worlds[0].set_motion(key, motion)
            simulation = self._simulation_type(worlds, self._profile, broad_phase, poses)
            _refuse_overlap(simulation, scene, starts)
            worlds[0].settled()
            _settle(simulation, poses, scene, starts)
        except BaseException:
            worlds[0].close()
            raise
        self._simulation = simulation
        return simulation.states()

    def _opened(self, scene: Scene, poses: Sequence[Pose]) -> Sequence[World]:
        if len(poses) == 1:
            return [self._open(scene, self._profile, poses[0])]
        if self._open_shared is None or not poses:
            raise HumanclawError(
                f"a world of this simulator holds one body; got {len(poses)} starts.", "Ask for one, or use mujoco."
            )
        return self._open_shared(scene, self._profile, poses)

    def execute(self, motion: Motion) -> Execution:
        """Drive the body through consecutive frames at 30 a second, world frame; the vertical root motion is not
        commanded.

        Raises HumanclawError before the first reset, and for a motion that holds numbers which are not finite.
        """
        return self.execute_all([motion])[0]

    def execute_all(self, motions: Sequence[Motion]) -> tuple[Execution, ...]:
        """Drive each body through its motion, as execute does.

        Raises what execute raises, and HumanclawError unless there is one motion a body, all of one length.
        """
        if not all(np.isfinite(motion.root).all() and np.isfinite(motion.rotations).all() for motion in motions):
            raise HumanclawError(
                "a commanded motion must be finite, and this one holds NaN or infinity.",
                "Check what generated it: its weights, or the numbers it was conditioned on.",
            )
        return self._loaded().execute(motions)

    def state(self) -> WorldState:
        """Return the pose of the body and of every movable object, now.

        Raises HumanclawError before the first reset.
        """
        return self.states()[0]

    def states(self) -> tuple[WorldState, ...]:
        """Return the state that each body is in. Raises HumanclawError before the first reset."""
        return self._loaded().states()

    def grip(self, side: Side, closed: bool, body: int = 0) -> None:
        """Open a hand of a body, or close it on the nearest movable object before its palm.

        Raises HumanclawError before the first reset.
        """
        self._loaded().bodies[body].hands.grip(side, closed)

    def close(self) -> None:
        """Free the world; a closed simulator can be reset again."""
        if self._simulation is not None:
            self._simulation.world.close()
            self._simulation = None

    def _loaded(self) -> Simulation:
        if self._simulation is None:
            raise HumanclawError("the simulator holds no scene.", "Call reset(scene, start) first.")
        return self._simulation


def _refuse_overlap(simulation: Simulation, scene: Scene, starts: Sequence[Pose2D]) -> None:
    for start, contacts in zip(starts, simulation.overlaps(), strict=True):
        for contact in contacts:
            if contact.depth > _MAX_OVERLAP:
                obj = None if contact.person else scene.by_id[contact.object_id]
                raise SceneError(
                    f"the body does not fit on its start {_say(start)} of scene {scene.name!r}: its {contact.joint} "
                    f"is {contact.depth:.2f} m inside {f'{obj.category} {obj.id}' if obj else 'another body'}.",
                    "Choose a start with more room around it.",
                )


def _settle(simulation: Simulation, poses: Sequence[Pose], scene: Scene, starts: Sequence[Pose2D]) -> None:
    for _ in range(_SETTLE_FRAMES):
        simulation.frame([Command.still(pose) for pose in poses])
    for body, pose, start in zip(simulation.bodies, poses, starts, strict=True):
        drift = body.world.pose().root - pose.root
        if not np.abs(drift).max() <= _MAX_DRIFT:  # NaN, of a start that is none, is no drift within bounds either.
            raise SceneError(
                f"the body does not stay on its start {_say(start)} of scene {scene.name!r}: it moved by "
                f"{np.round(drift, 2).tolist()} m at once.",
                "Start on a free, level floor.",
            )


def _say(start: Pose2D) -> str:
    return f"(x {start.x:.2f}, z {start.z:.2f}, floor {start.floor:.2f})"
