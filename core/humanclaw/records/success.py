"""The facts that success depends on, each defined once: seen, acknowledged, reached, sat on, stood on, and the goals of
hands: a thing lies where it should, is open, is answered."""

from __future__ import annotations

from collections.abc import Container, Sequence, Set
from typing import Final

import numpy as np

from humanclaw.body.pose import Array
from humanclaw.records.acknowledgement import SEEN_PIXELS, acknowledges as acknowledges
from humanclaw.records.recorded_episode import RecordedEpisode
from humanclaw.records.specification import EpisodeSpec, Goal
from humanclaw.records.steps import StepRecord
from humanclaw.records.transition import Transition
from humanclaw.world.simulator import Contact

REACHED: Final = 0.2
"""Metres from the body to a target's bounding box within which it counts as reached."""
FLOOR_THRESHOLD: Final = 0.0205
"""Metres above the start's floor. Lower contacts count as steps on the ground."""


_INSIDE: Final = 0.01 * 512**2
"""Pixels of the inside of furniture, from which it counts as looked into: a hundredth of the view."""
_RESTS: Final = 0.05
"""Metres between a thing and the top of what it lies on, at most."""


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
    """Return the contacts of a step with objects, without those of standing: below FLOOR_THRESHOLD, or a foot on stairs
    or an upper floor."""
    level, ground = recorded.record.start.floor + FLOOR_THRESHOLD, set(recorded.record.ground)
    above = (contact for contact in step.contacts if contact.height > level and not contact.person)
    return tuple(contact for contact in above if not footing(contact, ground))


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


# -- goals of hands ----------------------------------------------------------------------------------------------------
def is_met(goal: Goal, steps: Sequence[StepRecord]) -> bool:
    """Tell whether an active stop ended the steps with the goal met."""
    if not steps or steps[-1].status != "stopped":
        return False
    if goal.answer:
        return (bool(goal.asks) or looked(goal, steps)) and answered(goal, steps[-1])
    return brought(goal, steps)


def brought(goal: Goal, steps: Sequence[StepRecord]) -> bool:
    """Tell whether the world is after these steps as a goal has it, whatever is said. A look inside changes nothing."""
    if goal.on is not None:
        return any(lies_on(steps, thing, goal.on) for thing in goal.things)
    return bool(goal.answer) or opened(goal, steps)


def lies_on(steps: Sequence[StepRecord], thing: int, place: int) -> bool:
    """Tell whether a thing lies on another one after these steps, held by no hand. Both are targets of the episode."""
    if not steps or thing in steps[-1].held.values() or not {thing, place} <= steps[-1].targets.keys():
        return False
    (low, high), (bottom, top) = (np.array(steps[-1].targets[key]) for key in (thing, place))
    middle: Array = (low + high) / 2
    over = bool(((bottom <= middle) & (middle <= top))[[0, 2]].all())
    return over and abs(float(low[1] - top[1])) <= _RESTS


def opened(goal: Goal, steps: Sequence[StepRecord]) -> bool:
    """Tell whether one of the things is open far enough after these steps."""
    states = {key: value for step in steps for key, value in step.joints.items()}
    return any(
        abs(states.get(key, begun) - begun) >= goal.share * abs(wide - begun)
        for key, (begun, wide) in goal.ways.items()
    )


def looked(goal: Goal, steps: Sequence[StepRecord]) -> bool:
    """Tell whether a view from before an open thing showed the furniture behind it: not only doors."""
    return any(
        sum(pixels for key, pixels in steps[k].target_pixels.items() if key not in goal.ways) >= _INSIDE
        and opened(goal, steps[:k])
        and any(_in_front(thing, steps[0], steps[k]) for thing in goal.things)
        for k in range(1, len(steps))
    )


def _in_front(thing: int, first: StepRecord, step: StepRecord) -> bool:
    """Tell whether a step begins on the outer side of a front. first: a step that ends with the front shut."""
    if thing not in first.targets:
        return False
    low, high = np.array(first.targets[thing])
    axis = min((0, 2), key=lambda k: high[k] - low[k])
    middle = np.mean([box for key, box in first.targets.items() if key != thing], axis=(0, 1))
    front = (low + high)[axis] / 2
    return bool((front - middle[axis]) * (step.start[axis] - front) > 0)


def answered(goal: Goal, step: StepRecord) -> bool:
    """Tell whether a step's call says the answer of a goal: whole, in any case, with or without a full stop."""
    said = [value for value in step.call.params.values() if isinstance(value, str)] if step.call else []
    return any(text.strip().rstrip(".!").casefold() == goal.answer.casefold() for text in said)
