"""The half-second chunks that the motion model learns from (paper, section 3.3).

A chunk is 5 history and 15 future frames in the canonical frame of its history, with the skill parameters that it
achieves. Needs only numpy.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import Motion
from humanclaw.body import (
    CHUNK,
    HISTORY,
    N_JOINTS,
    Array,
    forward_kinematics,
    heading,
    matrix_from_vector,
    mirrored,
    support_height,
    vector_from_matrix,
    yaw_matrix,
)
from humanclaw.skills import MEASURES, Measure, Parameter, outcomes
from humanclaw.storage import write_atomically
from humanclaw_train.mocap.source_motion import UNREADABLE, MocapError

CHUNKS: Final = Path(".data/chunks")
"""Default folder of chunks."""


def stacked(motions: Sequence[Motion]) -> tuple[Array, Array]:
    """Return the root (N, T, 3) and rotations (N, T, 24, 3) of motions of one length."""
    root, rotations = (np.stack([getattr(motion, part) for motion in motions]) for part in ("root", "rotations"))
    return root, rotations


def canonical(root: Array, rotations: Array) -> tuple[Array, Array]:
    """Move chunks, root (N, 20, 3) and rotations (N, 20, 24, 3), to the canonical frames of their histories."""
    history = forward_kinematics(root[:, :HISTORY], rotations[:, :HISTORY])[0]
    return _canonical(root, rotations, support_height(history).min(axis=1))


def _canonical(root: Array, rotations: Array, floor: Array) -> tuple[Array, Array]:
    origin = np.stack([root[:, HISTORY - 1, 0], floor, root[:, HISTORY - 1, 2]], -1)
    turn = yaw_matrix(-heading(rotations[:, HISTORY - 1, 0]))
    # Only the pelvis turns: all other rotations are relative to their parents.
    turned = rotations.copy()
    turned[:, :, 0] = vector_from_matrix(turn[:, None] @ matrix_from_vector(rotations[:, :, 0]))
    return np.einsum("nij,ntj->nti", turn, root - origin[:, None]), turned


def cut(motion: Motion, starts: NDArray[np.int_]) -> tuple[Array, Array]:
    """Cut the chunks that begin at frames `starts` (N,): canonical root (N, 20, 3) and rotations (N, 20, 24, 3)."""
    frames = np.asarray(starts, int)[:, None] + np.arange(CHUNK)
    # Windows overlap, so the heights of the soles are computed once for the whole motion.
    support = support_height(motion.joints())
    return _canonical(motion.root[frames], motion.rotations[frames], support[frames[:, :HISTORY]].min(axis=1))


@dataclass(frozen=True)
class Chunks:
    """N canonical chunks of one skill. Metres, radians. Raises ValueError for wrong shapes.

    root (N, 20, 3) and rotations (N, 20, 24, 3) float32; params (N, k) float32; real (N,) bool, False for synthetic
    motion; source (N,) text, the clip of each. names, measures (k,) text: of the parameters.
    licences: "SOURCE: LICENCE" of the clips.
    """

    root: NDArray[np.float32]
    rotations: NDArray[np.float32]
    params: NDArray[np.float32]
    real: NDArray[np.bool_]
    source: NDArray[np.str_]
    names: NDArray[np.str_]
    measures: NDArray[np.str_]
    licences: NDArray[np.str_] = field(default_factory=lambda: np.array([], np.str_))

    def __post_init__(self) -> None:
        n = len(self.root)
        shapes = (self.root.shape, self.rotations.shape, self.params.shape[:1], self.real.shape, self.source.shape)
        if shapes != ((n, CHUNK, 3), (n, CHUNK, N_JOINTS, 3), (n,), (n,), (n,)) or self.params.ndim != 2:
            raise ValueError(
                "expected root (N, 20, 3), rotations (N, 20, 24, 3), params (N, k), real (N,), source (N,); got "
                f"{shapes}"
            )
        if not len(self.names) == len(self.measures) == self.params.shape[1]:
            raise ValueError(f"expected names and measures of {self.params.shape[1]} parameters; got {self.names}")

    @classmethod
    def of(
        cls,
        parameters: Sequence[Parameter],
        root: Array,
        rotations: Array,
        source: str,
        real: bool,
        known: Mapping[str, Measure] = MEASURES,
    ) -> Chunks:
        """Make canonical chunks with the parameters that they achieve."""
        n = len(root)
        params = outcomes(parameters, root, rotations, known).astype(np.float32)
        names, measures = (
            np.array([getattr(parameter, what) for parameter in parameters], np.str_) for what in ("name", "measure")
        )
        return cls(
            root.astype(np.float32), rotations.astype(np.float32), params, np.full(n, real), np.full(n, source),
            names, measures,
        )  # fmt: skip

    @classmethod
    def join(cls, parts: Iterable[Chunks]) -> Chunks:
        """Join parts in order. There must be at least one part, and all must be of one skill."""
        every = list(parts)
        whole = {name: np.concatenate([getattr(part, name) for part in every]) for name in _EACH}
        return replace(every[0], **whole)

    @classmethod
    def load(cls, path: Path) -> Chunks:
        """Read a file that `save` wrote. Raises MocapError if it is missing or has other content."""
        try:
            with np.load(path, allow_pickle=False) as data:
                there = [part.name for part in fields(cls) if part.name in data or part.name != "licences"]
                chunks = cls(**{name: data[name] for name in there})
            if not len(chunks):
                raise ValueError("an empty table")
            if not all(np.isfinite(part).all() for part in (chunks.root, chunks.rotations, chunks.params)):
                raise ValueError("a number that is not finite")
            return chunks
        except UNREADABLE as error:
            raise MocapError(
                f"{path} holds no chunks: {error}.", "Build chunks with: humanclaw data build DIR"
            ) from error

    def __len__(self) -> int:
        return len(self.root)

    def __getitem__(self, which: slice | NDArray[np.int_] | NDArray[np.bool_]) -> Chunks:
        return replace(self, **{name: getattr(self, name)[which] for name in _EACH})

    def motion(self, index: int) -> Motion:
        """Return one chunk as a motion in its canonical frame."""
        return Motion(self.root[index].astype(float), self.rotations[index].astype(float))

    def mirrored(self, known: Mapping[str, Measure] = MEASURES) -> Chunks:
        """Mirror the chunks, which then are not real."""
        root, rotations = mirrored(self.root, self.rotations)
        params = self.params.copy()
        for column, measure in enumerate(self.measures.tolist()):
            if sign := known[measure].mirror:
                params[:, column] *= sign
            else:
                params[:, column] = known[measure](root.astype(float), rotations.astype(float))
        return replace(self, root=root, rotations=rotations, params=params, real=np.zeros_like(self.real))

    def save(self, path: Path) -> None:
        """Write one npz. An interrupted save leaves the old file in place."""
        path.parent.mkdir(parents=True, exist_ok=True)
        content = io.BytesIO()
        np.savez_compressed(content, **{part.name: getattr(self, part.name) for part in fields(self)})
        write_atomically(path, content.getvalue())


_EACH: Final = ("root", "rotations", "params", "real", "source")
"""Fields of Chunks with one entry per chunk."""


def of_skill(folders: Sequence[Path], skill: str) -> Chunks | None:
    """Load the real chunks of a skill, or its synthetic chunks if it has no real ones. None without a file."""
    files = [folder / f"{skill}.npz" for folder in folders if (folder / f"{skill}.npz").is_file()]
    if not files:
        return None
    chunks = Chunks.join(Chunks.load(file) for file in files)
    return chunks[chunks.real] if chunks.real.any() else chunks
