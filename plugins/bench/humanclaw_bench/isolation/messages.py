"""Values of the protocol as JSON: pictures and tools in MCP's words, decisions and feedback as in records."""

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

PROTOCOL: Final = "1"
"""Version of the protocol. A request with another one is refused."""
QUALITY: Final = 88
"""JPEG quality of pictures: that of recorded frames."""

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


def image(picture: bytes) -> Json:
    """Return a JPEG as MCP's image content."""
    return {"type": "image", "mimeType": "image/jpeg", "data": base64.b64encode(picture).decode()}


def picture(content: Sequence[Mapping[str, Any]]) -> bytes:
    """Return the JPEG of MCP's image content. Raises ValueError for another picture."""
    if len(content) != 1 or content[0].get("mimeType") != "image/jpeg":
        raise ValueError("expected one picture of type image/jpeg")
    return base64.b64decode(content[0]["data"], validate=True)


# -- the task ----------------------------------------------------------------------------------------------------------
def task(context: EpisodeContext) -> Json:
    """Return what an agent is told before the first step: neither scene nor start, targets or seed of the episode."""
    spec, meter = context.spec, context.meter
    known = spec.model_dump(include={"instruction", "target_category", "interact", "max_steps"})
    return {
        **known,
        "seed": context.seed,
        "tools": [tool(skill) for skill in context.skills.values() if skill.trained],
        "limits": dict(meter.limits) if meter else {},
        "gaze": to_json(context.gaze),
    }


def tool(skill: Skill) -> Json:
    """Return a skill as MCP's tool, with its role and checklist."""
    more = {"role": skill.role, "checks": [asdict(check) for check in skill.checks]}
    return {"name": skill.name, "description": skill.description, "inputSchema": dict(skill.schema), "_meta": more}


def context_of(message: Mapping[str, Any], meter: Meter) -> EpisodeContext:
    """Return the context of a task. Its skills can be asked for and checked, but not played."""
    known = {name: message[name] for name in ("instruction", "target_category", "interact", "max_steps")}
    spec = EpisodeSpec(id="episode", scene="", **known)
    skills = {sent["name"]: _skill(sent) for sent in message["tools"]}
    return EpisodeContext(spec, skills, int(message["seed"]), meter=meter, gaze=from_json(CameraMount, message["gaze"]))


def _skill(sent: Mapping[str, Any]) -> Skill:
    more = sent["_meta"]
    checks = tuple(Check(**check) for check in more["checks"])
    return Skill(sent["name"], sent["description"], sent["inputSchema"], _unplayable, checks, role=more["role"])


def _unplayable(params: Mapping[str, Any]) -> Plan:
    raise RuntimeError("the body is in a process of its own: decide on the call, and the benchmark plays it")


# -- a step ------------------------------------------------------------------------------------------------------------
def seen(observation: Observation) -> Json:
    """Return an observation: step, picture, and the outcome of the last step as values and in words."""
    feedback, view = observation.feedback, observation.jpeg or jpeg(observation.rgb, QUALITY)
    message = {"step": observation.step, "content": [image(view)], "feedback": to_json(feedback), "text": str(feedback)}
    return message | ({"between": list(map(image, observation.between))} if observation.between else {})


def observation_of(message: Mapping[str, Any], instruction: str) -> Observation:
    """Return the observation of a message."""
    view = picture(message["content"])
    feedback = from_json(Feedback, message.get("feedback", {}))
    between = tuple(picture([content]) for content in message.get("between", ()))
    return Observation(int(message["step"]), instruction, from_jpeg(view), feedback, view, between)


def past(entries: Sequence[HistoryEntry], shown: int) -> list[Json]:
    """Return steps of the history, with the pictures of those below `shown`: the agent's side has not seen them."""
    return [
        {
            "step": entry.step,
            "decision": to_json(entry.decision),
            "feedback": to_json(entry.feedback),
            **({"content": [image(jpeg(entry.rgb, QUALITY))]} if entry.step < shown else {}),
        }
        for entry in entries
    ]


def entry_of(message: Mapping[str, Any], views: Mapping[int, bytes]) -> HistoryEntry:
    """Return a step of the history. views: the JPEGs that were seen, by step, for messages without one."""
    step = int(message["step"])
    if "content" not in message and step not in views:
        raise ValueError(f"step {step} has no picture, and none was seen")
    view = picture(message["content"]) if "content" in message else views[step]
    return HistoryEntry(step, from_json(Decision, message["decision"]), from_json(Feedback, message["feedback"]), view)
