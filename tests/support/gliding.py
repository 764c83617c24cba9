"""Artificial chunks for training tests: gliding bodies, commanded by the distance that they cover."""

from pathlib import Path

import numpy as np

from humanclaw.body import rest_pose


def gliding(distance: np.ndarray, moving: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Return chunks that cover a distance (metres) evenly while nodding, from standing or already moving."""
    rest = rest_pose(20)
    ahead = (np.arange(20) - 4) / 15
    ahead = ahead if moving else ahead.clip(0)
    root = np.repeat(rest.root[None], len(distance), 0)
    root[:, :, 2] = distance[:, None] * ahead
    rotations = np.repeat(rest.rotations[None], len(distance), 0)
    rotations[:, :, 15, 0] = 0.2 * ahead
    return root, rotations


def save_chunks(path: Path, distance: np.ndarray, params: np.ndarray, moving: bool = False) -> None:
    """Write such chunks; every fourth is real."""
    path.parent.mkdir(parents=True, exist_ok=True)
    names, measures = (np.array(text[: params.shape[1]], np.str_) for text in (["z"], ["hips.back"]))
    root, rotations = gliding(distance, moving)
    real = np.arange(len(distance)) % 4 == 0
    source = np.array(["a studio: clip"] * len(distance))
    content = {"root": root, "rotations": rotations, "params": params, "names": names, "measures": measures}
    np.savez(path, **content, real=real, source=source)
