"""Captured motion on its own skeleton, as every reader of motion capture returns it. Needs only numpy."""

from __future__ import annotations

from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from humanclaw import HumanclawError
from humanclaw.body import Array, matrix_from_vector
from humanclaw.storage import DAMAGED

UNREADABLE: Final = (*DAMAGED, KeyError, ValueError)
"""Errors of numpy for an npz that is missing, empty, cut off, or has other content."""
AXES: Final = {axis: np.eye(3)["xyz".index(axis)] for axis in "xyz"}


class MocapError(HumanclawError):
    """A motion capture file is missing, broken or of an unknown format."""


@dataclass(frozen=True)
class Rest:
    """Reference pose that orientations are measured from: positions (J, 3), rotations (J, 3, 3), world frame."""

    positions: Array
    rotations: Array


@dataclass(frozen=True)
class SourceMotion:
    """Captured motion on the source's own skeleton, in its own unit of length.

    positions: (T, J, 3) world; rotations: (T, J, 3, 3) world; parents: (J,), -1 at the root, always before their
    children. Raises MocapError for wrong shapes, no frames, or numbers that are not finite.
    """

    fps: float
    joints: tuple[str, ...]
    parents: tuple[int, ...]
    positions: Array
    rotations: Array
    rest: Rest
    source: str = ""
    """File that it was read from."""
    naming: tuple[tuple[str, str], ...] = ()
    """Pairs of our names of joints (humanclaw.body.JOINTS) and theirs, for skeletons of no known convention."""
    note: str = ""
    """What its reader assumed."""

    def __post_init__(self) -> None:
        frames, count = len(self.positions), len(self.joints)
        if frames == 0 or not self.fps > 0:
            raise MocapError(
                f"Expected frames and a positive rate; {self.source or 'this motion'} has {frames} frames at "
                f"{self.fps} fps.",
                "Check that the file is complete.",
            )
        if self.positions.shape != (frames, count, 3) or self.rotations.shape != (frames, count, 3, 3):
            raise MocapError(
                f"{count} joints need positions (T, {count}, 3) and rotations (T, {count}, 3, 3); "
                f"got {self.positions.shape} and {self.rotations.shape}."
            )
        if not (np.isfinite(self.positions).all() and np.isfinite(self.rotations).all()):
            raise MocapError(
                f"{self.source or 'this motion'} contains numbers that are not finite.", "Correct them or cut them out."
            )

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, frames: slice) -> SourceMotion:
        return replace(self, positions=self.positions[frames], rotations=self.rotations[frames])

    def turned(self, motion: Array, rest: Array) -> SourceMotion:
        """Return the same with its motion and its reference pose turned by (3, 3) rotations of the world."""
        reference = Rest(self.rest.positions @ rest.T, rest @ self.rest.rotations)
        return replace(self, positions=self.positions @ motion.T, rotations=motion @ self.rotations, rest=reference)

    def with_reference_frame(self, frame: int) -> SourceMotion:
        """Return the same motion with one of its frames as reference pose, for files whose zero pose is unnatural."""
        return replace(self, rest=Rest(self.positions[frame], self.rotations[frame]))


@dataclass(frozen=True)
class Tree:
    """A skeleton at zero angles: offset of each joint in its parent's frame."""

    joints: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: Array

    def motion(self, path: Path, fps: float, root: Array, local: Array, offsets: Array | None = None) -> SourceMotion:
        """Return the motion of root positions (T, 3) and local rotations (T, J, 3, 3) that a file holds, with the pose
        at zero angles as its reference.

        offsets: (T, J, 3) in place of the skeleton's own.
        """
        none = np.tile(np.eye(3), (1, len(self.joints), 1, 1))
        rest = Rest(*(part[0] for part in self._posed(np.zeros((1, 3)), none)))
        return SourceMotion(fps, self.joints, self.parents, *self._posed(root, local, offsets), rest, str(path))

    def _posed(self, root: Array, local: Array, offsets: Array | None = None) -> tuple[Array, Array]:
        """Return world positions and rotations."""
        shifts = np.broadcast_to(self.offsets, (*root.shape[:1], *self.offsets.shape)) if offsets is None else offsets
        positions, rotations = np.empty((*local.shape[:2], 3)), np.empty(local.shape)
        for joint, parent in enumerate(self.parents):
            if parent < 0:
                positions[:, joint], rotations[:, joint] = root, local[:, joint]
                continue
            positions[:, joint] = positions[:, parent] + (rotations[:, parent] @ shifts[:, joint, :, None])[..., 0]
            rotations[:, joint] = rotations[:, parent] @ local[:, joint]
        return positions, rotations


def read_text(path: Path) -> str:
    """Read a text file, in UTF-8 or UTF-16. Raises MocapError if that fails."""
    try:
        data = path.read_bytes()
        return data.decode("utf-16" if data[:2] in (BOM_UTF16_LE, BOM_UTF16_BE) else "utf-8-sig", errors="replace")
    except OSError as error:
        raise MocapError(f"{path} cannot be read: {error.strerror}.", "Check the path.") from error


def euler(order: Sequence[str], degrees: Array) -> Array:
    """Turn angles (..., n) about the named axes, multiplied from left to right, into (..., 3, 3) matrices."""
    matrix = np.broadcast_to(np.eye(3), (*degrees.shape[:-1], 3, 3))
    for index, axis in enumerate(order):
        matrix = matrix @ matrix_from_vector(np.radians(degrees[..., index, None]) * AXES[axis])
    return np.asarray(matrix)
