"""A world that a body moves in: the simulator's protocol, and the values that cross it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol, TypeAlias

from humanclaw.body.pose import Array, Motion, Pose2D
from humanclaw.body.skeleton import BodyGroup
from humanclaw.text.json import STRICT
from humanclaw.world.scene import Scene


# -- the world ---------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class WorldState:
    """A moment of the world: the body's pose (one frame, world frame) and where the movable objects are."""

    body: Motion
    objects: Mapping[int, Array]
    """Object id to (7,): position, then quaternion x, y, z, w. Movable objects only; the rest is where the scene
    says."""


@dataclass(frozen=True)
class Execution:
    """What became of 15 commanded frames."""

    simulated: Motion
    """15 frames in the world frame, as physics left them."""
    contacts: tuple[Contact, ...]
    touches: tuple[tuple[int, int, int], ...]
    """(frame, object id, object id): a movable object touches another object that is not the building."""
    objects: Mapping[int, Array]
    """Id of each movable object that moved in this chunk to its (15, 7) path."""


class Simulator(Protocol):
    """Half-physics (paper, section 3.4): the body follows commanded poses as contact and gravity allow."""

    def reset(self, scene: Scene, start: Pose2D) -> WorldState:
        """Load a scene and stand the body on its start, in any pose: the first frames that it is then driven through,
        five of them, are the stance in which the motion model begins. Raises SceneError if the body does not fit there.
        """

    def execute(self, motion: Motion) -> Execution:
        """Drive the body through consecutive frames given in the world frame; the vertical root motion is not
        commanded."""

    def state(self) -> WorldState: ...

    def close(self) -> None: ...


DistanceFn: TypeAlias = Callable[[Array], float]
"""From a pelvis (3,) to the length of the shortest way to a target, metres; infinite if there is none."""
DistanceFactory: TypeAlias = Callable[[Scene, Sequence[int], float], DistanceFn]
"""Makes a DistanceFn for a scene, the ids of its targets and the height of the floor at the start."""


# -- what came of it ---------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Contact:
    """A link of the body against an object: in which frames, and the deepest and highest point of them.

    A simulator tells of the 15 frames of a chunk, one or more at a time; a record of all frames of a step.
    """

    __pydantic_config__: ClassVar = STRICT

    frames: tuple[int, ...]
    """Counted from the first of the chunk or step."""
    joint: str
    group: BodyGroup
    object_id: int
    movable: bool
    depth: float
    """Penetration in metres, positive inside."""
    height: float
    """World height of the contact point, metres."""


@dataclass(frozen=True)
class Chunk:
    """Half a second: the motion that was commanded (15 frames, world frame), and what physics made of it."""

    commanded: Motion
    execution: Execution
