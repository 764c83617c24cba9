"""Recipes: which windows of real clips show a trained skill, and how its motion is synthesised.

A trained skill keeps its recipe in a recipe.py beside its schema.json. humanclaw-train reads and interprets it, and
knows no skill by name. The schema declares the measure that each parameter commands, and synthesis follows it. Needs
numpy alone.

    RECIPE = Recipe(
        name="stroll",
        windows=lambda w: (w.forward > 0.1) & (w.forward < 0.5),
        gait=GaitParameters(width=0.09, clearance=0.04),
        commands={"ahead": Draw(0.1, 0.5, usual=0.4, spread=0.05)},
    )
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from humanclaw.body.pose import CHUNK, Array, forward_kinematics
from humanclaw.body.skeleton import N_JOINTS

Mask: TypeAlias = NDArray[np.bool_]


# -- real motion -------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class WindowTravel:
    """N windows of real motion, of 5 frames of history and 15 of future, for the rules of recipes.

    across (positive to the left), up, forward: displacement of the pelvis from the last history frame to the last
    frame (N,), metres. yaw: turn, radians. feet: mean horizontal path of the two feet, metres. neutral: ends upright
    with the hands below the shoulders. level: the toes keep to one floor, as they do not on stairs. root (N, 20, 3),
    rotations (N, 20, 24, 3): of the whole body, in the canonical frame.
    """

    across: Array
    up: Array
    forward: Array
    yaw: Array
    feet: Array
    neutral: Mask
    level: Mask
    root: Array = field(default_factory=lambda: np.zeros((0, CHUNK, 3)))
    rotations: Array = field(default_factory=lambda: np.zeros((0, CHUNK, N_JOINTS, 3)))

    @property
    def joints(self) -> Array:
        """Positions of the joints (N, 20, 24, 3), metres."""
        return forward_kinematics(self.root, self.rotations)[0]

    @property
    def flat(self) -> Array:
        """Horizontal distance, metres."""
        return np.hypot(self.across, self.forward)

    @property
    def idle(self) -> Mask:
        """Which windows stand still, whatever the arms do."""
        still = (self.flat < 0.05) & (np.abs(self.yaw) < 0.14)
        return np.asarray(still & (self.feet < 0.06) & (np.abs(self.up) < 0.03))


# -- synthetic motion --------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class GaitParameters:
    """How a skill steps. Lengths in metres, angles in radians, instants as shares of the half second of a chunk."""

    width: float = 0.085
    """Of each foot from the middle."""
    narrowing: float = 0.0
    """By how much striding feet pass closer than standing ones are apart."""
    clearance: float = 0.035
    """Height of a swing."""
    land: float = 0.4
    """When the first foot lands,"""
    lift: float = 0.58
    """and the second one leaves."""
    lift_pitch: float = 0.7
    """Of the heel as a foot leaves, radians for a metre of travel,"""
    land_pitch: float = 0.0
    """and as it lands; toes up is negative."""
    arms: float = 0.0
    """Amplitude of the gait's upper body at 1.15 m/s, in that of real walkers."""
    lean: float = 0.0
    """Of the trunk to the front."""
    gaze_pitch: float = 0.0
    """Of the head, downwards."""
    gaze_turn: float = 0.5
    """By how much the head goes ahead of a turn."""
    exit: float = 0.0
    """Share of the mean velocity that is left at the end,"""
    turn_exit: float = 0.2
    """and of the turning."""


@dataclass(frozen=True)
class Draw:
    """Distribution of the commands of one parameter, SI: half uniform from low to high, half near the usual value.

    usual, spread: mean and deviation of the latter; None for an even spread alone. nought: share of those that are
    exactly 0. jitter: deviation from one command to the next while a skill goes on.
    """

    low: float
    high: float
    usual: float | None = None
    spread: float = 0.0
    nought: float = 0.0
    jitter: float = 0.0


Feet: TypeAlias = Literal["stride", "shuffle", "settle"]
"""Movement of the feet: `stride` pass each other, `shuffle` open and close, `settle` come to stand."""


@dataclass(frozen=True)
class Recipe:
    """One skill's recipe. Without windows no real motion shows the skill; without gait none is synthesised."""

    name: str
    """Of the skill."""
    description: str = ""
    windows: Callable[[WindowTravel], Mask] | None = None
    """Which windows of clips with the tag show the skill."""
    tag: str = ""
    """Of the spans of clips in which the skill is looked for; the skill's name where it is empty."""
    gait: GaitParameters | None = None
    feet: Feet = "settle"
    commands: Mapping[str, Draw] = field(default_factory=dict)
    """By name of the parameter behind the contract, as in Control.values."""
    share: float = 1.0
    """How often the skill follows another one in synthetic sequences, beside the other skills (.01 or more),"""
    repeats: float = 0.4
    """and how often itself (0 to below 1)."""
    stays_seated: bool = False
    """Whether a body that sits stays seated; otherwise it rises."""
    retimed: bool = False
    """Whether its clips are also played at other paces, backwards and with halts, over feet that stay: for a posture or
    a gesture."""
