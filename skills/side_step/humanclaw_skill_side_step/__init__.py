"""HumanCLAW skill: stepping sideways."""

from pathlib import Path

from humanclaw import hookimpl

__version__ = "0.1.0"


@hookimpl
def humanclaw_skills(register):
    register(Path(__file__).parent / "side_step")


@hookimpl
def humanclaw_recipes(register):
    from humanclaw_skill_side_step.side_step.recipe import RECIPE

    register(RECIPE)
