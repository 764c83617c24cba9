"""HumanCLAW skill: crouching, and rising again."""

from typing import Annotated, Final

import numpy as np
from pydantic import Field

from humanclaw import Check, Keyframes, ProprioceptiveState, hookimpl, skill
from humanclaw.body import JOINT_INDEX, STANDING_HEIGHT, matrix_from_vector, rest_pose, vector_from_matrix
from humanclaw.plugins import RegisterSkill

__version__ = "0.1.0"
_LEAN: Final = np.radians(52.0)
"""Lean of the trunk in a crouch, and """
_BACK: Final = 0.13
"""way of the hips behind where they stand, metres: both keep the weight over the feet, and ankles within 35 degrees."""
_OVER_SOLES: Final = -0.065
"""Where the hips stand, metres ahead of the middle of the soles."""
_SHARES: Final = {"pelvis": 0.5, "spine1": 0.3, "spine2": 0.25, "neck": -0.2, "head": -0.35}
"""How the joints of the trunk share the lean. The head keeps half of it, so that the eyes see where hands work."""
_HANGING: Final = -sum(_SHARES[joint] for joint in ("pelvis", "spine1", "spine2"))
_SOLES: Final = [f"{side}_{part}" for side in ("left", "right") for part in ("ankle", "foot")]


def _turned(joint: str, angle: float) -> tuple[float, float, float]:
    """Return the turn of a joint that stands, tilted forwards."""
    stood = matrix_from_vector(rest_pose().rotations[0, JOINT_INDEX[joint]])
    x, y, z = vector_from_matrix(matrix_from_vector(np.array([angle, 0.0, 0.0])) @ stood).tolist()
    return x, y, z


@skill(
    checks=[
        Check("room_to_crouch", "Is there nothing right in front of the knees and the head that they would touch?")
    ],
    role="posture",
)
def crouch(
    h_cm: Annotated[
        int,
        Field(
            ge=55,
            le=90,
            description="Height of the hips above the floor.",
            json_schema_extra={"x-measure": "hips.height"},
        ),
    ],
    body: ProprioceptiveState,
) -> Keyframes:
    """Bring the hips to a height in half a second, over feet that stay: 55 to work on the floor, 90 to stand up again.

    The trunk leans as far as balance needs. What a hand holds stays level. Walking on also makes you rise.
    """
    deep = float(np.clip((STANDING_HEIGHT - h_cm / 100) / 0.42, 0.0, 1.0))
    lean = {**_SHARES, **{f"{side}_shoulder": _HANGING for side in ("left", "right") if side not in body.held}}
    ahead = float(np.mean([body.joint(part)[2] for part in _SOLES])) + _OVER_SOLES - _BACK * deep
    turns = {joint: (_turned(joint, deep * _LEAN * share),) for joint, share in lean.items()}
    return Keyframes((0.5,), turns, absolute=True, root=((0.0, h_cm / 100, ahead),))


@hookimpl
def humanclaw_skills(register: RegisterSkill) -> None:
    register(crouch)
