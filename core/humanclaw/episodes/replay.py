"""Checks of a replay: recorded steps can be played again, and lead to the same places and the same end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from humanclaw.episodes.step import vec3, yaw
from humanclaw.errors import ReplayError
from humanclaw.records.specification import EpisodeSpec
from humanclaw.records.steps import StepRecord
from humanclaw.world.simulator import WorldState


def check_end(steps: Sequence[StepRecord], spec: EpisodeSpec) -> None:
    """Raise ReplayError for steps after an active stop, or after the last step that an episode may have."""
    ends = [index for index, step in enumerate(steps, 1) if step.status == "stopped" or index == spec.max_steps]
    if ends and ends[0] < len(steps):
        fault = f"the record of episode {spec.id} has {len(steps)} steps, and the episode ends with step {ends[0] - 1}."
        raise ReplayError(fault, "Remove its folder, or restore the specification that it was begun with.")


def check_memory(steps: Sequence[StepRecord], privileged: Mapping[str, bool], spec: EpisodeSpec) -> None:
    """Raise ReplayError for steps of an agent or a verifier that knows the true state.

    It is a script with a memory of its own, which no record holds. To play its episode again costs nothing.
    """
    known = [role for role, knows in privileged.items() if knows]
    if steps and known:
        fault = f"the {known[0]} of episode {spec.id} knows the true state, and has a memory beside the record."
        raise ReplayError(fault, "Begin the episode anew.")


def check_place(step: StepRecord, after: WorldState, spec: EpisodeSpec) -> None:
    """Raise ReplayError if a step leaves the body elsewhere than its record says."""
    if (vec3(after.body.root[-1]), yaw(after)) != (step.end, step.yaw_end):
        raise ReplayError(
            f"step {step.step} of episode {spec.id} ended at {step.end}, and now ends at {vec3(after.body.root[-1])}.",
            "Continue it on the machine and with the versions that it was begun with, or remove its folder.",
        )
