"""The motion generator on torch: the same motion as in numpy, on a GPU if there is one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from humanclaw.motion import DiTGenerator, MotionGenerator, Solver, reread, shipped_base, velocity
from humanclaw_train.model.checkpoint import load_adapter, load_base
from humanclaw_train.model.control import Adapter
from humanclaw_train.model.dit import Modulations

Array = NDArray[np.float32]
Branch = tuple[Adapter, Tensor]
"""A skill's adapter, and its modulations (layers, 6, B, 1, hidden) at the solver's times."""


class TorchRuntime:
    """Runs a base on a torch device, in single precision (humanclaw.motion.Runtime)."""

    def __init__(self, prior: Path, solver: Solver, device: torch.device) -> None:
        self._base, self._solver, self._device = load_base(prior), solver, device
        self._base.model.to(device)
        self._times = torch.tensor(solver.times, device=device)
        self._branch = reread(self._read)
        with torch.inference_mode():
            self._modulations = self._base.model.modulations(self._times)

    def _read(self, path: Path) -> Branch:
        adapter = load_adapter(path, self._base).to(self._device)
        return adapter, adapter.modulations(self._base.model, self._times)

    @torch.inference_mode()
    def solve(self, history: Array, noise: Array, adapter: Path | None, values: Sequence[Mapping[str, float]]) -> Array:
        """Return the futures that continue histories (Runtime.solve)."""
        branch = self._branch(adapter) if adapter is not None else None
        condition = self._condition(branch[0], values) if branch else None
        clean, model = torch.from_numpy(history).to(self._device), self._base.model

        def field(index: int, noisy: Tensor) -> Tensor:
            step = slice(index, index + 1)
            at = Modulations(self._modulations.blocks[:, :, step], self._modulations.final[:, step])
            residual = None
            if branch is not None and condition is not None:
                residual = branch[0].residual(condition, branch[1][:, :, step])
            output = model(clean, noisy, at, residual)
            answer: Tensor = velocity(model.config.prediction, output, noisy, self._times[step])
            return answer

        future: Tensor = self._solver.solve(field, torch.from_numpy(noise).to(self._device))
        return future.numpy(force=True)

    def _condition(self, adapter: Adapter, values: Sequence[Mapping[str, float]]) -> Tensor:
        return adapter.condition(torch.from_numpy(adapter.config.conditions(values)).to(self._device))


def torch_generator(profile: str = "default", prior: Path | None = None, device: str = "") -> MotionGenerator:
    """Read a base checkpoint for a torch device; otherwise like DiTGenerator.load. device: the GPU if there is one."""
    path, where = prior or shipped_base(), torch.device(device or ("cuda" if torch.cuda.is_available() else "cpu"))
    return DiTGenerator.load(path, profile, lambda base, solver: TorchRuntime(path, solver, where))
