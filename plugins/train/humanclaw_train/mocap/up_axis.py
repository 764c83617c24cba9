"""Which axis of captured motion points up: found from head, feet and floor. Needs only numpy."""

from __future__ import annotations

from typing import Final, Literal, cast, get_args

import numpy as np

from humanclaw.body import Array
from humanclaw.motion import SIDES
from humanclaw_train.mocap.joint_maps import naming_of
from humanclaw_train.mocap.source_motion import AXES, MocapError, SourceMotion
from humanclaw_train.mocap.world_pose import swing

Up = Literal["x", "y", "z", "-x", "-y", "-z"]

_ALONG: Final = 0.9
"""Cosine of the angle to an axis, below which a body does not stand along it: 26 degrees."""
_MOSTLY: Final = 0.8
"""Share of the frames in which a body stands."""
_NEAR: Final = 0.1
"""A floor lies at 0, give or take this share of the body's height."""
_STEADIER: Final = 3.0
"""How many times less the lowest joint moves along an axis that points up. Measured: never along another axis in 220
captured clips that do not stand; 3.3 or more in crawls, rolls, kicks, flips and bows whose axis was exchanged."""
_MOVES: Final = {True: 0.15, False: 0.03}
"""Share of the body's height by which the lowest joint moves along an axis that is none, by whether a body stands
along it. Measured: up to .12 in clips that stand, of captures that drift."""


def stood_up(source: SourceMotion, asked: Up | None) -> SourceMotion:
    """Return motion turned to Y up, and its reference pose likewise, each by the axis that points up in it.

    asked: the axis of the motion; None to find it. Raises MocapError if a body may as well lie as stand.
    """
    try:
        naming = naming_of(source)
    except MocapError:  # Retargeting says which joints are missing.
        turn = _to_y(asked or "y")
        return source.turned(turn, turn)
    top, feet = naming.get("head", naming.get("neck", naming["left_shoulder"])), ("left_ankle", "right_ankle")
    columns = [source.joints.index(name) for name in (top, naming["pelvis"], *(naming[foot] for foot in feet))]
    joints = source.positions[:, columns]
    reference = _stands(source.rest.positions[None, columns])
    hips = np.diff(source.positions[:, [source.joints.index(naming[f"{side}_hip"]) for side in SIDES]], axis=1)[:, 0]
    if not _length(joints).any():
        raise MocapError(
            "Head, pelvis and feet are in one place.",
            "A position channel replaces its joint's OFFSET: export positions, or rotations alone.",
        )
    up = asked or _found(source, joints, hips, reference or "y")
    if reference is None:
        # Zero angles that are no pose of a person, as of LAFAN and Rokoko, whose bones all lie along X then.
        source, reference = source.with_reference_frame(_straightest(joints, up)), up
    return source.turned(_to_y(up), _to_y(reference))


def _found(source: SourceMotion, joints: Array, hips: Array, usual: Up) -> Up:
    """Return the axis that points up. joints: (T, 4, 3) of head, pelvis, ankles. hips: (T, 3) from left to right.

    usual: the axis of the skeleton. A body that lies along an axis looks like one that stands along it. It lies if its
    trunk is above 0 along the usual axis and something of it at 0, and stands if its feet are at 0 along its own.
    """
    stands, height = _stands(joints), float(np.median(np.linalg.norm(_length(joints), axis=-1)))
    floor = _steadier(source.positions / height, hips, usual, _MOVES[stands == usual])
    if floor and stands != usual:
        return floor
    if floor is None:
        if stands is None or stands == usual:
            return usual
        near = _NEAR * height
        lies = _lowest(joints, usual) > 0 and _lowest(source.positions, usual) < near
        if lies != (abs(_lowest(source.positions, stands)) < near):
            return usual if lies else stands
    other = floor or stands
    raise MocapError(
        f"{source.source}: expected a body that stands along {usual}, as its skeleton does; it is along {other}, "
        "and may lie or stand.",
        f"Give the axis that points up: --up {usual} or --up {other}.",
    )


def _steadier(positions: Array, hips: Array, usual: Up, moves: float) -> Up | None:
    """Return Y or Z if it has a floor at 0 and the usual axis has none: what is lowest moves far more along that.

    positions: in heights of the body. A body on its side is none: its lowest shoulder may be steady on any path.
    """
    other: Up = "z" if usual == "y" else "y"
    spread, least = (
        np.subtract(*np.percentile((positions @ _axis(up)).min(axis=1), (75, 25))) for up in (usual, other)
    )
    # The line through the hips is within 45 degrees of the axis.
    on_side = np.median(np.abs(hips @ _axis(other)) / np.linalg.norm(hips, axis=-1)) > np.sqrt(0.5)
    steady = spread > max(moves, _STEADIER * least) and abs(_lowest(positions, other)) < _NEAR
    return other if steady and not on_side else None


def _length(joints: Array) -> Array:
    """Return (T, 3) from the middle of the ankles to the head."""
    return np.asarray(joints[:, 0] - joints[:, 2:].mean(axis=1))


def _stands(joints: Array) -> Up | None:
    """Return the axis along which a body stands in most frames, its pelvis between head and ankles."""
    length = np.linalg.norm(_length(joints), axis=-1)
    for up in get_args(Up):
        heights = joints @ _axis(up)
        head, pelvis, ankles = heights[:, 0], heights[:, 1], heights[:, 2:]
        along = head - ankles.mean(axis=1) > _ALONG * length
        if np.mean(along & (head > pelvis) & (pelvis > ankles.max(axis=1))) >= _MOSTLY:
            return cast(Up, up)
    return None


def _straightest(joints: Array, up: Up) -> int:
    """Return the frame in which back and legs point up most."""
    parts = joints[:, 0] - joints[:, 1], joints[:, 1] - joints[:, 2:].mean(axis=1)
    return int(np.argmax(sum(part @ _axis(up) / np.linalg.norm(part, axis=-1) for part in parts)))


def _lowest(positions: Array, up: Up) -> float:
    """Return the median height of each frame's lowest joint."""
    return float(np.median((positions @ _axis(up)).min(axis=1)))


def _axis(up: Up) -> Array:
    return np.asarray(AXES[up[-1]] * (-1.0 if up[0] == "-" else 1.0))


def _to_y(up: Up) -> Array:
    """Return the (3, 3) smallest rotation that turns an axis to Y."""
    # Of two opposite directions no turn is the smallest: about X, as any.
    return np.diag([1.0, -1.0, -1.0]) if up == "-y" else swing(_axis(up), AXES["y"])
