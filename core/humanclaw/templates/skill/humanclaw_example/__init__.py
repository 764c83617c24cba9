"""DESCRIPTION"""

from typing import Annotated

from pydantic import Field

from humanclaw import Keyframes, hookimpl, skill
from humanclaw.hookspecs import RegisterSkill

__version__ = "0.1.0"


@skill(checks=["Is anybody in view who could see it?"])
def example_call(
    times: Annotated[int, Field(ge=1, le=5, description="How often, a second each.")] = 1,
) -> Keyframes:
    """Raise the right arm to the side and let it sink again."""
    return Keyframes.cycle("right_shoulder", axis="z", degrees=60, seconds=1.0, times=times)


@hookimpl
def humanclaw_skills(register: RegisterSkill) -> None:
    register(example_call)
