"""The specification of an episode: scene, start, seed, instruction and targets."""

from __future__ import annotations

import re
from typing import Annotated, Final, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from humanclaw.body.pose import WHOLE_TURN, Pose2D

_FARTHEST: Final = 10_000.0
"""Metres from the origin. Farther out, single precision no longer tells millimetres apart."""


class Record(BaseModel):
    """Base of all records: frozen, and strict about unknown fields, so that an old reader never misreads a new record.

    NaN and Infinity from a model are kept as words: JSON has no such numbers.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="strings")


Name = Annotated[str, Field(pattern=r"^[^\x00-\x1f\x7f-\x9f]*$")]
"""Text without control characters, which a terminal would obey."""


class Difficulty(Record):
    """How hard the shortest way to the nearest target is (paper, section 4.1)."""

    distance: float
    """Length of the way, metres."""
    turns: int
    """Number of turns above 30 degrees."""
    rooms: int
    """Number of rooms on the way, the first included."""
    obstacles: float
    """Mean number of objects within a metre of the way."""


class Goal(Record):
    """What the hands are to bring about, or what is to be answered."""

    things: tuple[int, ...] = ()
    """Ids of the objects to act on; any one of them will do. Empty for a question alone."""
    on: int | None = None
    """Id of the object that a thing is to lie on, let go."""
    share: Annotated[float, Field(ge=0, le=1)] = 0.0
    """How far a thing is to be opened, as a share of the way to wide open."""
    ways: dict[int, tuple[float, float]] = {}
    """By id of a thing on a joint: its state at the start, and that in which it is wide open (radians or metres)."""
    answer: str = ""
    """The words with which an active stop is to answer."""
    asks: Annotated[str, Field(exclude_if=lambda asks: not asks)] = ""
    """The kind of a question about oneself; empty for other goals, and then left out when written."""

    @model_validator(mode="after")
    def _acts_or_asks(self) -> Self:
        if not self.things and not (self.asks and self.answer):
            raise ValueError("a goal names things to act on, or the kind of a question and its answer; got neither")
        return self


def _on_the_map(start: Pose2D) -> Pose2D:
    """Raise ValueError for a start so far away that floats lose millimetres, and for a yaw in degrees."""
    if max(map(abs, (start.x, start.z, start.floor))) > _FARTHEST:
        raise ValueError(f"a start must lie within {_FARTHEST:g} m of the origin")
    if abs(start.yaw) > WHOLE_TURN:
        raise ValueError(f"yaw is radians, not degrees; got {start.yaw:g}")
    return start


class Partner(Record):
    """A scripted person in the same scene, and what is to be done together."""

    task: Literal["meet", "follow", "give"]
    """meet: find the partner, who stands. follow: stay near the partner, who walks a way. give: bring the partner, who
    asks for it, the thing of the goal."""
    start: Annotated[Pose2D, AfterValidator(_on_the_map)]
    way: tuple[tuple[float, float], ...] = ()
    """Corners (x, z) of the way that the partner walks, metres, on the floor of its start."""

    @model_validator(mode="after")
    def _walks_to_be_followed(self) -> Self:
        if (self.task == "follow") != bool(self.way):
            raise ValueError(f"a partner walks a way to be followed, and only then; got {len(self.way)} corners of one")
        return self


class EpisodeSpec(Record):
    """One episode: an instruction, a scene and a start."""

    id: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}$")]
    instruction: Annotated[str, Field(min_length=1)]
    scene: str
    """A scene reference, source:argument, such as house:0."""
    scene_digest: str = ""
    """A scene with another digest is refused; empty accepts any."""
    start: Annotated[Pose2D, AfterValidator(_on_the_map)] | None = None
    """Where to stand; None for the scene's own start."""
    target_category: str = ""
    """Empty for a free instruction, which is not scored."""
    target_ids: tuple[int, ...] = ()
    interact: bool = False
    """Whether the target is to be sat on."""
    max_steps: Annotated[int, Field(ge=1, le=10_000)] = 100
    seed: Annotated[int, Field(ge=0)] = 0
    difficulty: Difficulty | None = None
    """Given for the episodes of a split."""
    goal: Annotated[Goal | None, Field(exclude_if=lambda goal: goal is None)] = None
    """What the hands are to bring about; None for a task of walking and sitting, and then left out when written, so
    that digests of splits and records without hands stay as they were."""

    partner: Annotated[Partner | None, Field(exclude_if=lambda partner: partner is None)] = None
    """Who else is in the scene; None for a body alone, and then left out when written, as a goal is."""

    success: Annotated[Name, Field(exclude_if=lambda success: not success)] = ""
    """Name of the function that decides success (humanclaw_bench.task); empty if targets, goal or partner decide."""

    @property
    def for_agent(self) -> EpisodeSpec:
        """The part that an agent is told: the instruction, what follows from it, and the limit of steps. Scene, start,
        targets, seed and id would let it play the episode elsewhere first."""
        known = self.model_dump(include={"instruction", "target_category", "interact", "max_steps"})
        return EpisodeSpec(id="episode", scene="", **known)


def name_of(scene: str) -> str:
    """Return a scene reference as a part of an episode's id and folder: house:3 becomes house-3."""
    return re.sub(r"[^A-Za-z0-9._]+", "-", scene).strip("-")[:60]
