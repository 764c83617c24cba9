"""Values of the pipe as JSON: pictures as base64 of JPEG, decisions and feedback as in records."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import cache
from typing import Any, Final, TypeVar

from pydantic import TypeAdapter

from humanclaw import Check, Decision, EpisodeContext, EpisodeSpec, HistoryEntry, Meter, Observation, Skill
from humanclaw.records import Feedback
from humanclaw.skills import Plan
from humanclaw.storage import from_jpeg, jpeg
from humanclaw.world import CameraMount

QUALITY: Final = 88
"""JPEG quality of pictures: that of recorded frames."""
TOLD: Final = ("instruction", "target_category", "interact", "max_steps")
"""Fields of an episode that its agent is told: neither scene nor start, targets or seed."""

T = TypeVar("T")
Json = dict[str, Any]


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def to_json(value: object) -> Any:
    """Return a decision, a verdict or a feedback as JSON values."""
    kind: Any = type(value)
    return _adapter(kind).dump_python(value, mode="json")


def from_json(kind: type[T], value: object) -> T:
    """Return a decision, a verdict or a feedback. Raises pydantic.ValidationError, a ValueError."""
    of: Any = kind
    checked: T = _adapter(of).validate_python(value)
    return checked


def _text(picture: bytes) -> str:
    return base64.b64encode(picture).decode()


# -- the task ----------------------------------------------------------------------------------------------------------
def task(context: EpisodeContext) -> Json:
    """Return what an agent is told before the first step."""
    return {
        **context.spec.model_dump(include=set(TOLD)),
        "seed": context.seed,
        "skills": [_sent(skill) for skill in context.skills.values() if skill.trained],
        "limits": dict(context.meter.limits) if context.meter else {},
        "gaze": to_json(context.gaze),
    }


def _sent(skill: Skill) -> Json:
    checks = [asdict(check) for check in skill.checks]
    named = {"name": skill.name, "description": skill.description, "role": skill.role}
    return named | {"schema": dict(skill.schema), "checks": checks}


def context_of(message: Mapping[str, Any], meter: Meter) -> EpisodeContext:
    """Return the context of a task. Its skills can be asked for and checked, but not played."""
    spec = EpisodeSpec(id="episode", scene="", **{name: message[name] for name in TOLD})
    skills = {sent["name"]: _skill(sent) for sent in message["skills"]}
    return EpisodeContext(spec, skills, message["seed"], meter=meter, gaze=from_json(CameraMount, message["gaze"]))


def _skill(sent: Json) -> Skill:
    checks = tuple(Check(**check) for check in sent["checks"])
    return Skill(sent["name"], sent["description"], sent["schema"], _unplayable, checks, role=sent["role"])


def _unplayable(params: Mapping[str, Any]) -> Plan:
    raise RuntimeError("the body is in a process of its own: decide on the call, and the benchmark plays it")


# -- a step ------------------------------------------------------------------------------------------------------------
def seen(observation: Observation) -> Json:
    """Return an observation: step, pictures, and the outcome of the last step."""
    view = observation.jpeg or jpeg(observation.rgb, QUALITY)
    between = list(map(_text, observation.between))
    return {
        "step": observation.step,
        "view": _text(view),
        "between": between,
        "feedback": to_json(observation.feedback),
    }


def observation_of(message: Mapping[str, Any], instruction: str) -> Observation:
    """Return the observation of a message."""
    view, between = base64.b64decode(message["view"]), tuple(map(base64.b64decode, message["between"]))
    feedback = from_json(Feedback, message["feedback"])
    return Observation(message["step"], instruction, from_jpeg(view), feedback, view, between)


def past(entries: Sequence[HistoryEntry], shown: int) -> list[Json]:
    """Return steps of the history, with the pictures of those below `shown`: the agent's side has not seen them."""
    return [
        {
            "step": entry.step,
            "decision": to_json(entry.decision),
            "feedback": to_json(entry.feedback),
            "view": _text(jpeg(entry.rgb, QUALITY)) if entry.step < shown else "",
        }
        for entry in entries
    ]


def entry_of(message: Mapping[str, Any], views: Mapping[int, bytes]) -> HistoryEntry:
    """Return a step of the history. views: the JPEGs that were seen, by step, for messages without one."""
    step, view = message["step"], base64.b64decode(message["view"])
    decision, feedback = from_json(Decision, message["decision"]), from_json(Feedback, message["feedback"])
    return HistoryEntry(step, decision, feedback, view or views[step])
