"""HumanCLAW skill: coming to rest."""

from pathlib import Path

from humanclaw import hookimpl
from humanclaw.plugins import RegisterSkill

__version__ = "0.1.0"


@hookimpl
def humanclaw_skills(register: RegisterSkill) -> None:
    register(Path(__file__).parent / "stop")
