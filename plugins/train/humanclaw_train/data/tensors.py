"""Training data as tensors: read chunks, add errors to their histories, normalise states.

A folder of chunks has one `NAME.npz` per skill and `base.npz` for the prior (humanclaw_train.data.chunks.Chunks).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from humanclaw import HumanclawError
from humanclaw.body import CHUNK, FPS, FUTURE, HISTORY, JOINT_INDEX, STATE_SIZE
from humanclaw.motion import Normaliser
from humanclaw_train.data.chunks import Chunks
from humanclaw_train.model import kinematics

_LEAST_STD: Final = (0.02, 0.05, 0.02, 0.005)
"""Least standard deviation per block of the state. Without it, the noise of a joint that hardly moves would grow."""
_SETTLED: Final = 10
"""Frames after which the error of a history has faded."""


@dataclass(frozen=True)
class ChunkTensors:
    """root: (N, 20, 3). rotations: (N, 20, 24, 3). params: (N, k) in SI. All float32 on one device."""

    name: str
    root: Tensor
    rotations: Tensor
    params: Tensor
    statistics: dict[str, Any]
    names: tuple[str, ...] = ()
    """Names of the parameters (k,)."""
    measures: tuple[str, ...] = ()
    """Measures that they command (k,)."""
    licences: tuple[str, ...] = ()
    """`SOURCE: LICENCE` of the clips, where the chunks say so."""

    def __len__(self) -> int:
        return len(self.root)

    def to(self, device: torch.device) -> ChunkTensors:
        """Move to another device."""
        return replace(self, **{part: getattr(self, part).to(device) for part in ("root", "rotations", "params")})


def load(folders: Sequence[Path], name: str) -> ChunkTensors:
    """Load the chunks of one skill, or of `base`, from every folder that has some.

    Real chunks count once, because folders built with different seeds contain the same clips. Raises HumanclawError if
    no folder has any, or if their parameters command different measures.
    """
    files = [folder / f"{name}.npz" for folder in folders if (folder / f"{name}.npz").is_file()]
    if not files:
        listed = ", ".join(map(str, folders))
        own = f"humanclaw data chunks --skill FOLDER_OF/{name} --clips DIR"
        raise HumanclawError(
            f"There is no {name}.npz in {listed}.", f"Build it with: {own} (or all skills: humanclaw data build DIR)"
        )
    parts = [Chunks.load(file) for file in files]
    _check_alike(files, parts)
    whole = Chunks.join(parts)[np.concatenate(list(_new(parts)))]
    root, rotations, params = (
        torch.from_numpy(part.astype(np.float32)) for part in (whole.root, whole.rotations, whole.params)
    )
    names, measures = tuple(whole.names.tolist()), tuple(whole.measures.tolist())
    licences = dict.fromkeys(text for part in parts for text in part.licences.tolist())
    return ChunkTensors(name, root, rotations, params, _statistics(whole), names, measures, tuple(licences))


def _check_alike(files: Sequence[Path], parts: Sequence[Chunks]) -> None:
    commands = [", ".join(map("{} ({})".format, part.names.tolist(), part.measures.tolist())) for part in parts]
    for file, command in zip(files, commands, strict=True):
        if command != commands[0]:
            raise HumanclawError(
                f"{file} commands {command or 'nothing'}; {files[0]} commands {commands[0] or 'nothing'}.",
                "Build both with the same schema.json, or train on one of them.",
            )


def _new(parts: Sequence[Chunks]) -> Iterator[NDArray[np.bool_]]:
    """Yield for each part a mask (N,) without the real chunks that an earlier part has."""
    before = set[bytes]()
    for part in parts:
        keys = [root.tobytes() + turns.tobytes() for root, turns in zip(part.root, part.rotations, strict=True)]
        # Synthetic chunks differ between seeds, so they are never repeated.
        yield np.array([not real or key not in before for real, key in zip(part.real, keys, strict=True)])
        before |= set(keys)


def _statistics(whole: Chunks) -> dict[str, Any]:
    params, sources = whole.params, Counter(str(source).split(":")[0] for source in whole.source)
    return {
        "chunks": len(whole),
        "real": int(whole.real.sum()),
        "sources": dict(sorted(sources.items())),
        # Four digits: these numbers go into headers and cards, where float32 noise would only distract.
        "params_low": [round(float(value), 4) for value in params.min(0)] if params.size else [],
        "params_high": [round(float(value), 4) for value in params.max(0)] if params.size else [],
    }


def normaliser(chunks: ChunkTensors) -> Normaliser:
    """Return mean and standard deviation of each of the 219 numbers over these chunks."""
    states = kinematics.encode(chunks.root, chunks.rotations).reshape(-1, STATE_SIZE)
    std = states.std(0)
    blocks = (kinematics.ROOT, kinematics.ROTATIONS, kinematics.POSITIONS, kinematics.VELOCITIES)
    for block, least in zip(blocks, _LEAST_STD, strict=True):
        std[block] = std[block].clamp(min=least)
    return Normaliser(states.mean(0), std)


def standing(chunks: ChunkTensors) -> tuple[Tensor, Tensor]:
    """Return the calmest and most typical history of standing: root (5, 3), rotations (5, 24, 3)."""
    root, rotations = chunks.root[:, :HISTORY], chunks.rotations[:, :HISTORY]
    positions = kinematics.joints(root, rotations)
    moving = positions.diff(dim=1).norm(dim=-1).mean((1, 2)) + (chunks.root[:, -1] - chunks.root[:, 0]).norm(dim=-1)
    # A seated or bent body can be calm too, so its head must be about as high as that of most calm bodies.
    upright = positions[:, -1, JOINT_INDEX["head"], 1]
    calm = moving <= moving.quantile(0.1)
    still = calm & (upright > upright[calm].quantile(0.5) - 0.05)
    typical = positions[still, -1].median(0).values
    far = (positions[:, -1] - typical).norm(dim=-1).mean(-1)
    usual_far, usual_moving = (values[still].median().clamp(min=1e-6) for values in (far, moving))
    # The large summand excludes bodies that do not stand.
    best = int((far / usual_far + moving / usual_moving + 1e3 * ~still).argmin())
    return root[best], rotations[best]


_HIPS: Final = (JOINT_INDEX["left_hip"], JOINT_INDEX["right_hip"])
_BRISK: Final = 0.5
"""Speed from which errors have full strength, m/s."""


def _pace(root: Tensor) -> Tensor:
    """Return the speed over the floor in the history (B,), m/s, for root (B, 20, 3)."""
    way: Tensor = (root[:, HISTORY - 1] - root[:, 0])[:, [0, 2]].norm(dim=-1)
    return way * FPS / (HISTORY - 1)


def noisy_history(
    root: Tensor, rotations: Tensor, generator: torch.Generator, strength: float = 1.0
) -> tuple[Tensor, Tensor]:
    """Add errors to the histories of chunks, like those in the model's own motion; the futures recover from them.

    Each chunk gets its own strength of a pose offset, of a drift that stops at the last history frame, and of jitter.
    A second strength scales a lean of the trunk over unchanged legs. In real data people keep their lean, so without
    this a body would also keep a lean that its own errors caused.

    strength: a factor over 1 applies only to moving bodies. A model's errors are smallest in standing, and larger
    errors of standing feet would hide which foot goes first.

    The future begins where the noisy history ends and returns to the clean future within ten frames, so the model
    learns a smooth recovery and no jump. The lowest sole of the history stays at height 0, as the canonical frame
    demands. Shapes: root (B, 20, 3), rotations (B, 20, 24, 3).
    """
    device = root.device
    strengths = 1 + (strength - 1) * (_pace(root) / _BRISK).clamp(max=1)[:, None, None] if strength > 1 else strength
    # Squared, so that most histories have small errors and a few have large ones.
    share = strengths * torch.rand(len(root), 1, 1, generator=generator, device=device) ** 2
    pose, drift, history = (curve.to(device)[None, :, None] for curve in _curves())

    def normal(*shape: int) -> Tensor:
        return torch.randn(len(root), *shape, generator=generator, device=device)

    width = rotations.shape[2] * 3
    offset = 0.08 * normal(1, width) * pose
    offset[..., 1] = 0  # The heading of the last history frame is 0 by definition.
    turned = share * (offset + 0.08 * normal(1, width) * drift + 0.003 * normal(CHUNK, width) * history)
    lean = 0.08 * strengths * torch.rand(len(root), 1, 1, generator=generator, device=device) * normal(1, 2) * pose
    turned[..., [0, 2]] += lean
    for hip in _HIPS:  # Undo the lean in the legs.
        turned[..., [3 * hip, 3 * hip + 2]] -= lean
    rotations = rotations + turned.reshape(rotations.shape)
    moved = torch.tensor([0.03, 0.01, 0.03], device=device) * normal(1, 3) * drift + 0.001 * normal(CHUNK, 3) * history
    moved[:, HISTORY - 1] = 0  # The canonical frame puts the last history frame over the origin.
    root = root + share * moved
    lowest = kinematics.support_height(kinematics.joints(root[:, :HISTORY], rotations[:, :HISTORY])).amin(-1)
    return root - lowest[:, None, None] * pose * torch.tensor([0.0, 1.0, 0.0], device=device), rotations


def recovered(
    root: Tensor, rotations: Tensor, history_root: Tensor, history_rotations: Tensor
) -> tuple[Tensor, Tensor]:
    """Return chunks with other canonical histories, (B, 5, 3) and (B, 5, 24, 3); the futures recover from them.

    The future begins where the history ends, with its velocity, and returns within ten frames.
    """
    pose, drift, _ = (curve.to(root.device)[HISTORY:] for curve in _curves())
    parts = []
    for true, met in ((root, history_root), (rotations, history_rotations)):
        error = met - true[:, :HISTORY]
        width = (1, FUTURE, *(1 for _ in true.shape[2:]))
        rate = HISTORY * (error[:, -1:] - error[:, -2:-1])
        future = true[:, HISTORY:] + error[:, -1:] * pose.view(width) + rate * drift.view(width)
        parts.append(torch.cat([met, future], 1))
    return parts[0], parts[1]


_FROM_HISTORY: Final = {"hips.rise": 1.0, "hips.drop": -1.0}
"""Measures relative to the history's pelvis height, with the sign of a rise in them."""


def commanded(measures: Sequence[str], params: Tensor, clean: Tensor, root: Tensor) -> Tensor:
    """Return the parameters (B, k) of chunks whose root (B, 20, 3) was `clean` before their histories got errors.

    The end of the chunk is unchanged, so only a rise changes: it is measured from the pelvis of the history.
    """
    lifted = root[:, HISTORY - 1, 1] - clean[:, HISTORY - 1, 1]
    signs = torch.tensor([_FROM_HISTORY.get(measure, 0.0) for measure in measures], device=params.device)
    return params - signs * lifted[:, None]


def _curves() -> tuple[Tensor, Tensor, Tensor]:
    """Return three curves over the 20 frames: an offset that fades, a drift, and 1 on the history alone."""
    frame = torch.arange(CHUNK) - (HISTORY - 1.0)
    pose = 0.5 + 0.5 * torch.cos(torch.pi * (frame / _SETTLED).clamp(0, 1))
    drift = frame / HISTORY * torch.exp(-frame.clamp(min=0) / 2)
    return pose, drift, (frame <= 0).float()


def load_all(folders: Sequence[Path]) -> ChunkTensors:
    """Load every chunk of every file, without parameters: the prior's training data.

    Raises HumanclawError if the folders have none.
    """
    names = sorted({file.stem for folder in folders for file in folder.glob("*.npz")})
    if not names:
        raise HumanclawError(
            f"There are no chunks in {', '.join(map(str, folders))}.",
            "Build chunks first with: humanclaw data build DIR",
        )
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
