"""Convert between Habitat's frame and ours. Both are right-handed with Y up, in metres; only "forward" differs.

An unrotated body faces -Z in Habitat and +Z here, so the headings differ by half a turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from humanclaw.body import Array, wrap_angle
from humanclaw.world import Part, Quaternion


def axes(up: Sequence[float], front: Sequence[float]) -> Array:
    """Return the (3, 3) rotation that turns an asset's up to +Y and its front to -Z."""
    y, z = (np.asarray(way, float) / np.linalg.norm(way) for way in (up, [-value for value in front]))
    return np.stack([np.cross(y, z), y, z])


def scaled(parts: Sequence[Part], scale: Array) -> list[Part]:
    """Scale parts along the axes. Mirrored parts reverse their faces, so that the outside stays outside."""
    return [
        replace(part, vertices=part.vertices * scale, faces=part.faces if np.prod(scale) > 0 else part.faces[:, ::-1])
        for part in parts
    ]


def rotation(wxyz: Sequence[float]) -> Array:
    """Return the (3, 3) rotation of a scene instance's quaternion w, x, y, z."""
    w, x, y, z = wxyz
    return np.asarray(Rotation.from_quat([x, y, z, w]).as_matrix())


def quarter(turns: int) -> Array:
    """Return the (3, 3) rotation by quarter turns to the left about y."""
    x, z = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)][turns % 4]
    return np.array([[z, 0.0, x], [0.0, 1.0, 0.0], [-x, 0.0, z]])


def quaternion(matrix: Array) -> Quaternion:
    """Return x, y, z, w of a (3, 3) rotation, w not negative; rounded, so that equal rotations have one digest."""
    # Adding 0.0 turns -0.0 into 0.0: the two are equal numbers with different bytes.
    x, y, z, w = (round(float(value), 7) + 0.0 for value in Rotation.from_matrix(matrix).as_quat(canonical=True))
    return x, y, z, w


def heading(xyzw: Sequence[float]) -> float:
    """Return the yaw at which our body faces the way of a Habitat agent with rotation x, y, z, w.

    Radians, left turns positive.
    """
    ahead = Rotation.from_quat(xyzw).apply([0.0, 0.0, -1.0])
    return float(wrap_angle(np.arctan2(ahead[0], ahead[2])))
