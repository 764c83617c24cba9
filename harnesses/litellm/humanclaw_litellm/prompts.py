"""What a model is told and shown. The words are in the folder templates; all that they say of skills comes from the skills."""

from __future__ import annotations

import base64
import functools
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import jinja2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from humanclaw.body import N_JOINTS, STANDING_HEIGHT
from humanclaw.contract import Check, Skill
from humanclaw.interfaces import Call, EpisodeContext, Observation, Past, ego_camera
from humanclaw.pose import Motion
from humanclaw.tools import parameter_schema
from humanclaw_litellm.settings import Settings

Json = dict[str, Any]


@dataclass(frozen=True)
class Eyes:
    """The ego camera of the standing body. Metres, degrees."""

    fov: int
    pitch: int
    height: float
    centre: float
    """How far away the floor is that the centre of the picture shows."""
    bottom: float
    """The same for the middle of its lower edge."""


@functools.cache
def eyes() -> Eyes:
    camera = ego_camera(Motion(np.array([[0.0, STANDING_HEIGHT, 0.0]]), np.zeros((1, N_JOINTS, 3))))
    pitch, height = float(-np.arcsin(camera.forward[1])), float(camera.position[1])
    lowest = pitch + float(np.radians(camera.fov / 2))
    reach = [round(height / float(np.tan(angle)), 1) for angle in (pitch, lowest)]
    return Eyes(round(camera.fov), round(float(np.degrees(pitch))), round(height, 1), *reach)


def system_prompt(context: EpisodeContext, skills: Sequence[Skill], settings: Settings, schema: Json | None) -> str:
    """Who the model is, its goal, its skills and their rules: the same for every step of an episode.

    schema: what the answer must look like, for a model that is not given tools.
    """
    return _fill(
        "system.jinja",
        spec=context.spec,
        skills=[_sheet(skill) for skill in skills],
        endings=[skill.name for skill in skills if skill.ends_episode],
        eyes=eyes(),
        mid_level=settings.mid_level,
        schema=_dump(schema),
    )


def step_content(
    context: EpisodeContext, observation: Observation, history: Sequence[Past], note: str, settings: Settings
) -> list[Json]:
    """The user message of a step: history in words, earlier views if asked for, then the current view."""
    told = history[-settings.history :] if settings.history else ()
    shown = history[-(settings.images - 1) :] if settings.images > 1 else ()
    situation = {"step": observation.step + 1, "max_steps": context.spec.max_steps, "note": note}
    words = {"past": told, "omitted": len(history) - len(told), "mid_level": settings.mid_level}
    content = [_text(_fill("history.jinja", **words))]
    for past in shown:
        content += [_text(f"The view before step {past.step + 1}:"), picture(past.rgb)]
    feedback = "" if told and told[-1].feedback == observation.feedback else observation.feedback
    return [*content, _text(_fill("step.jinja", feedback=feedback, **situation)), picture(observation.rgb)]


def verifier_prompt(skills: Sequence[Skill], schema: Json | None) -> str:
    """The verifier's part: the same for every call of a skill."""
    return _fill("verifier_system.jinja", skills=[_sheet(skill) for skill in skills], eyes=eyes(), schema=_dump(schema))


def verifier_content(
    observation: Observation, call: Call, skill: Skill, goal: str, checks: Iterable[tuple[str, Check]]
) -> list[Json]:
    """The user message of a verification: the proposed call, its checklist and the current view, and nothing of the past."""
    words = {"instruction": observation.instruction, "goal": goal, "call": call, "skill": skill, "checks": list(checks)}
    return [_text(_fill("verifier_step.jinja", **words)), picture(observation.rgb)]


def picture(rgb: NDArray[np.uint8]) -> Json:
    """An image as a part of a user message: a JPEG in a data URL, of the size that it has."""
    buffer = io.BytesIO()
    Image.fromarray(rgb).save(buffer, "JPEG", quality=90)
    url = f"data:image/jpeg;base64,{base64.b64encode(buffer.getvalue()).decode()}"
    return {"type": "image_url", "image_url": {"url": url}}


def _text(words: str) -> Json:
    return {"type": "text", "text": words}


def _sheet(skill: Skill) -> Json:
    """What there is to know of a skill before calling it."""
    params = [f"{key} ({_range(part)}): {part.get('description', '')}" for key, part in parameter_schema(skill).items()]
    questions = [check.question for check in skill.checks]
    return {"name": skill.name, "description": skill.description, "params": params, "questions": questions}


def _range(part: Mapping[str, Any]) -> str:
    if "enum" in part:
        return "one of " + ", ".join(map(str, part["enum"]))
    kind = str(part.get("type", "any value"))
    return f"{kind}, {part['minimum']} to {part['maximum']}" if "minimum" in part and "maximum" in part else kind


def _dump(schema: Json | None) -> str:
    return json.dumps(schema, ensure_ascii=False) if schema else ""


@functools.cache
def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.PackageLoader("humanclaw_litellm", "templates"),
        undefined=jinja2.StrictUndefined,
        autoescape=False,  # The output is text for a model, not a page.
        trim_blocks=True,
        lstrip_blocks=True,
    )


def _fill(template: str, **values: Any) -> str:
    return _environment().get_template(template).render(values).strip()
