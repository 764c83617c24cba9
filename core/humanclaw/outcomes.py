"""The facts of a step that success rests on, each defined once: what is seen, reached, sat on, stood on, acknowledged."""

from __future__ import annotations

import re
from collections.abc import Sequence, Set
from typing import Final

from humanclaw.records import Contact, EpisodeSpec, RecordedEpisode, StepRecord
from humanclaw.tasks import ALIASES

SEEN_PIXELS: Final = 100
"""Pixels of the 512 x 512 view from which on a target counts as seen."""
REACHED: Final = 0.2
"""Metres from the body to a target's bounding box within which it counts as reached."""
FLOOR_THRESHOLD: Final = 0.0205
"""Contacts lower than this over the floor of the start are steps on the ground, metres."""
_SENTENCE: Final = re.compile(r"[.!?](?=\s|$)|[;\n]")
_NEGATION: Final = re.compile(
    r"\b(?:no|not|none|never|neither|nor|nothing|nowhere|without|cannot|cant|absent|missing|invisible|unseen)\b"
    r"|n['\u2019]t\b|\bout of (?:view|sight)\b"
)


def acknowledges(text: str, category: str) -> bool:
    """Tell whether a sentence names the target or an alias of its category (or says 'target') and holds no negation."""
    names = (*ALIASES.get(category, (category.replace("_", " "),)), "target")
    named = re.compile(rf"\b(?:{'|'.join(map(re.escape, names))})(?:e?s)?\b")
    sentences = _SENTENCE.split(text.lower().replace("_", " "))
    return any(named.search(sentence) and not _NEGATION.search(sentence) for sentence in sentences)


def in_view(step: StepRecord) -> bool:
    """Tell whether the targets together cover enough of the view that the step was decided from."""
    return sum(step.target_pixels.values()) >= SEEN_PIXELS


def role_of(recorded: RecordedEpisode, step: StepRecord) -> str:
    """Return the role of the skill that a step called.

    Empty for a step without a call, or of a skill that the record does not know.
    """
    info = recorded.record.skills.get(step.call.skill) if step.call else None
    return info.role if info else ""


def on_target(recorded: RecordedEpisode, step: StepRecord) -> bool:
    """Tell whether the pelvis touches a target in the last frame of a step."""
    return bool(set(step.pelvis_contacts) & set(recorded.record.spec.target_ids))


def succeeded(spec: EpisodeSpec, steps: Sequence[StepRecord]) -> bool:
    """Decide whether an episode ended in success: an active stop within reach and, if it was asked for, after sitting.

    What the pelvis rests on is that of the last executed step before the stop.
    """
    if not steps or steps[-1].status != "stopped":
        return False
    distance = steps[-1].target_distance
    if distance is None or distance > REACHED:
        return False
    before = next((step for step in reversed(steps[:-1]) if step.call), None)
    return not spec.interact or (before is not None and bool(set(before.pelvis_contacts) & set(spec.target_ids)))


def footing(contact: Contact, ground: Set[int]) -> bool:
    """Tell whether a contact is a foot on what it is meant to stand on. ground: ids of floors and stairs."""
    return contact.object_id in ground and contact.joint.endswith(("_ankle", "_foot"))


def touched_above_ground(recorded: RecordedEpisode, step: StepRecord) -> tuple[Contact, ...]:
    """The contacts of a step but for those of standing: none below FLOOR_THRESHOLD, no foot on stairs or on an upper floor."""
    level, ground = recorded.record.start.floor + FLOOR_THRESHOLD, set(recorded.record.ground)
    return tuple(contact for contact in step.contacts if contact.height > level and not footing(contact, ground))


def end_distance(recorded: RecordedEpisode) -> float:
    """From the nearest body point to the nearest target's bounding box at the end, metres; infinite if unknown.

    A step without a usable call leaves the body where it is, so the last distance that was recorded holds.
    """
    known = [step.target_distance for step in recorded.steps if step.target_distance is not None]
    return known[-1] if known else float("inf")


def reached(recorded: RecordedEpisode) -> bool:
    """Tell whether the body ends within reach of a target, stopped or not."""
    return end_distance(recorded) <= REACHED
