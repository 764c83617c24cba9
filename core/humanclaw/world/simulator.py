"""The protocol of simulators, and the values that they exchange."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import ClassVar, Protocol, TypeAlias, runtime_checkable

from humanclaw.body.pose import Array, Motion, Pose2D
from humanclaw.body.skeleton import BodyGroup, Side
from humanclaw.errors import HumanclawError
from humanclaw.text.json import STRICT
from humanclaw.world.scene import Scene


def person_id(body: int) -> int:
    """Return the id under which the others see and touch a body of a shared world: -2 for body 0, -3 for body 1."""
    return -2 - body


def body_numbers(others: Sequence[int]) -> tuple[int, ...]:
    """Return the number of a body, the first that none of the others in its world has, and theirs by person_id()."""
    own = next(number for number in count() if person_id(number) not in others)
    return (own, *(person_id(0) - person for person in others))


@dataclass(frozen=True)
class WorldState:
    """A moment of the world: the body's pose (one frame, world frame) and the poses of movable objects."""

    body: Motion
    objects: Mapping[int, Array]
    """Pose (7,) by id of the movable object: position, then quaternion x, y, z, w."""
    held: Mapping[Side, int] = field(default_factory=dict)
    """Id of the object in each hand that holds one, by side."""
    people: Mapping[int, Motion] = field(default_factory=dict)
    """Poses (one frame) of the other bodies, by `person_id`."""


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
    people: Mapping[int, Motion] = field(default_factory=dict)
    """The simulated frames of the other bodies, by `person_id`."""
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


@runtime_checkable
class SharedSimulator(Simulator, Protocol):
    """A simulator whose world may hold several bodies, each with an Execution and a WorldState of its own.

    As a Simulator it moves a world of one. Not every simulator is shared: ask `shared`.
    """

    @property
    def shared(self) -> bool:
        """Whether its worlds hold several bodies."""

    def reset_all(self, scene: Scene, starts: Sequence[Pose2D]) -> Sequence[WorldState]:
        """Stand a body on each start. Raises SceneError as reset does, also for two bodies in one place."""

    def execute_all(self, motions: Sequence[Motion]) -> Sequence[Execution]:
        """Drive each body through its motion, all of the same number of frames at the same time."""

    def states(self) -> Sequence[WorldState]: ...

    def grip(self, side: Side, closed: bool, body: int = 0) -> None: ...


def shared(simulator: Simulator) -> SharedSimulator:
    """Return a simulator whose worlds hold several bodies. Raises HumanclawError for one whose worlds hold one."""
    if isinstance(simulator, SharedSimulator) and simulator.shared:
        return simulator
    raise HumanclawError("the worlds of this simulator hold one body.", "Choose bullet or mujoco for several.")


DistanceFn: TypeAlias = Callable[[Array], float]
"""Maps a pelvis (3,) to the length of the shortest way to a target, metres; infinite if there is none."""
DistanceFactory: TypeAlias = Callable[[Scene, Sequence[int], float], DistanceFn]
"""Makes a DistanceFn from a scene, the ids of its targets and the height of the start's floor."""


@dataclass(frozen=True)
class Contact:
    """Contact of a link with an object or a person: its frames, and the deepest and highest point among them.

    A simulator reports contacts of a chunk (15 frames); a record merges those of a step.
    """

    __pydantic_config__: ClassVar = STRICT

    frames: tuple[int, ...]
    """Counted from the first of the chunk or step."""
    joint: str
    group: BodyGroup
    object_id: int
    """Of an object, or the `person_id` of another body."""
    movable: bool
    depth: float
    """Penetration in metres, positive inside."""
    height: float
    """World height of the contact point, metres."""

    @property
    def person(self) -> bool:
        """Whether the link met another body, and no object."""
        return self.object_id < 0


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
