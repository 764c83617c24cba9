"""Checks of a replay: recorded steps lead to the same decisions, the same places and the same end."""

from __future__ import annotations

from collections.abc import Sequence

from humanclaw.episodes.step import vec3, yaw
from humanclaw.errors import ReplayError
from humanclaw.records.decisions import Decision
from humanclaw.records.specification import EpisodeSpec
from humanclaw.records.steps import StepRecord
from humanclaw.world.simulator import WorldState


def check_end(steps: Sequence[StepRecord], spec: EpisodeSpec) -> None:
    """Raise ReplayError for steps after an active stop, or after the last step that an episode may have."""
    ends = [index for index, step in enumerate(steps, 1) if step.status == "stopped" or index == spec.max_steps]
    if ends and ends[0] < len(steps):
        told = f"the record of episode {spec.id} has {len(steps)} steps, and the episode ends with step {ends[0] - 1}."
        raise ReplayError(told, "Remove its folder, or restore the specification that it was begun with.")


def check_place(step: StepRecord, after: WorldState, spec: EpisodeSpec) -> None:
    """Raise ReplayError if a step leaves the body elsewhere than its record says."""
    if (vec3(after.body.root[-1]), yaw(after)) != (step.end, step.yaw_end):
        raise ReplayError(
            f"step {step.step} of episode {spec.id} ended at {step.end}, and now ends at {vec3(after.body.root[-1])}.",
            "Continue it on the machine and with the versions that it was begun with, or remove its folder.",
        )


def check_decision(found: Decision, recorded: Decision, agent: str, step: StepRecord, spec: EpisodeSpec) -> None:
    """Raise ReplayError if a privileged agent now decides otherwise than its record says.

    Only scripts that know the true state decide again; models are never asked twice.
    """
    if found != recorded:
        raise ReplayError(
            f"{agent} now decides otherwise in step {step.step} of episode {spec.id}.",
            "Continue it with the versions that it was begun with, or remove its folder.",
        )
