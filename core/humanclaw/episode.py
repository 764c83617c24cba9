"""What is asked of a body: one episode, complete in itself."""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Frozen = ConfigDict(frozen=True, extra="forbid")


class StartPose(BaseModel):
    """Where the body stands at first. Metres, radians."""

    model_config = Frozen

    x: float
    z: float
    yaw: float
    floor: float = 0.0


class Difficulty(BaseModel):
    """How hard the shortest way to the nearest target is (paper, section 4.1)."""

    model_config = Frozen

    distance: float
    """Its length, metres."""
    turns: int
    """Of more than 30 degrees."""
    rooms: int
    """That it enters, the one of the start included."""
    obstacles: float
    """Pieces of furniture within a metre, averaged along it."""


class EpisodeSpec(BaseModel):
    """One episode: an instruction, a scene and a start."""

    model_config = Frozen

    id: Annotated[str, Field(pattern=r"^[A-Za-z0-9._-]{1,100}$")]
    instruction: Annotated[str, Field(min_length=1)]
    scene: str
    """Scheme and name, such as house:0."""
    scene_digest: str = ""
    """If given, a scene with another digest is refused."""
    start: StartPose | None = None
    """None: where the scene says."""
    target_category: str = ""
    """Empty for a free instruction, which is then not scored."""
    target_ids: tuple[int, ...] = ()
    interact: bool = False
    """Whether the target is to be sat on."""
    max_steps: Annotated[int, Field(ge=1, le=10_000)] = 100
    seed: int = 0
    difficulty: Difficulty | None = None
    """Known of the episodes of a split."""


def name_of(scene: str) -> str:
    """A scene reference as part of an episode's id: house:3 becomes house-3, and so does whatever a file cannot be called."""
    return re.sub(r"[^A-Za-z0-9._]+", "-", scene).strip("-")[:60]
