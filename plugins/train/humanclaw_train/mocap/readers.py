"""Readers of motion capture: ASF/AMC, BVH, AMASS npz and the humanoid3d text format of DeepMimic.

Each returns a SourceMotion: world positions and orientations of the source's own joints, and a reference pose.
retarget.py maps them to our body. Needs only numpy.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from humanclaw.body import JOINTS, OFFSETS, PARENTS, matrix_from_quaternion, matrix_from_vector
from humanclaw_train.mocap.asf import load_amc
from humanclaw_train.mocap.bvh import load_bvh
from humanclaw_train.mocap.source_motion import AXES, UNREADABLE, MocapError, SourceMotion, Tree, read_text
from humanclaw_train.mocap.up_axis import Up, stood_up
from humanclaw_train.mocap.world_pose import swing


@dataclass(frozen=True)
class Reading:
    """What a file does not say, or says wrong."""

    up: Up | None = None
    """The axis that points up; None to find it from head, feet and floor."""
    fps: float | None = None
    """Frames a second; None for what the file says."""
    joints: tuple[tuple[str, str], ...] = ()
    """Pairs of our names of joints (humanclaw.body.JOINTS) and theirs, for skeletons of no known convention."""


AS_WRITTEN: Final = Reading()


def load(path: Path, reading: Reading = AS_WRITTEN) -> SourceMotion:
    """Read one motion capture file by its suffix: .bvh, .amc (its .asf beside it), .npz (AMASS) or .txt (humanoid3d).

    Returns it with Y up. Raises MocapError.
    """
    suffix = path.suffix.lower()
    if suffix not in _READERS:
        raise MocapError(f"{path} has an unknown suffix.", "Give a .bvh, .amc, .npz (AMASS) or .txt (humanoid3d) file.")
    return stood_up(replace(_READERS[suffix](path, reading.fps), naming=reading.joints), reading.up)


# -- AMASS -------------------------------------------------------------------------------------------------------------
_FAR: Final = 40.0
"""Metres from 0 at which no capture begins; in centimetres, the pelvis of who sits is higher."""

_WIDTHS: Final = (66, 72, 156, 165)
"""Columns of `poses`: SMPL's body, with hands, SMPL+H, SMPL-X. Quaternions and 6D rotations have others."""
_SLOWEST: Final = 5.0
"""Fewest frames a second: less is the time of a frame."""
_RATES: Final = ("mocap_framerate", "mocap_frame_rate", "fps", "frame_rate")


def load_amass(path: Path, fps: float | None = None) -> SourceMotion:
    """Read an AMASS npz (`poses`, `trans`, `mocap_framerate`). fps: frames a second in place of what it says.

    Bones get our own lengths, because a subject's lengths need SMPL files, which this package does not have.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            poses, trans = np.asarray(data["poses"], float), np.asarray(data["trans"], float)
            fps = fps or next((float(np.squeeze(data[key])) for key in _RATES if key in data), 0.0)
    except (*UNREADABLE, TypeError) as error:
        raise MocapError(
            f"{path} is no AMASS motion: {error}.", "Give an npz with poses, trans and mocap_framerate."
        ) from error
    if poses.ndim != 2 or poses.shape[1] not in _WIDTHS or trans.shape != (len(poses), 3):
        raise MocapError(
            f"{path}: expected poses (T, 66, 72, 156 or 165) and trans (T, 3); got {poses.shape} and {trans.shape}.",
            "Write three numbers a joint: its rotation about an axis, in radians.",
        )
    if fps < _SLOWEST:
        raise MocapError(f"{path}: expected frames a second as mocap_framerate; got {fps:g}.", "Give them: --fps 30.")
    if (away := float(np.linalg.norm(trans[:1]))) > _FAR:
        raise MocapError(
            f"{path}: expected trans in metres; it begins {away:.0f} from 0.", "Divide it by 100 if it is centimetres."
        )
    local = np.tile(np.eye(3), (len(poses), len(JOINTS), 1, 1))
    # SMPL has 22 body joints; fingers and face follow.
    local[:, :22] = matrix_from_vector(poses[:, :66].reshape(-1, 22, 3))
    # Files of the format have Z up, and our skeleton Y.
    return Tree(JOINTS, PARENTS, OFFSETS).motion(path, fps, trans, local).turned(np.eye(3), swing(AXES["y"], AXES["z"]))


# -- humanoid3d --------------------------------------------------------------------------------------------------------
_HUMANOID3D: Final = (
    ("root", -1, (0.0, 0.0, 0.0)), ("chest", 0, (0.0, 0.236151, 0.0)), ("neck", 1, (0.0, 0.223894, 0.0)),
    ("right_hip", 0, (0.0, 0.0, 0.084887)), ("right_knee", 3, (0.0, -0.421546, 0.0)),
    ("right_ankle", 4, (0.0, -0.40987, 0.0)), ("right_shoulder", 1, (-0.02405, 0.2435, 0.18311)),
    ("right_elbow", 6, (0.0, -0.274788, 0.0)),
    ("left_hip", 0, (0.0, 0.0, -0.084887)), ("left_knee", 8, (0.0, -0.421546, 0.0)),
    ("left_ankle", 9, (0.0, -0.40987, 0.0)), ("left_shoulder", 1, (-0.02405, 0.2435, -0.18311)),
    ("left_elbow", 11, (0.0, -0.274788, 0.0)),
    ("right_toe", 5, (0.13, -0.055, 0.0)), ("left_toe", 10, (0.13, -0.055, 0.0)),
    ("right_wrist", 7, (0.0, -0.258947, 0.0)), ("left_wrist", 12, (0.0, -0.258947, 0.0)),
)  # fmt: skip
_HUMANOID3D_HINGES: Final = ("right_knee", "right_elbow", "left_knee", "left_elbow")


def load_humanoid3d(path: Path, fps: float | None = None) -> SourceMotion:
    """Read a DeepMimic humanoid3d text file. fps: frames a second in place of what it says.

    It is JSON with rows of 44 numbers: seconds, root, then quaternions (w, x, y, z) and hinge angles.
    """
    try:
        rows = np.array(json.loads(read_text(path))["Frames"], float)
    except (ValueError, KeyError, TypeError) as error:
        raise MocapError(
            f"{path}: expected JSON with `Frames`, rows of 44 numbers.", "Give a humanoid3d file."
        ) from error
    # 1 for seconds, 3 for the root, 4 for each of nine joints, 1 for each of four hinges.
    if rows.ndim != 2 or rows.shape[1] != 44:
        raise MocapError(f"{path}: expected `Frames` as rows of 44 numbers; got shape {rows.shape}.")
    joints, parents, offsets = zip(*_HUMANOID3D, strict=True)
    tree = Tree(joints, parents, np.array(offsets))
    local = np.tile(np.eye(3), (len(rows), len(tree.joints), 1, 1))
    column = 4
    # Toes and wrists come after the 13 that the format turns.
    for joint, name in enumerate(tree.joints[:13]):
        if name in _HUMANOID3D_HINGES:
            local[:, joint] = matrix_from_vector(rows[:, column, None] * AXES["z"])
            column += 1
        else:
            local[:, joint] = matrix_from_quaternion(rows[:, [column + 1, column + 2, column + 3, column]])
            column += 4
    # The format faces +X with its right at +Z. Turn it about the vertical: +Z forward, +X left.
    turn = matrix_from_vector(np.array([0.0, -np.pi / 2, 0.0]))
    fps = fps or float(round(1.0 / float(np.median(rows[:-1, 0])), 1))
    return tree.motion(path, fps, rows[:, 1:4], local).turned(turn, turn)


_READERS: Final[Mapping[str, Callable[[Path, float | None], SourceMotion]]] = {
    ".bvh": load_bvh,
    ".amc": load_amc,
    ".npz": load_amass,
    ".txt": load_humanoid3d,
}
