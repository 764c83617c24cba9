"""Whether the goal of hands is met, from the steps of a record: a thing lies where it should, is open, is answered."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from humanclaw.body.pose import Array
from humanclaw.records.specification import Goal
from humanclaw.records.steps import StepRecord

_INSIDE: Final = 0.01 * 512**2
"""Pixels of the inside of furniture, from which it counts as looked into: a hundredth of the view."""
_RESTS: Final = 0.05
"""Metres between a thing and the top of what it lies on, at most."""


def is_met(goal: Goal, steps: Sequence[StepRecord]) -> bool:
    """Tell whether an active stop ended the steps with the goal met."""
    if not steps or steps[-1].status != "stopped":
        return False
    if goal.answer:
        return looked(goal, steps) and answered(goal, steps[-1])
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
    axis = min((0, 2), key=lambda one: high[one] - low[one])
    middle = np.mean([box for key, box in first.targets.items() if key != thing], axis=(0, 1))
    front = (low + high)[axis] / 2
    return bool((front - middle[axis]) * (step.start[axis] - front) > 0)


def answered(goal: Goal, step: StepRecord) -> bool:
    """Tell whether a step's call says the answer of a goal: whole, in any case, with or without a full stop."""
    said = [value for value in step.call.params.values() if isinstance(value, str)] if step.call else []
    return any(text.strip().rstrip(".!").casefold() == goal.answer.casefold() for text in said)
