"""HumanCLAW skill: answering a question, which ends the task."""

from typing import Annotated, Final

from pydantic import Field

from humanclaw import Check, Keyframes, hookimpl, skill
from humanclaw.plugins import RegisterSkill

__version__ = "0.1.0"
_SPOKEN: Final = 15
"""Characters in a second of speech."""


_SEEN: Final = "Does this view show what the question asks about? Answer yes if it asks about your own body or motion."


@skill(checks=[Check("seen_what_is_asked", _SEEN)], role="stop")
def answer(
    text: Annotated[str, Field(min_length=1, max_length=140, description="The answer alone, such as yes or no.")],
) -> Keyframes:
    """Answer the question of the task, once you have seen what it asks about. This ends the task."""
    return Keyframes((max(0.5, len(text) / _SPOKEN),), {}, absolute=True)


@hookimpl
def humanclaw_skills(register: RegisterSkill) -> None:
    register(answer)
