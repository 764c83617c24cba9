"""Joints: a hinge or a slide leaves an object one way to move, so that one number says where it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final, TypeAlias

import numpy as np

from humanclaw.body.pose import Array, matrix_from_quaternion
from humanclaw.errors import SceneError

Vec3 = tuple[float, float, float]
_UP: Final = (0.0, 1.0, 0.0)
"""The axis of a hinge unless one is named: doors stand upright."""
GRAVITY: Final = 9.81
"""Earth's, m/s2."""
_HELD: Final = 1.5
"""How many times its weight the friction of a balanced object holds."""


@dataclass(frozen=True)
class Hinge:
    """An axis that an object turns about, as a door or the lid of an oven does.

    Angles are radians and grow counter-clockwise about the axis: to the left, seen from above, where the axis is
    vertical. At 0 a door is, by custom, closed.
    """

    unit: ClassVar = "rad"

    point: Vec3
    """Any point of the axis, in the frame of the object's asset, metres."""
    low: float
    high: float
    """The range of the angle. It stops the object; fixed objects and those on other joints do not, so that a door does
    not jam in its frame."""
    friction: float = 2.0
    """Torque that holds the object and brakes it, whatever its speed, newton metres."""
    damping: float = 5.0
    """Torque that brakes it for each rad/s, newton metre seconds."""
    axis: Vec3 = _UP
    """Unit vector in the frame of the object's asset."""

    def __post_init__(self) -> None:
        _check(self, "hinge", *self.point)
        if self.high - self.low > 2 * np.pi:
            raise SceneError(
                f"the range of a hinge is {self.low:g} to {self.high:g}: it must be a whole turn at most.",
                "Give radians.",
            )

    def moved(self, by: float) -> tuple[Array, Array]:
        """Return (3,) the way and (4,) the turn of the asset's frame when the hinge turns by an angle."""
        turn = np.append(np.sin(by / 2) * np.array(self.axis), np.cos(by / 2))
        point = np.array(self.point)
        return point - matrix_from_quaternion(turn) @ point, turn


@dataclass(frozen=True)
class Slide:
    """A straight line that an object moves along, as a drawer does. At 0 a drawer is, by custom, closed."""

    unit: ClassVar = "m"

    low: float
    high: float
    """The range of the way, metres, with what stops it as for a Hinge."""
    friction: float = 5.0
    """Force that holds the object and brakes it, whatever its speed, newtons."""
    damping: float = 20.0
    """Force that brakes it for each m/s, newton seconds per metre."""
    axis: Vec3 = (0.0, 0.0, 1.0)
    """Unit vector in the frame of the object's asset."""

    def __post_init__(self) -> None:
        _check(self, "slide")

    def moved(self, by: float) -> tuple[Array, Array]:
        """Return (3,) the way and (4,) the turn of the asset's frame when the object slides so far."""
        return by * np.array(self.axis), np.array([0.0, 0.0, 0.0, 1.0])


Joint: TypeAlias = Hinge | Slide


def _check(joint: Joint, kind: str, *point: float) -> None:
    numbers = (*point, joint.low, joint.high, joint.friction, joint.damping, *joint.axis)
    if len(numbers) - len(point) != 7 or len(point) != 3 * (kind == "hinge") or not np.isfinite(numbers).all():
        raise SceneError(f"a {kind} needs finite numbers; got {numbers}.", "Give three numbers for a point or an axis.")
    if min(joint.friction, joint.damping) < 0 or abs(np.linalg.norm(joint.axis) - 1) > 0.001:
        raise SceneError(
            f"a {kind} needs a unit axis and no negative friction or damping; got axis {joint.axis}, friction "
            f"{joint.friction:g}, damping {joint.damping:g}.", "Divide the axis by its length."
        )  # fmt: skip
    if joint.low >= joint.high:
        raise SceneError(
            f"the range of a {kind} is {joint.low:g} to {joint.high:g}: it must grow.",
            f"Give {joint.unit}, the smaller first; leave out the joint of what does not move.",
        )


def balanced(joint: Joint, centre: Array, mass: float) -> Joint:
    """Return a joint whose friction holds an upright object wherever it is, as the springs of a dishwasher do.

    centre: (3,) its centre of mass in its asset's frame, metres; mass: kilograms.
    """
    axis = np.array(joint.axis)
    if isinstance(joint, Hinge):
        arm = float(np.linalg.norm(np.cross(axis, centre - np.array(joint.point))))
        pull = arm * float(np.hypot(axis[0], axis[2]))
    else:
        pull = abs(float(axis[1]))
    return replace(joint, friction=max(joint.friction, _HELD * mass * GRAVITY * pull))


def facts_of(joint: Joint) -> dict[str, Any]:
    """Return a joint as plain values for JSON; the axis of a hinge only if it is not vertical."""
    facts: dict[str, Any] = dict(vars(joint))
    if isinstance(joint, Hinge) and joint.axis == _UP:
        del facts["axis"]
    return facts


def joint_of(facts: Mapping[str, Any]) -> Joint:
    """Return the joint of such plain values: a hinge has a point. Raises TypeError or KeyError if they are others."""
    vectors = {key: tuple(facts[key]) for key in ("point", "axis") if key in facts}
    kind = Hinge if "point" in facts else Slide
    return kind(**(dict(facts) | vectors))
