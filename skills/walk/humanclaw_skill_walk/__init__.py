"""HumanCLAW skill: walking."""

from pathlib import Path

from humanclaw import hookimpl

__version__ = "0.1.0"


@hookimpl
def humanclaw_skills(register):
    register(Path(__file__).parent / "walk")


@hookimpl
def humanclaw_recipes(register):
    from humanclaw_skill_walk.walk.recipe import RECIPE

    register(RECIPE)
