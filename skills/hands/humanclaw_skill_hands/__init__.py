"""HumanCLAW skill: reaching, taking and letting go."""

from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from humanclaw import Check, Grip, Reach, hookimpl, skill
from humanclaw.body import HISTORY, JOINT_INDEX, Array, forward_kinematics
from humanclaw.plugins import RegisterMeasure, RegisterSkill
from humanclaw.skills import Measure

__version__ = "0.1.0"
_HANDS: Final = [JOINT_INDEX["left_hand"], JOINT_INDEX["right_hand"]]
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
    x_cm: Annotated[
        int,
        Field(
            ge=-70,
            le=70,
            description="To the left of your middle; negative is to the right.",
            json_schema_extra={"x-measure": "hand.left"},
        ),
    ],
    y_cm: Annotated[
        int, Field(ge=10, le=200, description="Above the floor.", json_schema_extra={"x-measure": "hand.up"})
    ],
    z_cm: Annotated[
        int, Field(ge=20, le=90, description="Ahead of your hips.", json_schema_extra={"x-measure": "hand.ahead"})
    ],
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
    ],
    role="grasp",
)
def grasp(side: Side) -> Grip:
    """Close one hand on the thing before its palm, within 6 cm: a loose thing, a door, a drawer or a lid.

    One hand lifts 15 kg, two lift more. What it holds goes where the hand goes, also while you walk or sit, until you
    release it or it is knocked out of the hand.
    """
    return Grip(side)


@skill(
    checks=[Check("lands_safely", "Is there a surface right below what this hand holds, or may it fall?")],
    role="release",
)
def release(side: Side) -> Grip:
    """Open one hand: what it holds falls, or stays on what carries it."""
    return Grip(side, closed=False)


def _moved(root: Array, rotations: Array) -> Array:
    """Return where the hand that moves farther ends, (N, 3) metres from the floor under the hips at the beginning."""
    hands = forward_kinematics(root, rotations)[0][:, [HISTORY - 1, -1]][:, :, _HANDS]
    farther = np.argmax(np.linalg.norm(hands[:, 1] - hands[:, 0], axis=-1), axis=-1)
    return np.asarray(hands[np.arange(len(root)), 1, farther])


@hookimpl
def humanclaw_measures(register: RegisterMeasure) -> None:
    place = "of the hand that moves farther at the end, from the floor under the hips at the beginning."
    register(Measure("hand.left", "m", f"Place to the left {place}", -1, lambda p, r: _moved(p, r)[:, 0]))
    register(Measure("hand.up", "m", f"Height {place}", 1, lambda p, r: _moved(p, r)[:, 1]))
    register(Measure("hand.ahead", "m", f"Place ahead {place}", 1, lambda p, r: _moved(p, r)[:, 2]))


@hookimpl
def humanclaw_skills(register: RegisterSkill) -> None:
    for contract in (reach, grasp, release):
        register(contract)
