"""The motion generator on torch: the same motion as in numpy, on a GPU if there is one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from humanclaw.motion import DiTGenerator, MotionGenerator, Reread, Solver, shipped_base
from humanclaw_train.model.checkpoint import load_adapter, load_base
from humanclaw_train.train import Model

Array = NDArray[np.float32]


class TorchRuntime:
    """Runs a base on a torch device, in single precision (humanclaw.motion.Runtime)."""

    def __init__(self, prior: Path, solver: Solver, device: torch.device) -> None:
        base = load_base(prior).to(device)
        self._solver, self._device, self._alone = solver, device, Model(base)
        self._controlled = Reread(lambda path: Model(base, load_adapter(path, base).to(device)))

    @torch.inference_mode()
    def solve(self, history: Array, noise: Array, adapter: Path | None, values: Sequence[Mapping[str, float]]) -> Array:
        """Return the futures that continue histories (Runtime.solve)."""
        model = self._controlled(adapter) if adapter is not None else self._alone
        none = np.zeros((len(values), 0), np.float32)
        conditions = model.adapter.config.conditions(values) if model.adapter else none
        clean, given, noisy = (torch.from_numpy(part).to(self._device) for part in (history, conditions, noise))
        future: Array = model.solve(clean, given, noisy, self._solver).numpy(force=True)
        return future


def torch_generator(profile: str = "default", prior: Path | None = None, device: str = "") -> MotionGenerator:
    """Read a base checkpoint for a torch device; otherwise like DiTGenerator.load. device: the GPU if there is one."""
    path, where = prior or shipped_base(), torch.device(device or ("cuda" if torch.cuda.is_available() else "cpu"))
    return DiTGenerator.load(path, profile, lambda base, solver: TorchRuntime(path, solver, where))
