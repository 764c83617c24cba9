"""HumanCLAW skill: stepping backwards."""

from pathlib import Path

from humanclaw import hookimpl

__version__ = "0.1.0"


@hookimpl
def humanclaw_skills(register):
    register(Path(__file__).parent / "step_back")


@hookimpl
def humanclaw_recipes(register):
    from humanclaw_skill_step_back.step_back.recipe import RECIPE

    register(RECIPE)
