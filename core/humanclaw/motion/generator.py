"""The motion generator: five frames and a skill's parameters in, fifteen frames out (paper, section 3.3).

Its product is kinematic: what the body then really does, the simulator decides.
"""

from __future__ import annotations

import importlib.resources
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import torch
from torch import Tensor

from humanclaw.errors import CheckpointError, HumanclawError
from humanclaw.motion.checkpoint import Base, load_adapter, load_base
from humanclaw.motion.control import Adapter
from humanclaw.motion.dit import Modulations
from humanclaw.motion.flow import PROFILES, Solver, noise_of, velocity
from humanclaw.motion.plant import planted
from humanclaw.pose import HISTORY, Motion, Pose2D, decode, encode

SHIPPED: Final = "motion/weights/base.safetensors"


@dataclass(frozen=True)
class _Branch:
    """An adapter with its modulations at the solver's times: (layers, 6, times, 1, hidden)."""

    adapter: Adapter
    modulations: Tensor
    modified: int


class DiTGenerator:
    """The base with one skill's adapter at a time. Adapters are read on first use and again when their file changes.

    plant: hold standing feet still (humanclaw.motion.plant); without it the motion is as the model wrote it.
    """

    def __init__(self, base: Base, solver: Solver, plant: bool = True) -> None:
        self.base = base
        self.solver = solver
        self.plant = plant
        self._times = torch.tensor(solver.times)
        self._branches: dict[Path, _Branch] = {}
        with torch.inference_mode():
            self._modulations = base.model.modulations(self._times)

    @classmethod
    def shipped(cls, profile: str = "default") -> DiTGenerator:
        """The base that comes with the package.

        profile: `default` for few solver steps and planted feet, `paper` for the paper's 30 steps and nothing after them.

        Raises HumanclawError for an unknown profile, CheckpointError when the weights are not there.
        """
        if profile not in PROFILES:
            raise HumanclawError(f"There is no motion profile {profile!r}.", f"Choose from: {', '.join(PROFILES)}.")
        return cls(load_base(shipped_base()), PROFILES[profile], plant=profile != "paper")

    @property
    def digest(self) -> str:
        """Names the weights of the prior."""
        return self.base.digest

    def start(self) -> Motion:
        """The five frames of standing that every episode begins from, at the origin facing +Z."""
        root, rotations = self.base.start_root.numpy(), self.base.start_rotations.numpy()
        return Motion(root.astype(float), rotations.astype(float))

    def generate(self, history: Motion, adapter: Path | None, values: Sequence[float], key: Sequence[int]) -> Motion:
        """15 frames that continue 5, in the frame of the history. The same key gives the same motion, bit for bit.

        adapter: a skill's checkpoint, or None for the prior alone. values: its parameters in SI. key: non-negative integers.
        Raises CheckpointError for an adapter that cannot be used with this base or these values.
        """
        return self.generate_batch([history], adapter, [values], [key])[0]

    def generate_batch(
        self,
        histories: Sequence[Motion],
        adapter: Path | None,
        values: Sequence[Sequence[float]],
        keys: Sequence[Sequence[int]],
    ) -> list[Motion]:
        """Many bodies at once, one skill for all of them; otherwise as generate."""
        frames = [Pose2D.of_history(_checked(history)) for history in histories]
        local = [frame.to_local(history) for frame, history in zip(frames, histories, strict=True)]
        states = [encode(history) for history in local]
        with torch.inference_mode(), _one_thread():
            clean = torch.as_tensor(np.stack(states), dtype=torch.float32)
            future = self._sample(self.base.normaliser.forward(clean), adapter, values, noise_of(keys))
            decoded = self.base.normaliser.inverse(future).numpy()
        futures = [decode(state) for state in decoded]
        if self.plant:
            futures = [planted(history, future) for history, future in zip(local, futures, strict=True)]
        return [frame.to_world(future) for frame, future in zip(frames, futures, strict=True)]

    def _sample(self, history: Tensor, path: Path | None, values: Sequence[Sequence[float]], noise: Tensor) -> Tensor:
        model = self.base.model
        branch = self._branch(path) if path is not None else None
        condition = branch.adapter.condition(_conditions(branch.adapter, values)) if branch else None

        def field(index: int, noisy: Tensor) -> Tensor:
            at = _at(self._modulations, index)
            residual = None
            if branch is not None and condition is not None:
                residual = branch.adapter.residual(condition, branch.modulations[:, :, index : index + 1])
            output = model(history, noisy, at, residual)
            return velocity(model.config.prediction, output, noisy, self._times[index : index + 1])

        return self.solver.solve(field, noise)

    def _branch(self, path: Path) -> _Branch:
        modified = path.stat().st_mtime_ns if path.exists() else -1
        known = self._branches.get(path)
        if known is None or known.modified != modified:
            adapter = load_adapter(path, self.base)
            known = _Branch(adapter, adapter.modulations(self.base.model, self._times), modified)
            self._branches[path] = known
        return known


@contextmanager
def _one_thread() -> Iterator[None]:
    """Twenty tokens are too few to share out: a second thread gains nothing, and on a busy machine waiting for it costs seconds.

    One thread also keeps the order of sums, and so the motion, the same on machines with other numbers of cores.
    """
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def shipped_base() -> Path:
    """Where the weights of the shipped prior lie."""
    return Path(str(importlib.resources.files("humanclaw"))) / SHIPPED


def _at(modulations: Modulations, index: int) -> Modulations:
    """Those of one solver time, to be broadcast over a batch."""
    one = slice(index, index + 1)
    return Modulations(modulations.blocks[:, :, one], modulations.final[:, one])


def _conditions(adapter: Adapter, values: Sequence[Sequence[float]]) -> Tensor:
    params = adapter.config.params
    for row in values:
        if len(row) != len(params):
            names = ", ".join(params) or "none"
            raise CheckpointError(
                f"The adapter of {adapter.config.skill} takes {len(params)} values ({names}); it got {len(row)}.",
                "Give one value for each parameter of the skill's schema, in its order.",
            )
    return torch.tensor([list(row) for row in values], dtype=torch.float32).reshape(len(values), len(params))


def _checked(history: Motion) -> Motion:
    if len(history) != HISTORY:
        raise ValueError(f"a history needs {HISTORY} frames; got {len(history)}")
    return history
