"""Histories as the model leaves them: rollout training, after DAgger (Ross, Gordon and Bagnell, 2011).

A model that learns from true histories alone meets its own errors only when it runs. Here it generates up to a few
chunks in a row, commanded as the data's own successive chunks are, and learns to come back from where it ends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from humanclaw.body import FUTURE, HISTORY
from humanclaw_train.data.chunks import canonical
from humanclaw_train.data.tensors import ChunkTensors, recovered
from humanclaw_train.model import kinematics

SHARE: Final = 0.5
"""Share of a batch that gets such histories, where the data has the chunks before."""
_SAME: Final = 1e-3
"""Metres and radians by which the history of a chunk may differ from the end of the chunk before it."""
_STEPS: Final = (1, FUTURE // 3)
"""Distances in the file from a chunk to the one before it: synthetic series, and windows of clips 3 frames apart."""
_LOST: Final = 0.15
"""Mean distance of joints, metres, from which a generated body does another thing than the data's: such as a step with
the other foot. It has nothing to come back to."""

Generate = Callable[[Tensor, Tensor, Tensor], Tensor]
"""Maps states of histories (B, 5, 219), conditions (B, k) and noise (B, 15, 219) to states of futures (B, 15, 219)."""


def predecessors(chunks: ChunkTensors) -> Tensor:
    """Return the index of the chunk that each chunk goes on from (N,); -1 where the data does not have it."""
    before = torch.full((len(chunks),), -1)
    ends = _canonical(chunks.root[:, -HISTORY:], chunks.rotations[:, -HISTORY:])
    begins = chunks.root[:, :HISTORY], chunks.rotations[:, :HISTORY]
    for step in _STEPS:
        gap = torch.zeros(max(len(chunks) - step, 0))
        for end, begin in zip(ends, begins, strict=True):
            away = (end[:-step] - begin[step:]).abs().flatten(1)
            gap = torch.maximum(gap, away.amax(1).to(gap))
        rows = (gap < _SAME).nonzero()[:, 0]
        before[rows + step] = rows
    return before.to(chunks.root.device)


def _canonical(root: Tensor, rotations: Tensor) -> tuple[Tensor, Tensor]:
    """Move histories (B, 5, ...) to their own canonical frames."""
    moved = canonical(*(part.double().numpy(force=True) for part in (root, rotations)))
    first, second = (torch.from_numpy(part).to(root) for part in moved)
    return first, second


@dataclass(frozen=True)
class OwnHistories:
    """Replaces true histories by those that the model leaves after up to `depth` chunks."""

    chunks: ChunkTensors
    before: Tensor
    """(N,) from `predecessors`."""
    depth: int
    generate: Generate

    @torch.no_grad()
    def __call__(
        self, chosen: Tensor, root: Tensor, rotations: Tensor, generator: torch.Generator
    ) -> tuple[Tensor, Tensor]:
        """Return root (B, 20, 3) and rotations (B, 20, 24, 3) of the chosen chunks (B,), some with own histories."""
        chain = [chosen]
        for _ in range(self.depth):
            chain.append(torch.where(chain[-1] < 0, chain[-1], self.before[chain[-1]]))
        known = sum((link >= 0).long() for link in chain[1:])
        own = torch.rand(len(chosen), generator=generator, device=chosen.device) < SHARE
        wanted = torch.randint(1, self.depth + 1, (len(chosen),), generator=generator, device=chosen.device)
        depth = torch.minimum(known * own, wanted)
        history = self._run(chain, depth, generator)
        true = self.chunks.root[chosen], self.chunks.rotations[chosen]
        away = (kinematics.joints(*history) - kinematics.joints(*(part[:, :HISTORY] for part in true))).norm(dim=-1)
        kept = (depth > 0) & (away.mean((1, 2)) < _LOST)
        met = recovered(*true, *history)
        shape = (kept[:, None, None], kept[:, None, None, None])
        return torch.where(shape[0], met[0], root), torch.where(shape[1], met[1], rotations)

    def _run(self, chain: list[Tensor], depth: Tensor, generator: torch.Generator) -> tuple[Tensor, Tensor]:
        """Return the canonical histories that `depth` (B,) chunks leave, each from the true history of its first."""
        parts = self.chunks.root, self.chunks.rotations
        root, rotations = (part[chain[0]][:, :HISTORY].clone() for part in parts)
        for level in range(int(depth.max()), 0, -1):
            rows = (depth >= level).nonzero()[:, 0]
            first, source = depth[rows] == level, chain[level][rows]
            root[rows[first]], rotations[rows[first]] = (part[source[first], :HISTORY] for part in parts)
            states = kinematics.encode(root[rows], rotations[rows])
            noise = torch.randn((len(rows), FUTURE, states.shape[-1]), generator=generator, device=states.device)
            future = self.generate(states, self.chunks.params[source], noise)[:, -HISTORY:]
            turned = future[..., kinematics.ROTATIONS].reshape(*rotations[rows].shape)
            root[rows], rotations[rows] = _canonical(future[..., kinematics.ROOT], turned)
        return root, rotations
