"""Feedback on the last step: values for the record, words for models and people."""

from __future__ import annotations

import operator
from dataclasses import dataclass, fields
from typing import Annotated, Any, ClassVar, Final

import numpy as np
from pydantic import Field

from humanclaw.body.pose import FPS
from humanclaw.records.decisions import Answer
from humanclaw.skills.call import Call, quoted
from humanclaw.skills.gaze_grip_speech import Point, Side
from humanclaw.skills.proprioception import posture_of
from humanclaw.text.json import STRICT
from humanclaw.world.simulator import Heard

_UNTOUCHED: Final = "You touch nothing but what you stand on."
_TILTED: Final = 20.0
"""Degrees from which a tilted trunk is mentioned."""


@dataclass(frozen=True)
class Displacement:
    """A displacement in the body frame: left, up, forward in metres, and a left turn in radians."""

    __pydantic_config__: ClassVar = STRICT

    left: float
    up: float
    forward: float
    turn: float

    def __str__(self) -> str:
        left, up, forward = np.round(100 * np.array([self.left, self.up, self.forward])).astype(int)
        turn = round(float(np.degrees(self.turn)))
        parts = [
            f"{abs(forward)} cm {'forward' if forward > 0 else 'back'}" if forward else "",
            f"{abs(left)} cm to the {'left' if left > 0 else 'right'}" if left else "",
            f"{abs(up)} cm {'up' if up > 0 else 'down'}" if abs(up) > 2 else "",
            f"a turn of {abs(turn)} degrees to the {'left' if turn > 0 else 'right'}" if abs(turn) > 1 else "",
        ]
        return ", ".join(part for part in parts if part) or "none"


@dataclass(frozen=True)
class Proprioception:
    """The posture after a step, and the intended and the actual displacement."""

    __pydantic_config__: ClassVar = STRICT

    hip_height: float
    """Height of the pelvis above the soles, metres."""
    trunk_tilt: float
    """Angle from upright, degrees."""
    intended: Displacement
    moved: Displacement

    def __str__(self) -> str:
        tilt = "" if self.trunk_tilt < _TILTED else f", trunk tilted by {self.trunk_tilt:.0f} degrees"
        return (
            f"You feel yourself {posture_of(self.hip_height)}{tilt}: "
            f"your hips are {100 * self.hip_height:.0f} cm above your soles. "
            f"Intended movement: {self.intended}. Actual movement: {self.moved}."
        )


@dataclass(frozen=True)
class Touch:
    """A part of the body touched something other than the ground under the feet."""

    __pydantic_config__: ClassVar = STRICT

    part: str
    """Such as 'left arm or hand'."""
    frames: int
    gives_way: bool
    """Whether a touched object is movable."""
    holds: bool = False
    """Whether the part is a hand that holds something; frames: how long it has in this step."""
    person: Annotated[bool, Field(exclude_if=operator.not_)] = False
    """Whether it touched another person."""

    def __str__(self) -> str:
        if self.holds:
            return f"Your {self.part} holds something."
        felt = ", ".join([*["it gives way"] * self.gives_way, *["a person"] * self.person])
        return f"your {self.part} for {self.frames / FPS:.1f} s{f' ({felt})' if felt else ''}"


@dataclass(frozen=True)
class HandAim:
    """Where a hand was to go, and how far it ended from there."""

    __pydantic_config__: ClassVar = STRICT

    hand: Side
    at: Point
    """Left, up, ahead in metres, in the body's frame as the part began."""
    error: float
    """Metres."""


@dataclass(frozen=True, kw_only=True)
class Felt:
    """What a call did to the body, as the agent is told it and as the step's record keeps it."""

    proprioception: Proprioception | None = None
    tactile: tuple[Touch, ...] | None = None
    """Readings of the touch sense; None if it was off, empty if nothing was touched."""
    waited: Annotated[int, Field(ge=0, le=10_000, exclude_if=operator.not_)] = 0
    """Half seconds that the world went on while the agent thought, before the call; each costs a step."""
    cancelled: bool = False
    """Whether the call was broken off between two chunks."""
    limits: tuple[str, ...] = ()
    """What the body could not do of the call, in words: a joint's limit, a target out of reach."""
    fall: Annotated[float, Field(ge=0, le=10_000)] = 0.0
    """How far the body fell without touching anything, metres, if that was half a metre or more; the deepest fall. One
    that began in an earlier step counts from there."""
    falling: bool = False
    """Whether that fall was still going on when the step ended; the next step that moves tells its depth by then."""
    heard: Annotated[tuple[Heard, ...], Field(exclude_if=operator.not_)] = ()
    """What others said while the body moved."""

    @property
    def felt(self) -> dict[str, Any]:
        """These facts by name."""
        return {fact.name: getattr(self, fact.name) for fact in fields(Felt)}


@dataclass(frozen=True)
class Feedback(Felt):
    """Outcome of the last step, or the reason why the last answer was refused. str() gives words."""

    executed: Call | None = None
    replaced: Call | None = None
    """The proposed call, if the verifier replaced it."""
    failed: tuple[Answer, ...] = ()
    """The checks that the proposed call failed."""
    refusal: str = ""
    """Reason why nothing was executed."""

    def __bool__(self) -> bool:
        return self.executed is not None or bool(self.refusal)

    def __str__(self) -> str:
        if self.executed is None:
            return self.refusal
        held = f"Your body could not do all of it: {'; '.join(self.limits)}." if self.limits else ""
        fell = f"You {'are falling, so far' if self.falling else 'fell'} {self.fall:.1f} m." if self.fall else ""
        thought = f"{self.waited / 2:g} s passed while you thought." if self.waited else ""
        return " ".join(
            filter(None, (thought, self._action(), held, fell, self.sensor_readings, *map(_told, self.heard)))
        )

    @property
    def sensor_readings(self) -> str:
        """The readings of all senses beside vision in words; empty if they are off."""
        readings = (str(self.proprioception or ""), _touched(self.tactile))
        return " ".join(filter(None, readings))

    def _action(self) -> str:
        if self.replaced is None:
            return f"Executed {self.executed}{', and broke it off' if self.cancelled else ''}."
        why = "; ".join(answer.note or answer.check for answer in self.failed)
        return (
            f"{self.replaced} was not executed: the check before execution failed{f' ({why})' if why else ''}. "
            f"Executed {self.executed} in its place."
        )


def _touched(tactile: tuple[Touch, ...] | None) -> str:
    if tactile is None:
        return ""
    held = [str(touch) for touch in tactile if touch.holds]
    met = ", ".join(str(touch) for touch in tactile if not touch.holds)
    return " ".join([*([f"Something touched {met}."] if met else []), *held]) or _UNTOUCHED


def _told(heard: Heard) -> str:
    """Tell who speaks from where, and what."""
    left, _, ahead = heard.at
    sides = ("to your left", "to your right") if abs(left) > abs(ahead) else ("ahead of you", "behind you")
    side = sides[max(left, ahead, key=abs) < 0]
    return f"The other person, {np.hypot(left, ahead):.0f} m {side}, says: {quoted(heard.text)}."
