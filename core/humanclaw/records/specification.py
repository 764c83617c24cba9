"""What is asked of a body: an episode's specification."""

from __future__ import annotations

import re
from typing import Annotated, Final

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from humanclaw.body.pose import Pose2D

_FARTHEST: Final = 10_000.0


class Record(BaseModel):
    """Base of all records: frozen, and strict about unknown fields, so that an old reader never misreads a new record.

    What a model wrote as NaN or Infinity is kept as that word: JSON has no such number.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="strings")


Name = Annotated[str, Field(pattern=r"^[^\x00-\x1f\x7f-\x9f]*$")]
"""What a terminal prints and does not obey."""


class Difficulty(Record):
    """How hard the shortest way to the nearest target is (paper, section 4.1)."""

    distance: float
    """Its length, metres."""
    turns: int
    """Of more than 30 degrees."""
    rooms: int
    """That it enters, the one of the start included."""
    obstacles: float
    """Pieces of furniture within a metre, averaged along it."""


def _on_the_map(start: Pose2D) -> Pose2D:
    """Hold a start to where floats still tell millimetres."""
    if max(map(abs, (start.x, start.z, start.floor))) > _FARTHEST:
        raise ValueError(f"a start lies within {_FARTHEST:g} m of the origin")
    return start


class EpisodeSpec(Record):
    """One episode: an instruction, a scene and a start."""

    id: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}$")]
    instruction: Annotated[str, Field(min_length=1)]
    scene: str
    """Scheme and name, such as house:0."""
    scene_digest: str = ""
    """If given, a scene with another digest is refused."""
    start: Annotated[Pose2D, AfterValidator(_on_the_map)] | None = None
    """None: where the scene says."""
    target_category: str = ""
    """Empty for a free instruction, which is then not scored."""
    target_ids: tuple[int, ...] = ()
    interact: bool = False
    """Whether the target is to be sat on."""
    max_steps: Annotated[int, Field(ge=1, le=10_000)] = 100
    seed: Annotated[int, Field(ge=0)] = 0
    difficulty: Difficulty | None = None
    """Known of the episodes of a split."""


def name_of(scene: str) -> str:
    """Make a scene reference part of an episode's id: house:3 becomes house-3, and so does whatever a file cannot be
    called."""
    return re.sub(r"[^A-Za-z0-9._]+", "-", scene).strip("-")[:60]
