"""Forward kinematics and the 219-number state on torch tensors: the differentiable counterpart of humanclaw.body."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import torch
from torch import Tensor

from humanclaw.body import JOINT_INDEX, N_JOINTS, OFFSETS, PARENTS, SOLE, STATE_SIZE, TOE_SOLE

ROOT: Final = slice(0, 3)
ROTATIONS: Final = slice(3, 3 + 3 * N_JOINTS)
POSITIONS: Final = slice(ROTATIONS.stop, ROTATIONS.stop + 3 * N_JOINTS)
VELOCITIES: Final = slice(POSITIONS.stop, STATE_SIZE)
"""Where the parts of a state of 219 numbers lie."""

FEET: Final = tuple(JOINT_INDEX[name] for name in ("left_ankle", "right_ankle", "left_foot", "right_foot"))
_SOLES: Final = (SOLE, SOLE, TOE_SOLE, TOE_SOLE)


def _levels() -> Iterator[tuple[slice, list[int]]]:
    """Yield the joints as far from the root as one another, which are computed together, and their parents."""
    parents = [0]
    while joints := [joint for joint in range(1, N_JOINTS) if PARENTS[joint] in parents]:
        yield slice(joints[0], joints[-1] + 1), [PARENTS[joint] for joint in joints]
        parents = joints


_LEVELS: Final = tuple(_levels())


def matrices(vectors: Tensor) -> Tensor:
    """Turn rotation vectors (..., 3) into matrices (..., 3, 3). The gradient is finite at zero."""
    square = (vectors * vectors).sum(-1) + 1e-12  # The square root has no gradient at zero.
    angle = square.sqrt()
    sin = (angle.sin() / angle)[..., None]
    cos = ((1 - angle.cos()) / square)[..., None]
    x, y, z = (sin * vectors).unbind(-1)
    outer = cos[..., None] * vectors[..., :, None] * vectors[..., None, :]
    c = angle.cos()
    rows = torch.stack([c, -z, y, z, c, -x, -y, x, c], -1)
    return outer + rows.reshape(outer.shape)


def joints(root: Tensor, rotations: Tensor) -> Tensor:
    """Compute joint positions (..., 24, 3) from root positions (..., 3) and local rotations (..., 24, 3)."""
    offsets = torch.as_tensor(OFFSETS, dtype=root.dtype, device=root.device)[..., None]
    local = matrices(rotations)
    positions, turns = root[..., None, :], local[..., :1, :, :]
    for level, parents in _LEVELS:
        # No list as an index: it is copied to the device each time, and a GPU waits for the copy.
        turn = torch.cat([turns[..., joint : joint + 1, :, :] for joint in parents], -3)
        start = torch.cat([positions[..., joint : joint + 1, :] for joint in parents], -2)
        positions = torch.cat([positions, start + (turn @ offsets[level])[..., 0]], -2)
        turns = torch.cat([turns, turn @ local[..., level, :, :]], -3)
    return positions


def support_height(positions: Tensor) -> Tensor:
    """Return the height of the lowest sole, metres, for joint positions (..., 24, 3)."""
    soles = torch.tensor(_SOLES, device=positions.device)
    return (positions[..., list(FEET), 1] - soles).amin(-1)


def encode(root: Tensor, rotations: Tensor) -> Tensor:
    """Encode (B, T, 3) and (B, T, 24, 3) as states (B, T, 219), like humanclaw.body.encode."""
    positions = joints(root, rotations)
    steps = positions.diff(dim=1)
    velocity = torch.cat([steps[:, :1], steps], 1)
    return torch.cat([root, rotations.flatten(2), positions.flatten(2), velocity.flatten(2)], -1)
