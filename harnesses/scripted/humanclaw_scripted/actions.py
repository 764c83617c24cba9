"""Calls by measure: an agent names the measures to command, and this module finds the skill that commands them.

No scripted agent knows the name of a skill.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from humanclaw import Call, EpisodeSpec, PluginError, Skill
from humanclaw.records import ALIASES, category_of
from humanclaw.skills import Role, Side, find_suited

WALK: Final = ("hips.left", "hips.forward", "heading.left")
TURN: Final = ("heading.left",)
SIDE: Final = ("hips.left",)
BACK: Final = ("hips.back",)
UP: Final = ("hips.rise", "hips.forward")
DOWN: Final = ("hips.drop", "hips.forward")
SIT: Final = ("hips.height",)
_OVER_FLOOR: Final = ("hips.left", "hips.forward", "hips.back")
HAND: Final = ("hand.left", "hand.up", "hand.ahead")
"""Measures that the parameters of a skill command, for each kind of motion that agents ask for."""
TURN_FIRST: Final = float(np.radians(60))
"""Heading error above which an agent turns on the spot before it walks, radians. One fifth less jerk than with
28 degrees; people do not stop at every corner either."""
MAX_STEP: Final = 0.6
"""Longest step, metres in 0.5 s: an easy walk."""
AT_SEAT: Final = 0.09
"""Distance from the pelvis to the edge of a seat at which the calves touch it, metres."""
HIPS_OVER_SEAT: Final = (0.1, 0.06, 0.02)
"""Height of the pelvis over the seat at the first, second and third sit, metres. Lower sits touch the seat more
surely."""
LEVEL_THIGHS: Final = (0.54, 0.5, 0.46)
"""Greatest height of the pelvis at each sit, metres. On a high seat sloping thighs would carry the body, and the hips
would not touch it."""


def ending(skills: Mapping[str, Skill]) -> str:
    """Return the name of the skill that ends an episode. Raises PluginError if there is none."""
    stops = [name for name, skill in skills.items() if skill.role == "stop" and not skill.schema.get("required")]
    if not stops:
        raise PluginError("no installed skill ends an episode.", "Install humanclaw-skill-stop.")
    return stops[0]


def require_target(instruction: str) -> None:
    """Raise PluginError if an instruction names no target."""
    if not category_of(instruction):
        raise _nameless(instruction)


def looked_for(spec: EpisodeSpec) -> str:
    """Return what an episode's target is called. Raises PluginError if its instruction names none."""
    if spec.partner is not None:
        return "other person"
    if not spec.target_category and spec.goal is None:
        raise _nameless(spec.instruction)
    return spec.target_category.replace("_", " ") or "target"


def _nameless(instruction: str) -> PluginError:
    known = ", ".join(ALIASES).replace("_", " ")
    message = f"the agent expected an instruction with one of {known}; got {instruction!r:.80}."
    return PluginError(message, "Name one of these, give target_category, or let a model understand it: --model NAME.")


def skill_for(skills: Mapping[str, Skill], measures: Sequence[str], role: Role | None = None) -> Skill:
    """Return the skill of a role that commands these measures and the fewest others.

    role: sit for SIT, else locomotion, if none is named. Raises PluginError if there is none, or if its adapter is not
    trained.
    """
    role = role or ("sit" if measures == SIT else "locomotion")
    return find_suited(skills.values(), *measures, role=role)


def asking(
    skills: Mapping[str, Skill], measures: Sequence[str], amounts: Sequence[float], role: Role | None = None,
    side: Side | None = None,
) -> Call:  # fmt: skip
    """Return a call for these amounts of the measures, SI units, with the hand of a side if one is named."""
    return skill_for(skills, measures, role).call(dict(zip(measures, amounts, strict=True)), side or "")


def way_of(skills: Mapping[str, Skill], call: Call) -> float:
    """Return how far over the floor a call should take the body, metres."""
    asked = [
        call.params.get(parameter.key, 0)
        for parameter in skills[call.skill].parameters
        if parameter.measure in _OVER_FLOOR
    ]
    return float(np.hypot(*[*asked, 0.0, 0.0][:2])) / 100


def answering(skills: Mapping[str, Skill], words: str) -> Call:
    """Return a call that answers and so ends an episode."""
    for skill in skills.values():
        texts = [key for key, part in skill.schema.get("properties", {}).items() if part.get("type") == "string"]
        if skill.role == "stop" and texts:
            return Call(skill.name, {texts[0]: words})
    raise PluginError("this agent needs a skill that answers.", "Install the extra hands.")
