"""All that a skill package uses of plugin API 1.0: parameters of each kind, a check, a sequence, an observer."""

from typing import Annotated, Literal

from pydantic import Field

from humanclaw import Check, Chunk, EpisodeRecord, Keyframes, StepRecord, hookimpl, skill
from humanclaw.plugins import RegisterSkill

HUMANCLAW_API = "1.0"
heard: list[str] = []
"""What the observer was told."""


@skill(checks=["Is anybody in view?", Check("room", "There is room in front of the body.")])
def bow(degrees: Annotated[int, Field(ge=5, le=40)], depth: Annotated[float, Field(ge=0.5, le=1)] = 1.0) -> Keyframes:
    """Bow to somebody."""
    return Keyframes.cycle("spine1", axis="x", degrees=degrees * depth, seconds=1)


@skill(role="posture")
def bow_and_wave(side: Literal["left", "right"] = "left") -> list[Keyframes]:
    """Bow, and wave a hand."""
    wave = Keyframes.cycle(f"{side}_elbow", axis="z", degrees=40, seconds=0.5, times=2)
    return [Keyframes.cycle("spine1", axis="x", degrees=20, seconds=1), wave]


@hookimpl
def humanclaw_skills(register: RegisterSkill) -> None:
    register(bow)
    register(bow_and_wave)


@hookimpl
def humanclaw_chunk(episode: EpisodeRecord, step: int, chunk: Chunk) -> None:
    heard.append(f"chunk of step {step}: {len(chunk.commanded)} frames")


@hookimpl
def humanclaw_step(episode: EpisodeRecord, step: StepRecord) -> None:
    heard.append(f"step {step.step}: {step.status}")


@hookimpl
def humanclaw_episode_end(episode: EpisodeRecord) -> None:
    heard.append(episode.outcome)
