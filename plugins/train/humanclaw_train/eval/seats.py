"""Sitting down and getting up in half-physics, as a body with the installed skills does it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from humanclaw import Motion
from humanclaw.body import JOINT_INDEX, Array, centre_of_mass, forward_kinematics, shoe_heights
from humanclaw_train.eval.self_penetration import ARMS, depth
from humanclaw_train.eval.simulated import Place, bench, called
from humanclaw_train.markdown import cell, table

TOPS: Final = (0.35, 0.40, 0.45, 0.50, 0.55)
"""Heights of seats, metres."""
_ASKED: Final = 0.10
"""Height of the hips over the seat that the schema of sitting down advises, metres."""
_LEFT: Final = 0.03
"""Rise of the hips, metres, from which they have left the seat."""
_STANDS: Final = 0.01
"""Height of a shoe, metres, below which it stands on the floor."""
_TOES, _ANKLES = ([JOINT_INDEX[f"{side}_{joint}"] for side in ("left", "right")] for joint in ("foot", "ankle"))
_HEEL: Final = 0.06
"""Distance of the heel behind the ankle, metres."""


@dataclass(frozen=True)
class Seat:
    """One seat, with every skill that steps called once from it; the worst of them. Lengths in cm."""

    top: float
    hips: float
    """Hips over the seat after sitting down and half a second of stopping, and"""
    shoes: float
    """the higher shoe over the floor then,"""
    settled: float
    """and a second later."""
    hands: float
    """Greatest depth of an arm in the legs or the trunk meanwhile; 0 where they are apart."""
    balance: float
    """Least distance of the centre of mass ahead of the heels when the hips leave the seat; negative behind them."""
    lean: float
    """Greatest lean of the trunk, degrees."""
    slide: float
    """Path of the further sliding toe on the floor until the body stands."""
    standing: float
    """Lowest hips after the call."""


def seats(place: Place, seed: int = 0) -> list[Seat]:
    """Sit down on each seat and get up again by each installed skill of role locomotion."""
    return [_seat(place, top, seed) for top in TOPS]


def _seat(place: Place, top: float, seed: int) -> Seat:
    found, hips, shoes, hands, ends = [], 0.0, [0.0], 0.0, []
    for name in _of_role(place, "locomotion"):
        with place(bench(top), seed) as body:
            sit = body.skills[_of_role(place, "sit")[0]]
            called(body, sit, {"hips.height": top + _ASKED})
            still = [called(body, body.skills[_of_role(place, "stop")[0]], {}) for _ in range(3)]
            hips, shoes = float(still[0].root[-1, 1]), [_shoes(motion) for motion in still]
            hands = max(float(depth(*_posed(motion), ARMS).max()) for motion in still)
            motion = called(body, body.skills[name], {})
            found.append(_rise(motion, hips))
            ends.append(float(motion.root[-1, 1]))
    worst = np.array(found)
    return Seat(
        100 * top, 100 * (hips - top), 100 * shoes[0], 100 * shoes[-1], 100 * max(hands, 0.0), float(worst[:, 0].min()),
        float(worst[:, 1].max()), float(worst[:, 2].max()), 100 * min(ends),
    )  # fmt: skip


def _of_role(place: Place, role: str) -> list[str]:
    with place(bench(TOPS[0]), 0) as body:
        return sorted(name for name, skill in body.skills.items() if skill.role == role and skill.trained)


def _shoes(motion: Motion) -> float:
    """Return the height of the higher shoe over the floor at the end."""
    return float(shoe_heights(*_posed(motion[-1:])).max())


def _posed(motion: Motion) -> tuple[Array, Array]:
    return forward_kinematics(motion.root, motion.rotations)


def _rise(motion: Motion, hips: float) -> tuple[float, float, float]:
    """Return the balance as the hips leave the seat, the greatest lean, and a foot's slide until the body stands."""
    joints, turns = _posed(motion)
    left = motion.root[:, 1] > hips + _LEFT
    off = int(np.argmax(left))
    yaw = motion.yaw()[off]
    ahead = np.array([np.sin(yaw), 0.0, np.cos(yaw)])
    weight = (centre_of_mass(joints, turns)[off] - joints[off, _ANKLES].mean(0)) @ ahead + _HEEL
    trunk = joints[:, JOINT_INDEX["neck"]] - joints[:, 0]
    lean = np.degrees(np.arccos(np.clip(trunk[:, 1] / np.linalg.norm(trunk, axis=-1), -1.0, 1.0))).max()
    # What follows once the body stands are steps, of which a foot may slide as in any.
    stands = int(np.argmax(motion.root[:, 1] > 0.9 * motion.root[:, 1].max()))
    steps = np.linalg.norm(np.diff(joints[: stands + 1, _TOES][..., [0, 2]], axis=0), axis=-1)
    down = shoe_heights(joints, turns)[1 : stands + 1] < _STANDS
    return 100 * float(weight), float(lean), 100 * float((steps * down).sum(0).max(initial=0.0))


def seats_table(found: Sequence[Seat]) -> str:
    heads = (
        "seat cm",
        "hips over it cm",
        "shoes over the floor cm",
        "1 s later",
        "hands in thighs cm",
        "weight ahead of the heels cm",
        "lean",
        "slide cm",
        "hips after one call cm",
    )
    keys = ("top", "hips", "shoes", "settled", "hands", "balance", "lean", "slide", "standing")
    return table(heads, [tuple(cell(getattr(one, key)) for key in keys) for one in found])
