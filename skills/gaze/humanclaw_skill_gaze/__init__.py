"""HumanCLAW skill: looking aside, up and down."""

from typing import Annotated

from pydantic import Field

from humanclaw import Check, Gaze, hookimpl, skill
from humanclaw.plugins import RegisterSkill

__version__ = "0.1.0"


@skill(checks=[Check("hidden_from_view", "Is what you look for outside of this view, to a side, above or below?")])
def gaze(
    yaw_deg: Annotated[int, Field(ge=-80, le=80, description="How far to the left; negative is to the right.")],
    pitch_deg: Annotated[int, Field(ge=-60, le=40, description="How far above the horizon; negative is below.")] = -30,
) -> Gaze:
    """Turn head and eyes for half a second, and see what is there; the feet stay. Walking on turns them ahead again."""
    return Gaze.towards(yaw_deg, pitch_deg, seconds=0.5)


@hookimpl
def humanclaw_skills(register: RegisterSkill) -> None:
    register(gaze)
