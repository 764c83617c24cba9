"""Marks on the time line of an episode: contacts as spans, events as points."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from humanclaw import RecordedEpisode, StepRecord
from humanclaw.records import in_view, on_target
from humanclaw_report.episode_summary import name_of, shown_contacts, verdict_of


@dataclass(frozen=True)
class Mark:
    """A span or a point of the time line. at and wide: shares of the whole, per cent."""

    kind: Literal["target", "fixed", "movable", "event", "refused", "cause"]
    at: float
    wide: float
    words: str


def marks(
    recorded: RecordedEpisode, names: Mapping[int, str], cause: str = "", decided: int | None = None
) -> tuple[Mark, ...]:
    """Return the contacts above the ground, then the events, each by its time, then why the episode failed.

    decided: index of the step that decided the cause.
    """
    frames = max(1, recorded.spans[-1][1]) if recorded.steps else 1
    timeline = (*_contacts(recorded, names, frames), *_events(recorded, frames))
    if not cause or decided is None:
        return timeline
    at = 100 * recorded.spans[decided][0] / frames
    return (*timeline, Mark("cause", at, 0, f"step {recorded.steps[decided].step}: root cause: {cause}"))


def _contacts(recorded: RecordedEpisode, names: Mapping[int, str], frames: int) -> Iterator[Mark]:
    """Yield one span for each object that a step touches."""
    targets = set(recorded.record.spec.target_ids)
    for step, (first, _) in zip(recorded.steps, recorded.spans, strict=True):
        touched: dict[int, list[int]] = {}
        movable: set[int] = set()
        for contact in shown_contacts(recorded, step):
            touched.setdefault(contact.object_id, []).extend(contact.frames)
            movable |= {contact.object_id} if contact.movable else set()
        for key, frames_touched in touched.items():
            if frames_touched:
                kind: Literal["target", "fixed", "movable"] = (
                    "target" if key in targets else "movable" if key in movable else "fixed"
                )
                at, wide = (
                    100 * (first + min(frames_touched)) / frames,
                    100 * (max(frames_touched) - min(frames_touched) + 1) / frames,
                )
                yield Mark(kind, at, wide, f"step {step.step}: touches {name_of(names, key)}")


def _events(recorded: RecordedEpisode, frames: int) -> Iterator[Mark]:
    """Yield when the target was first in view, when the body sat, and what was refused, replaced or ended it."""
    begun = {step.step: 100 * first / frames for step, (first, _) in zip(recorded.steps, recorded.spans, strict=True)}
    first_views = [step for step in recorded.steps if in_view(step)][:1]
    first_seats = [step for step in recorded.steps if on_target(recorded, step)][:1]
    for words, steps in (("target first in view", first_views), ("hips on the target", first_seats)):
        for step in steps:
            yield Mark("event", begun[step.step], 0, f"step {step.step}: {words}")
    for step in recorded.steps:
        for words in _refused(step):
            yield Mark("refused", begun[step.step], 0, f"step {step.step}: {words}")


def _refused(step: StepRecord) -> Iterator[str]:
    for attempt in step.attempts:
        if attempt.error:
            yield f"rejected: {attempt.error}"
    if verdict_of(step)[0] == "replaced":
        yield "the verifier replaced the call"
