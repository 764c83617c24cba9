"""Facts about an episode from its record, in words: milestones, outcome, verdicts and contacts."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

import numpy as np

from humanclaw import RecordedEpisode, Scene, StepRecord
from humanclaw.cli import counted
from humanclaw.records import RECORD_BYTES, end_distance, in_view, on_target, reached, touched_above_ground
from humanclaw.storage import Folder
from humanclaw.world import Contact


@dataclass(frozen=True)
class Facts:
    """Facts that a benchmark adds about an episode."""

    success: bool | None = None
    cause: str = ""
    tier: str = ""
    step: int | None = None
    """Step at which the cause was decided."""


@dataclass(frozen=True)
class Milestone:
    """A milestone (in view, reached, sat, solved or stopped), whether it was met, and one fact about it."""

    name: str
    met: bool
    detail: str = ""


def episodes_asked(run: Path) -> int:
    """Return how many episodes a run was started with; 0 if its folder does not say."""
    try:
        return int(json.loads(Folder(run).read("run.json", RECORD_BYTES))["episodes"])
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        return 0


def milestones(recorded: RecordedEpisode, success: bool | None = None) -> tuple[Milestone, ...]:
    """Return the milestones of an episode.

    They follow from geometry and the active stop alone; metrics also ask what the agent acknowledged. A task of
    one's own, or with a partner, has the one that a benchmark told: its success, if that is known.
    """
    spec, steps = recorded.record.spec, recorded.steps
    stopped = Milestone("stopped", recorded.record.outcome == "stopped", f"after {counted(len(steps), 'step')}")
    if task := spec.success or (spec.partner.task if spec.partner else ""):
        return (stopped,) if success is None else (Milestone("solved", success, task.replace("_", " ")), stopped)
    if not spec.target_ids:
        return (stopped,)
    seen = next((s for s in steps if in_view(s)), None)
    last = end_distance(recorded)
    in_view_at = Milestone("in view", bool(seen), _first_seen(seen) if seen else "never")
    near = Milestone(
        "reached", reached(recorded), f"{last:.2f} m at the end" if np.isfinite(last) else "no distance recorded"
    )
    if not spec.interact:
        return in_view_at, near, stopped
    return in_view_at, near, _sat(recorded), stopped


def _first_seen(step: StepRecord) -> str:
    """Say when a target came into view, and how much of it: few pixels may be more than an agent notices."""
    return f"first at step {step.step}, {sum(step.target_pixels.values())} px"


def _sat(recorded: RecordedEpisode) -> Milestone:
    """Return whether the hips were on a target when the episode ended."""
    if sat := list(takewhile(lambda step: on_target(recorded, step), reversed(recorded.steps))):
        return Milestone("sat", True, f"since step {sat[-1].step}")
    on = [step.step for step in recorded.steps if on_target(recorded, step)]
    return Milestone("sat", False, f"left the seat after step {on[-1]}" if on else "hips never on the target")


def in_words(recorded: RecordedEpisode, met: Sequence[Milestone]) -> str:
    """Return the outcome as a sentence."""
    record, facts = recorded.record, {stage.name: stage for stage in met}
    took = "ran out of" if record.spec.target_ids else "took"
    endings = {
        "running": "has not ended",
        "stopped": f"stopped of its own accord after {counted(len(recorded.steps), 'step')}",
        "out_of_steps": f"{took} its {counted(record.spec.max_steps, 'step')}",
        "plugin_error": f"was broken off by a fault in a plugin ({record.error})",
        "infra_error": f"was broken off by a provider failure ({record.error})",
        "limit_reached": f"was ended by a limit ({record.error})",
        "interrupted": f"was interrupted after {counted(len(recorded.steps), 'step')}",
    }
    noun = record.spec.target_category.replace("_", " ") or "target"
    parts = [f"{'had' if facts[name].met else 'never had'} the {noun} in view" for name in facts if name == "in view"]
    parts += [
        f"{'ended' if facts[name].met else 'did not end'} within reach of it" for name in facts if name == "reached"
    ]
    parts += [f"{'sat' if facts[name].met else 'did not sit'} on it" for name in facts if name == "sat"]
    parts += [f"{'solved' if facts[name].met else 'did not solve'} its task" for name in facts if name == "solved"]
    parts.append(endings[record.outcome])
    return "The body " + (", ".join(parts[:-1]) + " and " if parts[:-1] else "") + parts[-1] + "."


def verdict_of(step: StepRecord) -> tuple[str, str]:
    """Return the kind of verdict (none, accepted, replaced or open) and a text."""
    verdict, calls = step.verdict, step.decision.calls
    proposed = calls[0] if calls else None
    if verdict is None:
        return "none", ""
    if verdict.failed_open:
        return "open", f"let through unverified: {verdict.failed_open}"
    if verdict.accepted or verdict.replacement is None:
        return "accepted", "accepted"
    failed = "; ".join(answer.note or answer.check for answer in verdict.failed)
    asked = f"in the place of {proposed}" if proposed else "by the verifier"
    return "replaced", asked + (f": {failed}" if failed else "")


def touches(recorded: RecordedEpisode, step: StepRecord, names: Mapping[int, str]) -> str:
    """Return which parts of the body a step lays on which objects: "pelvis and right knee on couch 3; ..."."""
    parts: dict[int, dict[str, None]] = {}
    for contact in shown_contacts(recorded, step):
        parts.setdefault(contact.object_id, {})[contact.joint.replace("_", " ")] = None
    return "; ".join(f"{listed(list(body_parts))} on {name_of(names, key)}" for key, body_parts in parts.items())


def shown_contacts(recorded: RecordedEpisode, step: StepRecord) -> tuple[Contact, ...]:
    """Return the contacts of a step that a page shows: with objects above the ground, and with other people."""
    return (*touched_above_ground(recorded, step), *(contact for contact in step.contacts if contact.person))


def listed(words: Sequence[str], last: str = "and") -> str:
    """Return words as in a sentence: "chair, couch and bed"."""
    return f" {last} ".join(filter(None, (", ".join(words[:-1]), *words[-1:])))


def named(scene: Scene) -> dict[int, str]:
    """Return object id to name."""
    return {obj.id: f"{obj.category.replace('_', ' ')} {obj.id}" for obj in scene.objects}


def name_of(names: Mapping[int, str], key: int) -> str:
    """Return the name of an object, or of another body; a number if the scene is not known."""
    return names.get(key, f"object {key}" if key > 0 else "another person")
