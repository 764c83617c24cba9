"""What half-physics asks of a physics engine: one scene, its bodies, and steps of time."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, Protocol

from humanclaw.body.pose import Array
from humanclaw.world.half_physics.profile import Profile
from humanclaw.world.half_physics.quaternions import Pose
from humanclaw.world.scene import Scene

TOUCHING: Final = 0.002
"""Shapes closer than this count as touching, metres: solvers let resting contacts hover by fractions of a
millimetre."""
LEVEL: Final = 0.7
"""A surface is level, and a contact carries and does not block, if the upward component of its unit normal exceeds
this: within 45 degrees."""
TRAVEL: Final = 0.01
"""How far a link may come towards something between two looks for contacts, metres: contacts act that far ahead."""


class Touch(NamedTuple):
    """A link of a body meets an object, or another body (`person_id`)."""

    joint: int
    """Index of the link's joint."""
    object_id: int
    point: tuple[float, float, float]
    """World frame, metres."""
    normal: tuple[float, float, float]
    """Unit vector from the object to the body."""
    distance: float
    """Metres, negative inside."""
    force: float
    """Along the normal, newtons."""
    body: int = 0
    """Number of the body whose link it is, in a world of several."""


@dataclass(frozen=True)
class ObjectMotion:
    """How a movable object moves, at its centre of mass, world frame. All (3,) but the quaternion x, y, z, w."""

    position: Array
    quaternion: Array
    velocity: Array
    spin: Array
    """Angular velocity, rad/s."""


class World(Protocol):
    """A scene and a body in one engine; other bodies may be there too.

    Gravity acts on everything, and friction of a pair is the product of both surfaces'. The body is a tree of links
    with the masses and inertias of `half_physics.skeleton`: no motor, no spring, no damping, no contact with
    itself. An object on a joint turns about it or slides along it within its range, braked by its friction and damping,
    and collides only with the body and with free objects. The same calls have the same outcome, bit for bit.
    """

    def pose(self) -> Pose:
        """Return the body's pose now."""

    def velocity(self) -> tuple[Array, Array]:
        """Return (3,) linear and (3,) angular velocity of the pelvis, world frame."""

    def move(self, root: Array, quaternion: Array, velocity: Array, spin: Array) -> None:
        """Put the pelvis somewhere, moving so; world frame."""

    def drive(self, velocity: Array, spin: Array) -> None:
        """Let the pelvis move so from where it is; world frame."""

    def bend(self, quaternions: Array, speeds: Array) -> None:
        """Put the other 23 joints at (23, 4) and let them turn at (23, 3) rad/s in their own frames."""

    def step(self, seconds: float) -> Sequence[Touch]:
        """Advance time for all bodies. Returns their contacts, and near misses."""

    def overlaps(self) -> Sequence[Touch]:
        """Return the bodies' contacts at the current poses; no time passes."""

    def touching(self) -> Collection[tuple[int, int]]:
        """Pairs of objects that touch one another, lower id first, one of them movable."""

    def top(self, object_id: int, above: Array, below: Array) -> float | None:
        """Height of an object's level upper side on the way down from one point to another; None if something else is
        first."""

    def motion(self, object_id: int) -> ObjectMotion:
        """Measure how a movable object moves now."""

    def set_motion(self, object_id: int, motion: ObjectMotion) -> None:
        """Let it move otherwise; one on a joint, as far as that allows."""

    def objects(self) -> Mapping[int, Array]:
        """Movable object id to (7,) position and quaternion of its asset's own frame: the same mapping as long as none
        has moved."""

    def let_pass(self, pairs: frozenset[tuple[int, int]]) -> None:
        """Let these links (index of the joint) and objects (id) alone have no contact, from now on."""

    def settled(self) -> None:
        """Objects without speed have come to rest: an engine may let them sleep."""

    def close(self) -> None:
        """Free the engine's memory."""


class OpenWorld(Protocol):
    """What an engine's plugin brings."""

    def __call__(self, scene: Scene, profile: Profile, pose: Pose) -> World:
        """Load a scene with a body at rest in a pose. Raises SceneError for a movable object without a mass."""


class OpenShared(Protocol):
    """What an engine's plugin brings besides whose worlds hold several bodies."""

    def __call__(self, scene: Scene, profile: Profile, poses: Sequence[Pose]) -> Sequence[World]:
        """Load a scene with bodies at rest, which meet one another as they meet objects.

        Returns the one world as each body has it: pose, velocity, move, drive, bend and let_pass are its own. Raises as
        OpenWorld does.
        """
