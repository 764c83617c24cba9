"""HumanCLAW skill: reaching, taking and letting go."""

from typing import Annotated, Literal

from pydantic import Field

from humanclaw import Check, Grip, Reach, hookimpl, skill
from humanclaw.plugins import RegisterSkill

__version__ = "0.1.0"
Side = Annotated[Literal["left", "right"], Field(description="Which hand.")]


@skill(
    checks=[
        Check("within_reach", "Is the place to reach for within an arm's length in this view?"),
        Check(
            "arm_free", "Is the space between this hand and that place free, so that the arm would knock nothing over?"
        ),
    ]
)
def reach(
    side: Side,
    x_cm: Annotated[int, Field(ge=-70, le=70, description="To the left of your middle; negative is to the right.")],
    y_cm: Annotated[int, Field(ge=10, le=200, description="Above the floor.")],
    z_cm: Annotated[int, Field(ge=20, le=90, description="Ahead of your hips.")],
) -> Reach:
    """Bring the knuckles of one hand to a point, in centimetres from the floor under your hips, in half a second.

    Trunk and knees help, and your feet stay. The palm faces inwards: to take a thing, bring the hand close beside it,
    then call grasp. What the hand holds goes along and stays level. You are told how far the hand stays short; call
    again to go on, or step closer.
    """
    return Reach(side, (x_cm / 100, y_cm / 100, z_cm / 100), seconds=0.5)


@skill(
    checks=[
        Check("thing_at_palm", "Is the thing to take right before the palm of this hand, within 6 cm?"),
        Check("hand_empty", "Is this hand empty?"),
    ]
)
def grasp(side: Side) -> Grip:
    """Close one hand on the thing before its palm, within 6 cm: a loose thing, a door, a drawer or a lid.

    One hand lifts 15 kg, two lift more. What it holds goes where the hand goes, also while you walk or sit, until you
    release it or it is knocked out of the hand.
    """
    return Grip(side)


@skill(checks=[Check("lands_safely", "Is there a surface right below what this hand holds, or may it fall?")])
def release(side: Side) -> Grip:
    """Open one hand: what it holds falls, or stays on what carries it."""
    return Grip(side, closed=False)


@hookimpl
def humanclaw_skills(register: RegisterSkill) -> None:
    for one in (reach, grasp, release):
        register(one)
