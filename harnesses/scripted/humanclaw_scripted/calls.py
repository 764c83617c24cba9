"""Calls by measure: an agent names the measures to command, and this module finds the skill that commands them.

No scripted agent knows the name of a skill.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from humanclaw import Call, PluginError, Skill
from humanclaw.skills import Parameter, Role, from_si, suited

WALK: Final = ("hips.left", "hips.forward", "heading.left")
TURN: Final = ("heading.left",)
SIDE: Final = ("hips.left",)
BACK: Final = ("hips.back",)
UP: Final = ("hips.rise", "hips.forward")
DOWN: Final = ("hips.drop", "hips.forward")
SIT: Final = ("hips.height",)
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
    found = [name for name, skill in skills.items() if skill.role == "stop"]
    if not found:
        raise PluginError("no installed skill ends an episode.", "Install humanclaw-skill-stop.")
    return found[0]


def skill_for(skills: Mapping[str, Skill], measures: Sequence[str]) -> Skill:
    """Return the skill that commands these measures and the fewest others; of role sit for SIT, else of locomotion.

    Raises PluginError if there is none, or if its adapter is not trained.
    """
    role: Role = "sit" if measures == SIT else "locomotion"
    found = suited((skill.declaration for skill in skills.values()), *measures, role=role)
    if found is None:
        wanted = f"a skill of role {role} that commands {', '.join(measures)}"
        raise PluginError(f"the oracle needs {wanted}.", "Install the first-party skills.")
    if not skills[found.skill].trained:
        raise PluginError(
            f"the oracle needs the skill {found.skill}, whose adapter is not trained.",
            f"Train it with `humanclaw train adapter {found.skill}`.",
        )
    return skills[found.skill]


def asking(skills: Mapping[str, Skill], measures: Sequence[str], amounts: Sequence[float]) -> Call:
    """Return a call for these amounts of the measures, SI units.

    Each amount is rounded to the unit of its parameter and clipped to its bounds.
    """
    skill, asked = skill_for(skills, measures), dict(zip(measures, amounts, strict=True))
    return Call(skill.name, {one.key: _within(one, asked.get(one.measure, 0.0)) for one in skill.parameters})


def _within(parameter: Parameter, amount: float) -> int:
    low, high = (round(from_si(parameter.key, bound)) for bound in (parameter.low, parameter.high))
    return int(np.clip(round(from_si(parameter.key, amount)), low, high))
