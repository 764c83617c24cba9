"""The protocol of simulators, and the values that they exchange."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Protocol, TypeAlias

from humanclaw.body.pose import Array, Motion, Pose2D
from humanclaw.body.skeleton import BodyGroup, Side
from humanclaw.text.json import STRICT
from humanclaw.world.scene import Scene


@dataclass(frozen=True)
class WorldState:
    """A moment of the world: the body's pose (one frame, world frame) and the poses of movable objects."""

    body: Motion
    objects: Mapping[int, Array]
    """Pose (7,) by id of the movable object: position, then quaternion x, y, z, w."""
    held: Mapping[Side, int] = field(default_factory=dict)
    """Id of the object in each hand that holds one, by side."""


@dataclass(frozen=True)
class Execution:
    """Result of executing 15 commanded frames."""

    simulated: Motion
    """The 15 simulated frames (world frame)."""
    contacts: tuple[Contact, ...]
    touches: tuple[tuple[int, int, int], ...]
    """(frame, object id, object id): a movable object touches another object that is not the building."""
    objects: Mapping[int, Array]
    """Path (15, 7) by id of each movable object that moved in this chunk."""
    held: Mapping[Side, int] = field(default_factory=dict)
    """Id of the object in each hand that holds one at the end, by side."""
    heard: tuple[Heard, ...] = ()
    """What others said since the chunk before."""


class Simulator(Protocol):
    """Half-physics (paper, section 3.4): the body follows commanded poses as contact and gravity allow."""

    def reset(self, scene: Scene, start: Pose2D) -> WorldState:
        """Load a scene and stand the body on its start, in any pose.

        The first five frames that it is then driven through are the stance of the motion model. Raises SceneError if
        the body does not fit there.
        """

    def execute(self, motion: Motion) -> Execution:
        """Drive the body through consecutive frames (world frame). The vertical root motion is not commanded."""

    def grip(self, side: Side, closed: bool) -> None:
        """Open the left or right hand, or close it on the nearest movable object before its palm. state() says what it
        holds."""

    def state(self) -> WorldState: ...

    def close(self) -> None: ...


DistanceFn: TypeAlias = Callable[[Array], float]
"""Maps a pelvis (3,) to the length of the shortest way to a target, metres; infinite if there is none."""
DistanceFactory: TypeAlias = Callable[[Scene, Sequence[int], float], DistanceFn]
"""Makes a DistanceFn from a scene, the ids of its targets and the height of the start's floor."""


@dataclass(frozen=True)
class Contact:
    """Contact of a link with an object: its frames, and the deepest and highest point among them.

    A simulator reports contacts of a chunk (15 frames); a record merges those of a step.
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
class Heard:
    """What another person said, as it is heard."""

    __pydantic_config__: ClassVar = STRICT

    text: str
    at: tuple[float, float, float]
    """Where the speaker's head is: left, up, ahead in metres, in the frame of the body that hears."""


@dataclass(frozen=True)
class Chunk:
    """Half a second: the commanded motion (15 frames, world frame) and its execution."""

    commanded: Motion
    execution: Execution
