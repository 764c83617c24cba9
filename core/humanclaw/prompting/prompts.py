"""The prompts that models read. Their text is in the folder templates; the skills supply all that it says of skills.

Earlier observations, thoughts and results are data: they stand between tags, one line each, and cannot write a tag.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from typing import Any, Final

import jinja2
import numpy as np
from numpy.typing import NDArray

from humanclaw.body.pose import Motion
from humanclaw.body.skeleton import N_JOINTS, STANDING_HEIGHT
from humanclaw.plugins.agents import EpisodeContext, HistoryEntry, Observation
from humanclaw.prompting.memory import last_note, sketch
from humanclaw.prompting.settings import PromptSettings
from humanclaw.records.success import REACHED
from humanclaw.skills.call import Call
from humanclaw.skills.contract import Check, Skill, bounds, suited
from humanclaw.skills.tool_schemas import OPTIONAL_FIELDS, Json, parameter_schema, tool_list
from humanclaw.storage.pictures import data_url, jpeg
from humanclaw.text.words import LONGEST
from humanclaw.world.view import CameraMount, ego_camera

_ROWS: Final = (30, 40, 50, 60, 70, 80, 90, 100)
"""Rows of a picture, per cent of its height and not pixels, because providers scale pictures."""
_SHORT: Final = {"saw": 240, "progress": 100, "goal": 140, "reasoning": 140}
"""Characters of each field of a past step. Talkative models write about twice as much."""
_WHOLE: Final = LONGEST  # No text of a record is longer.


@dataclass(frozen=True)
class Eyes:
    """The ego camera of the standing body. Metres and degrees."""

    fov: int
    pitch: int
    height: float
    centre: float
    """Distance to the floor in the centre of the picture."""
    bottom: float
    """Distance to the floor in the middle of its lower edge."""
    rows: tuple[tuple[int, float], ...] = ()
    """Rows of the picture, per cent of its height from the top, each with the distance to the floor in it."""
    horizon: int = 0
    """The row above which there is no floor."""


@functools.cache
def eyes(gaze: CameraMount) -> Eyes:
    camera = ego_camera(Motion(np.array([[0.0, STANDING_HEIGHT, 0.0]]), np.zeros((1, N_JOINTS, 3))), gaze=gaze)
    pitch, height = float(-np.arcsin(camera.forward[1])), float(camera.position[1])
    lowest = pitch + float(np.radians(camera.fov / 2))
    centre, bottom = (round(height / float(np.tan(angle)), 1) for angle in (pitch, lowest))
    tangent = float(np.tan(np.radians(camera.fov / 2)))
    horizon = round(50 * (1 - float(np.tan(pitch)) / tangent))
    rows = tuple((row, round(_floor_at(row, pitch, height, tangent), 1)) for row in _ROWS)
    return Eyes(round(camera.fov), round(float(np.degrees(pitch))), round(height, 1), centre, bottom, rows, horizon)


def _floor_at(row: float, pitch: float, height: float, tangent: float) -> float:
    """Return metres to the floor in the middle of a row. tangent: of half the vertical field of view."""
    return height / float(np.tan(pitch + np.arctan((row / 50 - 1) * tangent)))


@dataclass(frozen=True)
class Sitting:
    """The worked example: calls of installed skills, as text, that sit the body down on a seat in front of it."""

    walk: str
    turn: str
    turns: int
    back: str
    sit: str
    stop: str


def circle(skills: Sequence[Skill]) -> tuple[str, int] | None:
    """Return the skill that turns on the spot, and how many of its largest turns make a circle.

    None without such a skill.
    """
    turn = suited(skills, "heading.left")
    if turn is None:
        return None
    largest = next(part.high for part in turn.parameters if part.measure == "heading.left")
    # 1e-9: rounding must not turn an exact division into one more turn.
    return turn.name, ceil(2 * np.pi / largest - 1e-9)


def sitting(skills: Sequence[Skill]) -> Sitting | None:
    """Return the worked example; None if a skill for it is missing."""
    walk = suited(skills, "hips.forward", "hips.left", "heading.left")
    turn, back = suited(skills, "heading.left"), suited(skills, "hips.back")
    sit, stop = suited(skills, "hips.height", role="sit"), suited(skills, role="stop")
    if not (walk and turn and back and sit and stop):
        return None
    largest = next(part.high for part in turn.parameters if part.measure == "heading.left")
    turns = ceil(np.pi / largest - 1e-9)
    return Sitting(
        str(walk.call({"hips.forward": 0.4})),
        str(turn.call({"heading.left": np.pi / turns})),
        turns,
        str(back.call({"hips.back": 0.2})),
        str(sit.call({"hips.height": 0.5})),
        str(stop.call({})),
    )


def system_prompt(
    context: EpisodeContext, skills: Sequence[Skill], settings: PromptSettings, schema: Json | None
) -> str:
    """Return the system prompt: role, goal, skills and rules. It is the same for every step of an episode.

    schema: form of the answer, for a model without tools.
    """
    return _fill(
        "system.jinja",
        spec=context.spec,
        skills=[_sheet(skill) for skill in skills],
        endings=[skill.name for skill in skills if skill.role == "stop"],
        eyes=eyes(context.gaze),
        mid_level=settings.mid_level,
        schema=_dump(schema),
        brief=settings.brief and schema is None,
        guide=settings.guide,
        optional={key: OPTIONAL_FIELDS[key]["description"] for key in settings.optional},
        reached=REACHED,
        circle=circle(skills),
        sitting=sitting(skills),
    )


def model_tools(skills: Sequence[Skill], settings: PromptSettings) -> list[Json]:
    """Return the skills as OpenAI tools behind the reasoning fields, which the system prompt explains."""
    asked: Json = {"mid_level": settings.mid_level, "brief": settings.brief, "optional": settings.optional}
    return tool_list(skills, "openai", described=False, **asked)


def system_message(words: str, settings: PromptSettings) -> Json:
    """Return the message of role system, with a cache mark if the provider needs one. The mark covers the tools too."""
    mark = {"cache_control": {"type": "ephemeral"}}
    return {"role": "system", "content": [_text(words) | mark] if settings.marks_cache else words}


def step_content(
    context: EpisodeContext,
    observation: Observation,
    history: Sequence[HistoryEntry],
    note: str,
    settings: PromptSettings,
) -> list[Json]:
    """Return the user message of a step: a part for each past step, earlier views if asked for, then the current view.

    The parts of past steps never change. So the next message begins like this one, and a provider's cache applies,
    until old steps are dropped.
    """
    first = settings.first_told(len(history))
    content = [_text(_past(history, index, settings)) for index in range(first, len(history))]
    if content and settings.marks_cache:
        content[-1]["cache_control"] = {"type": "ephemeral"}
    for past in history[-(settings.images - 1) :] if settings.images > 1 else ():
        content += [_text(f"The view before step {past.step + 1}:"), picture(past.rgb, settings.detail)]
    recent = history[first:]
    situation = {
        "step": observation.step + 1,
        "max_steps": context.spec.max_steps,
        "note": note,
        "feedback": "" if recent and recent[-1].feedback == observation.feedback else observation.feedback,
        "goal": recent[-1].decision.mid_level_goal if recent and settings.mid_level else "",
        "kept": last_note(history) if settings.memory else "",
        "places": sketch(history, context.skills) if settings.memory == "map" else (),
    }
    return [*content, _text(_fill("step.jinja", **situation)), *_view(observation, settings)]


def _view(observation: Observation, settings: PromptSettings) -> list[Json]:
    """Return the current view; nothing for a model that takes no pictures."""
    return [picture(observation.rgb, settings.detail)] if settings.images else []


def _past(history: Sequence[HistoryEntry], index: int, settings: PromptSettings) -> str:
    """Write one past step. A mid-level goal that did not change is written as `kept`."""
    past = history[index]
    goal = past.decision.mid_level_goal if settings.mid_level else ""
    kept = bool(goal) and index > 0 and history[index - 1].decision.mid_level_goal == goal
    calls = past.decision.calls
    as_called = calls == (past.feedback.replaced or past.executed,)
    called = "" if as_called else " and ".join(map(str, calls)) or "nothing usable"
    return _fill(
        "past.jinja",
        step=past.step + 1,
        decision=past.decision,
        goal="kept" if kept else goal,
        called=called,
        bounds=_SHORT if settings.history_text == "short" else dict.fromkeys(_SHORT, _WHOLE),
        feedback=past.feedback,
    )


def verifier_prompt(skills: Sequence[Skill], gaze: CameraMount, schema: Json | None) -> str:
    """Return the verifier's system prompt. It is the same for every call of a skill."""
    gists = [_gist(skill) for skill in skills]
    return _fill("verifier_system.jinja", skills=gists, eyes=eyes(gaze), schema=_dump(schema))


def verifier_content(
    observation: Observation,
    call: Call,
    skill: Skill,
    goal: str,
    checks: Iterable[tuple[str, Check]],
    settings: PromptSettings,
) -> list[Json]:
    """Return the user message of a verification: the proposed call, its checklist and the current view, no history."""
    words = {"instruction": observation.instruction, "goal": goal, "call": call, "skill": skill, "checks": list(checks)}
    return [_text(_fill("verifier_step.jinja", **words)), *_view(observation, settings)]


def picture(rgb: NDArray[np.uint8], detail: str = "") -> Json:
    """Return an image as a part of a user message: a JPEG in a data URL, in its own size.

    detail: OpenAI's parameter of that name.
    """
    return {"type": "image_url", "image_url": {"url": data_url(jpeg(rgb))} | ({"detail": detail} if detail else {})}


def _text(words: str) -> Json:
    return {"type": "text", "text": words}


def _sheet(skill: Skill) -> Json:
    """Return a skill's name, description and parameters."""
    params = [f"{key} ({_range(part)}): {part.get('description', '')}" for key, part in parameter_schema(skill).items()]
    return {"name": skill.name, "description": skill.description, "params": params}


def _gist(skill: Skill) -> Json:
    """Return a skill's signature with bounds, and the first sentence of its description."""
    params = ", ".join(f"{key} {_range(part, kind=False)}" for key, part in parameter_schema(skill).items())
    return {"signature": f"{skill.name}({params})", "gist": skill.description.split(". ")[0].rstrip(".") + "."}


def data(value: object, longest: int = 600) -> str:
    """Return untrusted text as one line of at most `longest` characters that cannot hold a tag."""
    line = " ".join(str(value).split())
    short = line if len(line) <= longest else line[:longest].rsplit(" ", 1)[0] + " ..."
    return short.replace("<", "&lt;")


def _range(part: Mapping[str, Any], kind: bool = True) -> str:
    """Return the values that a parameter takes, in words. kind: whether to name the type where there are bounds."""
    if "enum" in part:
        return "one of " + ", ".join(map(str, part["enum"]))
    name = str(part.get("type", "any value"))
    within = bounds(part)
    return name if not within else f"{name}, {within}" if kind else within


def _dump(schema: Json | None) -> str:
    return json.dumps(schema, ensure_ascii=False) if schema else ""


@functools.cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("humanclaw.prompting", "templates"),
        undefined=jinja2.StrictUndefined,
        autoescape=False,  # The output is text for a model, not a page.
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["data"] = data
    return environment


def _fill(template: str, **values: Any) -> str:
    return _environment().get_template(template).render(values).strip()
