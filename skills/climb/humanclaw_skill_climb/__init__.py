"""HumanCLAW skills: climbing and descending stairs."""

from pathlib import Path

from humanclaw import hookimpl
from humanclaw.plugins import RegisterSkill

__version__ = "0.1.0"


@hookimpl
def humanclaw_skills(register: RegisterSkill) -> None:
    for name in ("climb_upstairs", "walk_downstairs"):
        register(Path(__file__).parent / name)
