"""HumanCLAW skill: stepping sideways."""

from pathlib import Path

from humanclaw import hookimpl
from humanclaw.plugins import RegisterRecipe, RegisterSkill

__version__ = "0.1.0"


@hookimpl
def humanclaw_skills(register: RegisterSkill) -> None:
    register(Path(__file__).parent / "side_step")


@hookimpl
def humanclaw_recipes(register: RegisterRecipe) -> None:
    from humanclaw_skill_side_step.side_step.recipe import RECIPE

    register(RECIPE)
