"""Trained skills, and commands to many bodies at once, for synthesis.

A command's effect on the pelvis follows from the measures of the skill's parameters. No skill is known by name. Needs
only numpy.
"""

from __future__ import annotations

import math
import runpy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import HumanclawError
from humanclaw.body import Array
from humanclaw.skills import MEASURES, Feet, GaitParameters, Measure, Recipe, Skill, WindowTravel

if TYPE_CHECKING:
    from humanclaw import Plugins

Ints = NDArray[np.int_]
Mask = NDArray[np.bool_]

AXES: Final[Mapping[str, tuple[str, float]]] = {
    "hips.left": ("x", 1.0),
    "hips.forward": ("z", 1.0),
    "hips.back": ("z", -1.0),
    "heading.left": ("yaw", 1.0),
    "hips.rise": ("rise", 1.0),
    "hips.drop": ("rise", -1.0),
    "hips.height": ("height", 1.0),
}
"""Measure to the field of Commands that it sets, and the sign."""


@dataclass(frozen=True)
class Trained:
    """A skill to train: its declaration and its recipe. Raises HumanclawError for a recipe that is never drawn."""

    recipe: Recipe
    declaration: Skill
    measures: Mapping[str, Measure] = field(default_factory=lambda: MEASURES, repr=False)
    """Known measures: the core's and those of plugins."""

    def __post_init__(self) -> None:
        recipe = self.recipe
        # Drawn more rarely, its chunks would hardly ever be complete; always repeated, those of no other skill.
        if self.synthetic and not (0.01 <= recipe.share < math.inf and 0 <= recipe.repeats < 1):
            raise HumanclawError(
                f"The recipe of {self.name} has share={recipe.share} and repeats={recipe.repeats}, expected a share "
                "of .01 or more and repeats from 0 to below 1.",
                "Give it one such as 1.0, or no gait if its motion is not to be synthesised.",
            )

    @classmethod
    def read(cls, folder: Path, measures: Mapping[str, Measure] = MEASURES) -> Trained:
        """Read the schema.json and recipe.py of a skill's folder. Without recipe.py, any window may show the skill.

        Raises PluginError for a broken schema.json, HumanclawError for a recipe.py without RECIPE.
        """
        declaration, path = Skill.from_folder(folder.resolve()), folder.resolve() / "recipe.py"
        if not path.is_file():
            return cls(Recipe(declaration.name, retimed=declaration.role == "posture"), declaration, measures)
        recipe = runpy.run_path(str(path)).get("RECIPE")
        if not isinstance(recipe, Recipe):
            raise HumanclawError(f"{path} has no RECIPE.", "Set it to a humanclaw.skills.Recipe.")
        return cls(recipe, declaration, measures)

    @property
    def name(self) -> str:
        return self.recipe.name

    @property
    def tag(self) -> str:
        """Tag of the spans of clips that may show the skill."""
        return self.recipe.tag or self.recipe.name

    def shown(self, windows: WindowTravel) -> Mask:
        """Return which windows of real motion show the skill (N,)."""
        rule = self.recipe.windows
        return np.asarray(rule(windows)) if rule is not None else np.zeros(len(windows.yaw), bool)

    @property
    def synthetic(self) -> bool:
        """Whether its motion can be synthesised."""
        return self.recipe.gait is not None

    def axes(self) -> dict[str, tuple[str, float]]:
        """Map each parameter to the field of Commands that it sets, and the sign.

        Raises HumanclawError for a measure that synthesis does not know.
        """
        unknown = [parameter.measure for parameter in self.declaration.parameters if parameter.measure not in AXES]
        if unknown:
            hint = f"Use one of {', '.join(AXES)}, or give {self.name} a recipe without gait and only real chunks."
            raise HumanclawError(f"Motion cannot be synthesised for the measure {', '.join(unknown)}.", hint)
        return {parameter.name: AXES[parameter.measure] for parameter in self.declaration.parameters}


def trained(plugins: Plugins) -> list[Trained]:
    """Return every installed skill whose folder has a recipe.py."""
    folders = [skill.source for skill in plugins.skills.values() if skill.source is not None]
    return [Trained.read(folder, plugins.measures) for folder in folders if (folder / "recipe.py").is_file()]


_GAIT: Final = tuple(part.name for part in fields(GaitParameters))


@dataclass(frozen=True)
class Commands:
    """One command for each of N bodies. All (N,), metres and radians.

    * x, z: travel to the left and ahead. yaw: turn to the left. NaN where the command leaves them open.
    * rise: of the floor. height: of the pelvis at the end; NaN for standing.
    * feet: index into FEET. stays_seated: whether a seated body remains seated.
    * gait: the skills' gait parameters, by name.
    """

    x: Array
    z: Array
    yaw: Array
    rise: Array
    height: Array
    feet: Ints
    stays_seated: Mask
    gait: Mapping[str, Array]

    @classmethod
    def of(cls, skills: Sequence[Trained], skill: Ints, values: Array) -> Commands:
        """Turn calls into commands. skill (N,): index into skills, which have a gait. values (N, k): of its parameters.

        Raises HumanclawError for a measure that synthesis does not know.
        """
        numbers = {key: np.full(len(skill), np.nan) for key in ("x", "z", "yaw", "height")}
        numbers["rise"] = np.zeros(len(skill))
        for index, trained in enumerate(skills):
            rows = skill == index
            for column, (key, sign) in enumerate(trained.axes().values()):
                numbers[key][rows] = sign * values[rows, column]
        recipes = [skills[index].recipe for index in skill]
        return cls(
            **numbers,
            feet=np.array([FEET.index(recipe.feet) for recipe in recipes], int),
            stays_seated=np.array([recipe.stays_seated for recipe in recipes], bool),
            gait={name: np.array([getattr(recipe.gait, name) for recipe in recipes], float) for name in _GAIT},
        )

    @classmethod
    def standing(cls, count: int) -> Commands:
        """Return commands that ask nothing of `count` bodies."""
        nan, zero = np.full(count, np.nan), np.zeros(count)
        gait = {name: np.full(count, getattr(GaitParameters(), name)) for name in _GAIT}
        return cls(nan, nan, nan, zero, nan, np.full(count, FEET.index("settle")), np.ones(count, bool), gait)

    def does(self, feet: Feet) -> Mask:
        """Return which skills move the feet in this way (N,)."""
        return np.asarray(self.feet == FEET.index(feet))

    @property
    def stairs(self) -> Mask:
        return np.asarray(self.rise != 0)

    @property
    def sits(self) -> Mask:
        """Whether the command sets a height of the pelvis (N,)."""
        return np.isfinite(self.height)


FEET: Final[tuple[Feet, ...]] = ("stride", "shuffle", "settle")
