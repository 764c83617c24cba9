"""Chunks as tensors: reading them, spoiling their histories, and bringing them to the state that the model sees.

A chunk folder holds one `NAME.npz` a skill, and `base.npz` for the prior, each with root (N, 20, 3) and rotations (N,
20, 24, 3) in the chunk's canonical frame, params (N, k) in SI, real (N,) and source (N,).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor

from humanclaw import HumanclawError
from humanclaw.body import JOINT_INDEX
from humanclaw.pose import CHUNK, FPS, HISTORY, STATE_SIZE
from humanclaw_train import kinematics
from humanclaw_train.checkpoint import Normaliser
from humanclaw_train.chunks import EACH

# The least deviation by which a number is divided: a joint that hardly moves must not have its noise blown up.
_LEAST_STD: Final = (0.02, 0.05, 0.02, 0.005)
_SETTLED: Final = 10
"""Frames after which a noisy history is forgotten."""


@dataclass(frozen=True)
class ChunkTensors:
    """root: (N, 20, 3). rotations: (N, 20, 24, 3). params: (N, k) in SI. All float32 on one device."""

    name: str
    root: Tensor
    rotations: Tensor
    params: Tensor
    statistics: dict[str, Any]
    names: tuple[str, ...] = ()
    """Of the parameters (k,),"""
    measures: tuple[str, ...] = ()
    """and what they command."""

    def __len__(self) -> int:
        return len(self.root)

    def to(self, device: torch.device) -> ChunkTensors:
        """Return the same chunks on another device."""
        moved = (self.root.to(device), self.rotations.to(device), self.params.to(device))
        return replace(self, root=moved[0], rotations=moved[1], params=moved[2])


def load(folders: Sequence[Path], name: str) -> ChunkTensors:
    """All chunks of one skill, or of `base`, from every folder that has some; what is real once, since folders that
    were drawn by other seeds hold the same clips.

    Raises HumanclawError when no folder has any.
    """
    files = [folder / f"{name}.npz" for folder in folders if (folder / f"{name}.npz").is_file()]
    if not files:
        listed = ", ".join(map(str, folders))
        raise HumanclawError(f"There is no {name}.npz in {listed}.", "Make chunks first with: humanclaw data build DIR")
    parts = [_read(file) for file in files]
    kept = np.concatenate(list(_new(parts)))
    whole = {key: np.concatenate([part[key] for part in parts])[kept] for key in EACH}
    root, rotations, params = (torch.from_numpy(whole[key].astype(np.float32)) for key in EACH[:3])
    names, measures = (tuple(parts[0][key].tolist()) for key in ("names", "measures"))
    return ChunkTensors(name, root, rotations, params, _statistics(whole), names, measures)


def _new(parts: Sequence[Mapping[str, np.ndarray[Any, Any]]]) -> Iterator[np.ndarray[Any, Any]]:
    """Yield for each part which of its chunks (N,) are no real ones of a part before."""
    before = set[bytes]()
    for part in parts:
        told = [root.tobytes() + turns.tobytes() for root, turns in zip(part["root"], part["rotations"], strict=True)]
        yield np.array([not real or one not in before for real, one in zip(part["real"], told, strict=True)])
        before |= set(told)


def _read(file: Path) -> dict[str, np.ndarray[Any, Any]]:
    with np.load(file, allow_pickle=False) as content:
        found = {key: content[key] for key in (*EACH, "names", "measures")}
    if found["root"].shape[1:] != (CHUNK, 3):
        raise HumanclawError(f"{file} holds root {found['root'].shape}, not (N, {CHUNK}, 3).", "Make the chunks again.")
    return found


def _statistics(whole: Mapping[str, np.ndarray[Any, Any]]) -> dict[str, Any]:
    params, sources = whole["params"], Counter(str(source).split(":")[0] for source in whole["source"])
    return {
        "chunks": len(whole["real"]),
        "real": int(whole["real"].sum()),
        "sources": dict(sorted(sources.items())),
        "params_low": [round(float(value), 4) for value in params.min(0)] if params.size else [],
        "params_high": [round(float(value), 4) for value in params.max(0)] if params.size else [],
    }


def normaliser(chunks: ChunkTensors) -> Normaliser:
    """Mean and deviation of each of the 219 numbers over these chunks."""
    states = kinematics.encode(chunks.root, chunks.rotations).reshape(-1, STATE_SIZE)
    std = states.std(0)
    blocks = (kinematics.ROOT, kinematics.ROTATIONS, kinematics.POSITIONS, kinematics.VELOCITIES)
    for block, least in zip(blocks, _LEAST_STD, strict=True):
        std[block] = std[block].clamp(min=least)
    return Normaliser(states.mean(0), std)


def standing(chunks: ChunkTensors) -> tuple[Tensor, Tensor]:
    """Of chunks that stand, the history that moves least and stands most typically: root (5, 3), rotations (5, 24,
    3)."""
    root, rotations = chunks.root[:, :HISTORY], chunks.rotations[:, :HISTORY]
    positions = kinematics.joints(root, rotations)
    moving = positions.diff(dim=1).norm(dim=-1).mean((1, 2)) + (chunks.root[:, -1] - chunks.root[:, 0]).norm(dim=-1)
    upright = positions[:, -1, 15, 1]
    calm = moving <= moving.quantile(0.1)
    still = calm & (upright > upright[calm].quantile(0.5) - 0.05)
    typical = positions[still, -1].median(0).values
    far = (positions[:, -1] - typical).norm(dim=-1).mean(-1)
    usual_far, usual_moving = (values[still].median().clamp(min=1e-6) for values in (far, moving))
    best = int((far / usual_far + moving / usual_moving + 1e3 * ~still).argmin())
    return root[best], rotations[best]


_HIPS: Final = (JOINT_INDEX["left_hip"], JOINT_INDEX["right_hip"])


_BRISK: Final = 0.5
"""m/s: who moves so fast has errors of full strength."""


def _pace(root: Tensor) -> Tensor:
    """(B,) m/s over the floor in the history of root (B, 20, 3)."""
    way: Tensor = (root[:, HISTORY - 1] - root[:, 0])[:, [0, 2]].norm(dim=-1)
    return way * FPS / (HISTORY - 1)


def noisy_history(
    root: Tensor, rotations: Tensor, generator: torch.Generator, strength: float = 1.0
) -> tuple[Tensor, Tensor]:
    """Chunks whose histories are off, as those are that the model wrote itself, and whose futures find back.

    Each chunk gets its own share of: a pose offset, a drift that comes to a stop at the last history frame, and jitter;
    and another share of a lean over legs that stay as they are. People lean in ways of their own, and go on doing so;
    were that all, a body would keep what its own errors made it lean.
    A strength over 1 is for those who move: standing is what a model's errors do least to, and were the feet of who
    stands off by more, none could tell which of them sets out.
    The future starts where the noisy history ends and returns to the clean one within ten frames, so that what is
    learned is a smooth recovery and never a jump. The lowest sole of the history stays at height 0, as the canonical
    frame demands.
    """
    device = root.device
    strengths = 1 + (strength - 1) * (_pace(root) / _BRISK).clamp(max=1)[:, None, None] if strength > 1 else strength
    share = strengths * torch.rand(len(root), 1, 1, generator=generator, device=device) ** 2
    pose, drift, history = (curve.to(device)[None, :, None] for curve in _curves())

    def normal(*shape: int) -> Tensor:
        return torch.randn(len(root), *shape, generator=generator, device=device)

    width = rotations.shape[2] * 3
    offset = 0.08 * normal(1, width) * pose
    offset[..., 1] = 0  # the heading of the last history frame is 0 by definition
    turned = share * (offset + 0.08 * normal(1, width) * drift + 0.003 * normal(CHUNK, width) * history)
    lean = 0.08 * strengths * torch.rand(len(root), 1, 1, generator=generator, device=device) * normal(1, 2) * pose
    turned[..., [0, 2]] += lean
    for hip in _HIPS:  # The legs stay as they are.
        turned[..., [3 * hip, 3 * hip + 2]] -= lean
    rotations = rotations + turned.reshape(rotations.shape)
    moved = torch.tensor([0.03, 0.01, 0.03], device=device) * normal(1, 3) * drift + 0.001 * normal(CHUNK, 3) * history
    moved[:, HISTORY - 1] = 0
    root = root + share * moved
    lowest = kinematics.support_height(kinematics.joints(root[:, :HISTORY], rotations[:, :HISTORY])).amin(-1)
    return root - lowest[:, None, None] * pose * torch.tensor([0.0, 1.0, 0.0], device=device), rotations


_FROM_HISTORY: Final = {"hips.rise": 1.0, "hips.drop": -1.0}
"""Measures that are told from where the history has the pelvis, and the sign of a rise in them."""


def commanded(measures: Sequence[str], params: Tensor, clean: Tensor, root: Tensor) -> Tensor:
    """(B, k) parameters of chunks after their histories got noise; root (B, 20, 3) before (clean) and after.

    Where a body ends is as it was; only a rise is measured from where the noisy history now has the pelvis.
    """
    lifted = root[:, HISTORY - 1, 1] - clean[:, HISTORY - 1, 1]
    signs = torch.tensor([_FROM_HISTORY.get(one, 0.0) for one in measures], device=params.device)
    return params - signs * lifted[:, None]


def _curves() -> tuple[Tensor, Tensor, Tensor]:
    """Over the 20 frames: a held offset that fades, a drift through the last history frame, and 1 on the history
    alone."""
    frame = torch.arange(CHUNK) - (HISTORY - 1.0)
    pose = 0.5 + 0.5 * torch.cos(torch.pi * (frame / _SETTLED).clamp(0, 1))
    drift = frame / HISTORY * torch.exp(-frame.clamp(min=0) / 2)
    return pose, drift, (frame <= 0).float()


def load_all(folders: Sequence[Path]) -> ChunkTensors:
    """Every chunk of every file: what the prior learns from. Parameters are left out.

    Raises HumanclawError when the folders hold none.
    """
    names = sorted({file.stem for folder in folders for file in folder.glob("*.npz")})
    if not names:
        raise HumanclawError(f"There are no chunks in {', '.join(map(str, folders))}.", "Make chunks first.")
    parts = [load(folders, name) for name in names]
    root = torch.cat([part.root for part in parts])
    sources = sum((Counter(part.statistics["sources"]) for part in parts), Counter())
    statistics = {
        "chunks": len(root),
        "real": sum(part.statistics["real"] for part in parts),
        "sources": dict(sorted(sources.items())),
        "by_skill": {name: len(part) for name, part in zip(names, parts, strict=True)},
    }
    rotations = torch.cat([part.rotations for part in parts])
    return ChunkTensors("base", root, rotations, root.new_zeros(len(root), 0), statistics)
