"""HumanCLAW skills: climbing and descending stairs."""

from pathlib import Path

from humanclaw import hookimpl
from humanclaw.plugins import RegisterRecipe, RegisterSkill

__version__ = "0.1.0"


@hookimpl
def humanclaw_skills(register: RegisterSkill) -> None:
    for name in ("climb_upstairs", "walk_downstairs"):
        register(Path(__file__).parent / name)


@hookimpl
def humanclaw_recipes(register: RegisterRecipe) -> None:
    from humanclaw_skill_climb.climb_upstairs.recipe import RECIPE as UP
    from humanclaw_skill_climb.walk_downstairs.recipe import RECIPE as DOWN

    register(UP)
    register(DOWN)
