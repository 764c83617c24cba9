"""The facts that success depends on, each defined once: seen, acknowledged, reached, sat on, stood on."""

from __future__ import annotations

from collections.abc import Container, Sequence, Set
from typing import Final

from humanclaw.records.goals import is_met
from humanclaw.records.reading import RecordedEpisode
from humanclaw.records.sighting import SEEN_PIXELS, acknowledges as acknowledges
from humanclaw.records.specification import EpisodeSpec
from humanclaw.records.steps import StepRecord
from humanclaw.records.transition import Transition
from humanclaw.world.simulator import Contact

REACHED: Final = 0.2
"""Metres from the body to a target's bounding box within which it counts as reached."""
FLOOR_THRESHOLD: Final = 0.0205
"""Metres above the start's floor. Lower contacts count as steps on the ground."""


def in_view(step: StepRecord) -> bool:
    """Tell whether the targets together cover enough of the view that the step was decided from."""
    return sum(step.target_pixels.values()) >= SEEN_PIXELS


def role_of(recorded: RecordedEpisode, step: StepRecord) -> str:
    """Return the role of the skill that a step called; empty without a call or for a skill missing from the record."""
    info = recorded.record.skills.get(step.call.skill) if step.call else None
    return info.role if info else ""


def on_target(recorded: RecordedEpisode, step: StepRecord) -> bool:
    """Tell whether the pelvis touches a target in the last frame of a step."""
    return bool(set(step.pelvis_contacts) & set(recorded.record.spec.target_ids))


def stopped_within_reach(steps: Sequence[StepRecord]) -> bool:
    """Tell whether an active stop ended the steps with the body within reach of a target (NavSR)."""
    last = steps[-1] if steps else None
    return last is not None and last.status == "stopped" and _distance(last) <= REACHED


def stopped_seated(spec: EpisodeSpec, steps: Sequence[StepRecord], sits: Container[str]) -> bool:
    """Tell whether the body sat down, and an active stop ended the steps with the pelvis on a target (InteractSR).

    sits: names of the skills of role sit. The contacts of the pelvis are those of the last physics frame before the
    stop.
    """
    if not steps or steps[-1].status != "stopped":
        return False
    sat = any(step.call and step.call.skill in sits for step in steps)
    return sat and bool(set(steps[-1].pelvis_contacts) & set(spec.target_ids))


def succeeded(spec: EpisodeSpec, steps: Sequence[StepRecord], sits: Container[str]) -> bool:
    """Tell whether an episode succeeded: its goal met at an active stop; else stopped on the target if the task is to
    sit, otherwise within reach."""
    if spec.goal is not None:
        return is_met(spec.goal, steps)
    return stopped_seated(spec, steps, sits) if spec.interact else stopped_within_reach(steps)


def sits_of(recorded: RecordedEpisode) -> frozenset[str]:
    """Return the names of the skills of role sit in a record."""
    return frozenset(name for name, info in recorded.record.skills.items() if info.role == "sit")


def footing(contact: Contact, ground: Set[int]) -> bool:
    """Tell whether a contact is a foot on the ground. ground: ids of floors and stairs."""
    return contact.object_id in ground and contact.joint.endswith(("_ankle", "_foot"))


def touched_above_ground(recorded: RecordedEpisode | Transition, step: StepRecord) -> tuple[Contact, ...]:
    """Return the contacts of a step, without those of standing: below FLOOR_THRESHOLD, or a foot on stairs or an upper
    floor."""
    level, ground = recorded.record.start.floor + FLOOR_THRESHOLD, set(recorded.record.ground)
    return tuple(contact for contact in step.contacts if contact.height > level and not footing(contact, ground))


def end_distance(recorded: RecordedEpisode) -> float:
    """Return the distance from the nearest body point to the nearest target's box after the last step, metres.

    Infinite if unknown. A stop moves nothing, so this is also the distance at the stop.
    """
    return _distance(recorded.steps[-1]) if recorded.steps else float("inf")


def _distance(step: StepRecord) -> float:
    return float("inf") if step.target_distance is None else step.target_distance


def ever_reached(recorded: RecordedEpisode) -> bool:
    """Tell whether the body is within reach of a target after any step."""
    return any(_distance(step) <= REACHED for step in recorded.steps)


def reached(recorded: RecordedEpisode) -> bool:
    """Tell whether the body ends within reach of a target, stopped or not."""
    return end_distance(recorded) <= REACHED
