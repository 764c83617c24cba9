"""Content for clients: tools, results, resources (state, view, log) and the prompt."""

from __future__ import annotations

import base64
import functools
import json
from collections.abc import Iterable, Sequence
from typing import Any, Final

import jinja2
import numpy as np
from mcp_types import (
    BlobResourceContents,
    CallToolResult,
    ImageContent,
    LoggingLevel,
    Prompt,
    PromptArgument,
    Resource,
    TextContent,
    TextResourceContents,
    Tool,
    ToolAnnotations,
)
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from humanclaw import Skill, StepRecord
from humanclaw.body import JOINTS, Pose2D
from humanclaw.records import ALIASES, FLOOR_THRESHOLD, SEATS
from humanclaw.skills import bounds, parameter_schema, tool_list
from humanclaw.storage import jpeg
from humanclaw_mcp.session import Settings, Snapshot

Json = dict[str, Any]
LOOK: Final = "look"
RESET: Final = "reset"
STATE: Final = "humanclaw://body/state"
VIEW: Final = "humanclaw://body/view"
LOG: Final = "humanclaw://episode/log"
BODY_RESOURCES: Final = (STATE, VIEW, LOG)
"""Resources that a step changes."""
INSTRUCTIONS: Final = tuple(
    f"Find a {ALIASES[category][0]}" + (" and sit on it." if category in SEATS else ".") for category in ALIASES
)
"""Completions for an instruction: the benchmark's tasks."""


# -- tools -------------------------------------------------------------------------------------------------------------
class Outcome(BaseModel):
    """The structured part of every tool result."""

    model_config = ConfigDict(frozen=True)

    executed: bool
    """Whether the body carried out a skill."""
    skill: str
    parameters: dict[str, Any]
    feedback: str
    step: int
    max_steps: int
    outcome: str
    """running, stopped, out_of_steps or interrupted."""


def tools(skills: Iterable[Skill], settings: Settings) -> list[Tool]:
    """List every trained skill, then `look` and, in a house of one's own, `reset`; the contract reserves both names."""
    ready = [skill for skill in skills if skill.trained]
    schema = Outcome.model_json_schema()
    acting = ToolAnnotations(read_only_hint=False, destructive_hint=False, idempotent_hint=False, open_world_hint=False)
    specs = tool_list(ready, "mcp", reasoning=settings.reasoning)
    moving = [
        Tool(**_snake(spec), output_schema=schema, annotations=acting, title=_title(spec["name"])) for spec in specs
    ]
    return [*moving, _look(schema), *([] if settings.company else [_reset(schema, settings, acting)])]


def _look(output: Json) -> Tool:
    return Tool(
        name=LOOK,
        title="Look",
        description="See what the body sees, without moving. Takes no step.",
        input_schema={"type": "object", "properties": {}, "additionalProperties": False},
        output_schema=output,
        annotations=ToolAnnotations(read_only_hint=True, open_world_hint=False),
    )


def _reset(output: Json, settings: Settings, acting: ToolAnnotations) -> Tool:
    return Tool(
        name=RESET,
        title="Reset",
        description="Begin a new episode: the body stands at its start again and everything else is where it was. "
        "What is left out stays as it was.",
        input_schema=reset_schema(settings),
        output_schema=output,
        annotations=acting,
    )


def reset_schema(settings: Settings) -> Json:
    return {
        "type": "object",
        "properties": {
            "instruction": {
                "type": "string",
                "minLength": 1,
                "maxLength": 500,
                "description": "What the body is to do, such as: find a couch and sit on it. Recorded with the "
                "episode.",
            },
            "scene": {"type": "string", "enum": list(settings.scenes), "description": "Where to be."},
            "seed": {
                "type": "integer",
                "minimum": 0,
                "maximum": 2**31 - 1,
                "description": "The same seed and the same calls give the same motion.",
            },
        },
        "additionalProperties": False,
    }


def _snake(spec: Json) -> Json:
    return {"name": spec["name"], "description": spec["description"], "input_schema": spec["inputSchema"]}


def _title(name: str) -> str:
    return name.replace("_", " ").replace("-", " ").capitalize()


# -- results -----------------------------------------------------------------------------------------------------------
def result(snapshot: Snapshot, executed: bool = True) -> CallToolResult:
    """Return text, the view, and structured values. A refused call has no view: nothing has changed.

    executed: whether the command was a skill call; `look` and `reset` are not.
    """
    _, words = note(snapshot)
    seen = " The picture is what you see now." if snapshot.outcome == "running" and not snapshot.refused else ""
    content: list[Any] = [TextContent(text=words + seen)]
    if not snapshot.refused:
        content.append(ImageContent(data=base64_jpeg(snapshot.rgb), mime_type="image/jpeg"))
    values = _outcome(snapshot, executed and not snapshot.refused).model_dump(mode="json")
    return CallToolResult(content=content, structured_content=values, is_error=snapshot.refused)


def failure(text: str) -> CallToolResult:
    """Return the result of a call that reached no body."""
    return CallToolResult(content=[TextContent(text=text)], is_error=True)


def note(snapshot: Snapshot) -> tuple[LoggingLevel, str]:
    """Return severity and text of the log message for a snapshot."""
    words = f"{snapshot.feedback} Step {len(snapshot.steps)} of {snapshot.max_steps}.".strip()
    if snapshot.refused:
        return "warning", words
    if snapshot.outcome != "running":
        return "notice", f"{words} The episode has ended: {snapshot.outcome.replace('_', ' ')}."
    return ("info" if snapshot.feedback else "debug"), words


def _outcome(snapshot: Snapshot, executed: bool) -> Outcome:
    call = snapshot.steps[-1].call if snapshot.steps and executed else None
    return Outcome(
        executed=executed,
        skill=call.skill if call else "",
        parameters=dict(call.params) if call else {},
        feedback=snapshot.feedback,
        step=len(snapshot.steps),
        max_steps=snapshot.max_steps,
        outcome=snapshot.outcome,
    )


def base64_jpeg(rgb: NDArray[np.uint8]) -> str:
    """Return a picture as base64 of a JPEG."""
    return base64.b64encode(jpeg(rgb)).decode()


# -- resources ---------------------------------------------------------------------------------------------------------
def resources() -> list[Resource]:
    state = Resource(
        uri=STATE,
        name="body-state",
        title="The body",
        description="Joints, way made, turn, touch: what the body knows of itself, and nothing of the scene.",
        mime_type="application/json",
    )
    view = Resource(
        uri=VIEW, name="body-view", title="The view", description="What the eyes see now.", mime_type="image/jpeg"
    )
    log = Resource(
        uri=LOG,
        name="episode-log",
        title="The episode so far",
        description="One JSON object a line for each step: what was called, and what became of it.",
        mime_type="application/jsonl",
    )
    return [state, view, log]


def view(snapshot: Snapshot) -> BlobResourceContents:
    return BlobResourceContents(uri=VIEW, mime_type="image/jpeg", blob=base64_jpeg(snapshot.rgb))


def state(snapshot: Snapshot) -> TextResourceContents:
    text = body_state(snapshot).model_dump_json(indent=1)
    return TextResourceContents(uri=STATE, mime_type="application/json", text=text)


def log(steps: Sequence[StepRecord]) -> TextResourceContents:
    """Return the episode so far, a JSON object a line for each step: reasoning, call and result.

    The log holds nothing that only the scene knows.
    """
    text = "".join(json.dumps(_entry(step), ensure_ascii=False) + "\n" for step in steps)
    return TextResourceContents(uri=LOG, mime_type="application/jsonl", text=text)


class BodyState(BaseModel):
    """A body's own state, and nothing of the scene. Metres and degrees; a left turn is positive."""

    model_config = ConfigDict(frozen=True)

    step: int
    max_steps: int
    outcome: str
    forward: float
    """Displacement since the episode began, along the heading of the start; `left` is to the left of it."""
    left: float
    heading: float
    """Turn since the episode began."""
    pelvis_height: float
    """Height over the floor of the start."""
    joints: dict[str, tuple[float, float, float]]
    """Each joint in the body's frame on that floor: left, up, forward."""
    touching: tuple[str, ...]
    """Links that touched anything except the floor in the last step."""
    seated: bool
    """Whether the pelvis touched something in the last step."""


def body_state(snapshot: Snapshot) -> BodyState:
    start, body = snapshot.start, snapshot.world.body[-1:]
    began = Pose2D(start.x, start.z, start.yaw, start.floor)
    left, height, forward = began.point_to_local(body.root[-1])
    local = Pose2D.of(body, floor=start.floor).point_to_local(body.joints()[-1])
    turned = (np.degrees(float(body.yaw()[-1]) - start.yaw) + 180.0) % 360.0 - 180.0
    last = snapshot.steps[-1] if snapshot.steps else None
    return BodyState(
        step=len(snapshot.steps),
        max_steps=snapshot.max_steps,
        outcome=snapshot.outcome,
        forward=round(float(forward), 3),
        left=round(float(left), 3),
        heading=round(float(turned), 1),
        pelvis_height=round(float(height), 3),
        joints={name: _point(place) for name, place in zip(JOINTS, local, strict=True)},
        touching=_touching(last, start.floor) if last else (),
        seated=bool(last and last.pelvis_contacts),
    )


def _point(place: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = (round(float(value), 3) for value in place)
    return x, y, z


def _touching(step: StepRecord, floor: float) -> tuple[str, ...]:
    meeting = {c.joint for c in step.contacts if c.movable or c.height - floor > FLOOR_THRESHOLD}
    return tuple(name for name in JOINTS if name in meeting)


def _entry(step: StepRecord) -> Json:
    last = step.decision
    said = {key: getattr(last, key) for key in ("visible_state", "progress", "mid_level_goal", "reasoning")}
    return {
        "step": step.step + 1,
        "status": step.status,
        "skill": step.call.skill if step.call else "",
        "parameters": step.call.params if step.call else {},
        "feedback": str(step.feedback),
        "refused": [attempt.error for attempt in step.attempts if attempt.error],
        **{key: text for key, text in said.items() if text},
        "seconds": round(step.seconds.get("generate", 0.0) + step.seconds.get("simulate", 0.0), 3),
    }


# -- the prompt --------------------------------------------------------------------------------------------------------
def task_prompt(name: str) -> Prompt:
    argument = PromptArgument(name="instruction", description="What the body is to do.", required=False)
    return Prompt(
        name=name,
        title="Have a body",
        description="Explains the body, its skills and their rules, and gives it something to do.",
        arguments=[argument],
    )


def task(instruction: str, skills: Iterable[Skill], settings: Settings) -> str:
    """Return the prompt: the body, the instruction, the skills and their rules."""
    ready = [skill for skill in skills if skill.trained]
    return _template().render(
        instruction=instruction,
        skills=[_sheet(skill) for skill in ready],
        endings=[skill.name for skill in ready if skill.role == "stop"],
        max_steps=settings.max_steps,
        reasoning=settings.reasoning,
        resets=not settings.company,
    )


def _sheet(skill: Skill) -> Json:
    bounds = [f"{key} {_bounds(part)}" for key, part in parameter_schema(skill).items()]
    return {"name": skill.name, "description": skill.description, "bounds": bounds, "checks": skill.checks}


def _bounds(part: Json) -> str:
    return bounds(part) or " or ".join(map(str, part.get("enum", ()))) or str(part.get("type"))


@functools.cache
def _template() -> jinja2.Template:
    loader = jinja2.PackageLoader("humanclaw_mcp", "templates")
    # The output is text for a model, not a page.
    environment = jinja2.Environment(
        loader=loader, undefined=jinja2.StrictUndefined, autoescape=False, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template("task.jinja")
