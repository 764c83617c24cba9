"""Forward kinematics and the 219-number state on batches of torch tensors: the differentiable twin of
humanclaw.pose."""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor

from humanclaw.body import JOINT_INDEX, N_JOINTS, OFFSETS, PARENTS, SOLE, STATE_SIZE, TOE_SOLE

ROOT: Final = slice(0, 3)
ROTATIONS: Final = slice(3, 3 + 3 * N_JOINTS)
POSITIONS: Final = slice(ROTATIONS.stop, ROTATIONS.stop + 3 * N_JOINTS)
VELOCITIES: Final = slice(POSITIONS.stop, STATE_SIZE)

FEET: Final = tuple(JOINT_INDEX[name] for name in ("left_ankle", "right_ankle", "left_foot", "right_foot"))
_SOLES: Final = (SOLE, SOLE, TOE_SOLE, TOE_SOLE)


def _levels() -> tuple[tuple[int, ...], ...]:
    """Joints by their distance from the root: those of one level are turned together."""
    depth = [0] * N_JOINTS
    for joint in range(1, N_JOINTS):
        depth[joint] = depth[PARENTS[joint]] + 1
    return tuple(tuple(j for j in range(N_JOINTS) if depth[j] == level) for level in range(1, max(depth) + 1))


_LEVELS: Final = _levels()
_ORDER: Final = (0, *(joint for level in _LEVELS for joint in level))
_PLACE: Final = {joint: place for place, joint in enumerate(_ORDER)}
_BACK: Final = tuple(_PLACE[joint] for joint in range(N_JOINTS))


def matrices(vectors: Tensor) -> Tensor:
    """(..., 3) rotation vectors to (..., 3, 3) matrices. Smooth at zero, so that its gradient is too."""
    square = (vectors * vectors).sum(-1) + 1e-12
    angle = square.sqrt()
    sin = (angle.sin() / angle)[..., None]
    cos = ((1 - angle.cos()) / square)[..., None]
    x, y, z = (sin * vectors).unbind(-1)
    outer = cos[..., None] * vectors[..., :, None] * vectors[..., None, :]
    c = angle.cos()
    rows = torch.stack([c, -z, y, z, c, -x, -y, x, c], -1)
    return outer + rows.reshape(outer.shape)


def joints(root: Tensor, rotations: Tensor) -> Tensor:
    """(..., 3) root positions and (..., 24, 3) local rotations to (..., 24, 3) joint positions."""
    offsets = torch.as_tensor(OFFSETS, dtype=root.dtype, device=root.device)
    local = matrices(rotations)
    positions, turns = root[..., None, :], local[..., :1, :, :]
    for level in _LEVELS:
        parents = [_PLACE[PARENTS[joint]] for joint in level]
        turn = turns[..., parents, :, :]
        moved = positions[..., parents, :] + (turn @ offsets[list(level), :, None])[..., 0]
        positions = torch.cat([positions, moved], -2)
        turns = torch.cat([turns, turn @ local[..., list(level), :, :]], -3)
    return positions[..., list(_BACK), :]


def support_height(positions: Tensor) -> Tensor:
    """(..., 24, 3) joint positions to the height of the lowest sole, metres."""
    soles = torch.tensor(_SOLES, device=positions.device)
    return (positions[..., list(FEET), 1] - soles).amin(-1)


def encode(root: Tensor, rotations: Tensor) -> Tensor:
    """(B, T, 3) and (B, T, 24, 3) to (B, T, 219), as pose.encode."""
    positions = joints(root, rotations)
    steps = positions.diff(dim=1)
    velocity = torch.cat([steps[:, :1], steps], 1)
    return torch.cat([root, rotations.flatten(2), positions.flatten(2), velocity.flatten(2)], -1)
