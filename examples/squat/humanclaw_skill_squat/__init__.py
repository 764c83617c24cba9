"""HumanCLAW skill: squatting, and rising again."""

from pathlib import Path

from humanclaw import hookimpl
from humanclaw.hookspecs import RegisterRecipe, RegisterSkill

__version__ = "0.1.0"


@hookimpl
def humanclaw_skills(register: RegisterSkill) -> None:
    register(Path(__file__).parent / "squat")


@hookimpl
def humanclaw_recipes(register: RegisterRecipe) -> None:
    from humanclaw_skill_squat.squat.recipe import RECIPE

    register(RECIPE)
