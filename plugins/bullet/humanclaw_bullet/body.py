"""Load the body into Bullet: one tree of spherical joints, written as a URDF."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from itertools import product
from pathlib import Path
from typing import Final

import numpy as np

from humanclaw.body import JOINTS, OFFSETS, PARENTS, Array, Box
from humanclaw.world import LINK_OF, Profile, capsule_frame, link_inertia, link_mass
from humanclaw_bullet.engine import Client
from humanclaw_bullet.objects import wavefront

_CUBE: Final = "cube.obj"
"""File of a cube of one metre. A box of the body is a hull: two boxes have no contact in Bullet before they overlap, so
shoes would enter the floor and be pushed out again."""
_MARGIN: Final = 0.001
"""Metres that Bullet adds around a hull from a file."""


def load_body(client: Client, profile: Profile, folder: Path) -> int:
    """Build the body in a world and return Bullet's number of it. Bullet's link index is the joint's index minus 1.

    folder: for a file that Bullet reads.
    """
    path = folder / "body.urdf"
    path.write_text(urdf(profile), encoding="utf-8")
    (folder / _CUBE).write_text(wavefront([np.array(list(product((-0.5, 0.5), repeat=3)))]), encoding="utf-8")
    # Without the first flag Bullet works the inertia out from the shapes.
    # Without the second flag Bullet numbers the links depth first.
    flags = client.URDF_USE_INERTIA_FROM_FILE | client.URDF_MAINTAIN_LINK_ORDER
    body = int(client.loadURDF(str(path), flags=flags))
    _free(client, body, profile)
    return body


def _free(client: Client, body: int, profile: Profile) -> None:
    """Set the surface friction, and switch off Bullet's own motors, damping and sleep."""
    # From -1, the base. Bullet's damping, .04 unless it is set, would slow a fall.
    for link in range(-1, len(JOINTS) - 1):
        client.changeDynamics(
            body, link, lateralFriction=profile.friction, linearDamping=0, angularDamping=0, jointDamping=0,
            activationState=client.ACTIVATION_STATE_DISABLE_SLEEPING,
        )  # fmt: skip
    for link in range(len(JOINTS) - 1):
        client.setJointMotorControlMultiDof(
            body, link, client.POSITION_CONTROL, targetPosition=[0, 0, 0, 1], positionGain=0, velocityGain=0,
            force=[0, 0, 0],
        )  # fmt: skip


@cache
def urdf(profile: Profile) -> str:
    """Return the body as URDF: the one format through which Bullet accepts the inertia of a link."""
    parts = [part for joint in range(len(JOINTS)) for part in (_urdf_link(joint, profile), _urdf_joint(joint))]
    # Separate lines, because Bullet reads at most 1 kB of a line.
    return "\n".join(["<robot name='body'>", *parts, "</robot>"])


def _urdf_link(joint: int, profile: Profile) -> str:
    name = JOINTS[joint]
    inertia = link_inertia(name, profile)
    diagonal = f"ixx='{inertia}' iyy='{inertia}' izz='{inertia}' ixy='0' ixz='0' iyz='0'"
    inertial = (
        f"<inertial><origin xyz='0 0 0'/><mass value='{link_mass(name, profile)}'/><inertia {diagonal}/></inertial>"
    )
    return f"<link name='{name}'>{inertial}{_urdf_collision(name) if name in LINK_OF else ''}</link>"


def _urdf_collision(name: str) -> str:
    shape = LINK_OF[name].shape
    if isinstance(shape, Box):
        scale = np.multiply(shape.half, 2) - 2 * _MARGIN
        hull = f"<geometry><mesh filename='{_CUBE}' scale='{_text(scale)}'/></geometry>"
        return f"<collision><origin xyz='{_text(shape.centre)}'/>{hull}</collision>"
    centre, turn, length = capsule_frame(shape)
    origin = f"<origin xyz='{_text(centre)}' rpy='{_text(roll_pitch_yaw(turn))}'/>"
    geometry = f"<geometry><capsule radius='{shape.radius}' length='{length}'/></geometry>"
    return f"<collision>{origin}{geometry}</collision>"


def _urdf_joint(joint: int) -> str:
    if joint == 0:
        return ""
    ends = f"<parent link='{JOINTS[PARENTS[joint]]}'/><child link='{JOINTS[joint]}'/>"
    place = f"<origin xyz='{_text(OFFSETS[joint])}'/><axis xyz='1 0 0'/>"
    return f"<joint name='to_{JOINTS[joint]}' type='spherical'>{ends}{place}</joint>"


def roll_pitch_yaw(m: Array) -> tuple[float, float, float]:
    """Return a rotation matrix as URDF's angles about the fixed axes x, y, z, radians."""
    pitch = np.arctan2(-m[2, 0], np.hypot(m[0, 0], m[1, 0]))
    # At a pitch of 90 degrees only the sum of roll and yaw is defined (gimbal lock): yaw is set to 0.
    if np.hypot(m[0, 0], m[1, 0]) < 1e-6:
        return float(np.arctan2(-m[1, 2], m[1, 1])), float(pitch), 0.0
    return float(np.arctan2(m[2, 1], m[2, 2])), float(pitch), float(np.arctan2(m[1, 0], m[0, 0]))


def _text(numbers: Iterable[float]) -> str:
    return " ".join(f"{number:.9g}" for number in numbers)
