"""HumanCLAW skill: stepping backwards."""

from pathlib import Path

from humanclaw import hookimpl
from humanclaw.plugins import RegisterRecipe, RegisterSkill

__version__ = "0.1.0"


@hookimpl
def humanclaw_skills(register: RegisterSkill) -> None:
    register(Path(__file__).parent / "step_back")


@hookimpl
def humanclaw_recipes(register: RegisterRecipe) -> None:
    from humanclaw_skill_step_back.step_back.recipe import RECIPE

    register(RECIPE)
