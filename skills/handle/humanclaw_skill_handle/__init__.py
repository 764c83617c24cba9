"""HumanCLAW skill: pulling and pushing what a hand holds."""

from typing import Annotated, Final, Literal

from pydantic import Field

from humanclaw import Check, ProprioceptiveState, Reach, hookimpl, skill
from humanclaw.plugins import RegisterSkill

__version__ = "0.1.0"
Side = Annotated[Literal["left", "right"], Field(description="Which hand.")]
Centimetres = Annotated[int, Field(ge=5, le=40, description="How far, in centimetres.")]
_NEAREST: Final = 0.22
"""Metres ahead of the hips to which a hand comes back before the chest."""
_BESIDE: Final = -0.25
"""The same beside the hips."""


@skill(
    checks=[
        Check("hand_on_handle", "Does this hand hold a handle or a thing that can be pulled?"),
        Check("room_behind", "Is there room for what it opens between you and it?"),
    ]
)
def pull(side: Side, cm: Centimetres, body: ProprioceptiveState) -> Reach:
    """Draw one hand towards you in half a second: a closed hand opens a door, a drawer or a lid with it.

    A door takes the hand along its own arc. The hand stops before your chest; to pull further, step back with the hand
    closed.
    """
    x, y, z = map(float, body.joint(f"{side}_hand"))
    nearest = _NEAREST if z > _NEAREST else _BESIDE
    return Reach(side, (x, y, max(z - cm / 100, nearest)), seconds=0.5)


@skill(
    checks=[
        Check("hand_on_it", "Is this hand on the thing that is to be pushed?"),
        Check("free_behind_it", "Is the way of the thing free, away from you?"),
    ]
)
def push(side: Side, cm: Centimetres, body: ProprioceptiveState) -> Reach:
    """Move one hand away from you in half a second: it shuts a door or a drawer, or pushes a thing ahead.

    Your feet stay; to push further, walk.
    """
    x, y, z = map(float, body.joint(f"{side}_hand"))
    return Reach(side, (x, y, z + cm / 100), seconds=0.5)


@hookimpl
def humanclaw_skills(register: RegisterSkill) -> None:
    register(pull)
    register(push)
