"""Links of the body inside one another: hands in thighs and trunk, shoes and shins in each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Final

import numpy as np

from humanclaw.body import Array, forward_kinematics, overlap
from humanclaw_train.markdown import Row

_ARM, _LEG = ("elbow", "wrist", "hand"), ("knee", "ankle", "foot")
ARMS: Final = "arms in legs or trunk"
PAIRS: Final[Mapping[str, Sequence[tuple[str, str]]]] = {
    ARMS: [
        (f"{side}_{part}", other)
        for side, part in product(("left", "right"), _ARM)
        for other in ("left_hip", "right_hip", "pelvis", "spine1", "spine2")
    ],
    "legs in each other": [
        *((f"left_{left}", f"right_{right}") for left, right in product(_LEG, _LEG)),
        ("left_hip", "right_hip"),
    ],
}
"""Pairs of links that do not touch in a healthy pose, by group."""
_TOUCH: Final = 0.002
"""Depth, metres, up to which links touch and are not inside one another."""


def summary(root: Array, rotations: Array) -> Row:
    """Return the share of poses (..., 3) and (..., 24, 3) in which links are in each other, and the greatest depth."""
    joints, turns = forward_kinematics(root, rotations)
    row = {}
    for group in PAIRS:
        deep = depth(joints, turns, group)
        row[f"{group}, % of frames"] = float(100 * (deep > _TOUCH).mean())
        row[f"{group}, deepest cm"] = float(100 * max(deep.max(), 0.0))
    return row


def depth(joints: Array, turns: Array, group: str) -> Array:
    """Return how deep links of a group are in each other (...), metres, for joints (..., 24, 3) and their orientations;
    negative where they are apart."""
    return np.asarray(np.max([overlap(joints, turns, *pair) for pair in PAIRS[group]], axis=0))
