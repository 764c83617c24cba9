"""HumanCLAW skill: speaking to whoever is near."""

from typing import Annotated

from pydantic import Field

from humanclaw import Check, Speech, hookimpl, skill
from humanclaw.plugins import RegisterSkill

__version__ = "0.1.0"


@skill(checks=[Check("somebody_to_hear", "Is another person in this view, or has one spoken to you before?")])
def say(text: Annotated[str, Field(min_length=1, max_length=300, description="The words.")]) -> Speech:
    """Say something. Whoever is within 8 m and not behind a closed door hears it. It takes no time."""
    return Speech(text)


@hookimpl
def humanclaw_skills(register: RegisterSkill) -> None:
    register(say)
