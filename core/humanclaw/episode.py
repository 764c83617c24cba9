"""What is asked of a body: one episode, complete in itself."""

from __future__ import annotations

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
