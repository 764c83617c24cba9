"""The rewards that come with the core. docs/gym.md says what each can be gamed by; tests try it.

A reward is a function of an episode up to its last step (humanclaw.records.Transition) and rewards that step.
"""

from __future__ import annotations

from collections.abc import Sequence

from humanclaw.records.acknowledgement import acknowledges
from humanclaw.records.steps import StepRecord
from humanclaw.records.success import REACHED, in_view, touched_above_ground
from humanclaw.records.transition import Transition


def success(transition: Transition) -> float:
    """Return 1 for a stop within reach of a target, seated on it if the task says so."""
    return float(transition.success)


def progress(transition: Transition) -> float:
    """Return by how many metres the step shortened the way to the nearest target.

    The sum over an episode is the way at its start less the way at its end, so walking to and fro earns nothing.
    """
    return _left(transition, transition.steps[:-1]) - _left(transition, transition.steps)


def _left(transition: Transition, steps: Sequence[StepRecord]) -> float:
    """Return the last known way after some steps, metres: 0 within reach, from where no path may start."""
    for step in reversed(steps):
        if step.target_distance is not None and step.target_distance <= REACHED:
            return 0.0
        if step.geodesic is not None:
            return step.geodesic
    return transition.record.geodesic or 0.0


def honest(transition: Transition) -> float:
    """Return -1 if the words claim a target that is not in view, and 1 for the first true claim of the episode."""
    if not transition.claims(transition.step):
        return 0.0
    if not in_view(transition.step):
        return -1.0
    return float(not any(transition.claims(step) and in_view(step) for step in transition.steps[:-1]))


def seen(transition: Transition) -> float:
    """Return 1 for a stop with a target in view and words that say so."""
    return float(transition.stopped and in_view(transition.step) and transition.claims(transition.step))


def touch(transition: Transition) -> float:
    """Return 1 for a stop whose reasoning names an object that the body touched in the step before it, and none that
    it did not touch."""
    if not transition.stopped or len(transition.steps) < 2:
        return 0.0
    said, contacts = transition.step.decision.reasoning, touched_above_ground(transition, transition.steps[-2])
    touched = {transition.scene.by_id[contact.object_id].category for contact in contacts}
    named = {item.category for item in transition.scene.objects if acknowledges(said, item.category)}
    return float(bool(named) and named <= touched)


def contact(transition: Transition) -> float:
    """Return -1 if the body touched anything but the target above the ground."""
    targets = set(transition.record.spec.target_ids)
    contacts = touched_above_ground(transition, transition.step)
    return -float(any(contact.object_id not in targets for contact in contacts))


def verifier(transition: Transition) -> float:
    """Return -1 if the verifier replaced the call; 0 without a verifier, and where it gave no verdict."""
    verdict = transition.step.verdict
    return -float(verdict is not None and not verdict.accepted)
