"""Runtimes of the motion model: they carry noise to motion. This one computes in numpy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Final, Protocol, TypeVar

import numpy as np
from threadpoolctl import ThreadpoolController

from humanclaw.motion.checkpoint import Base, load_adapter
from humanclaw.motion.control import Controlled
from humanclaw.motion.dit import Array, Modulations
from humanclaw.motion.flow import Solver, velocity
from humanclaw.storage.files import state_of

T = TypeVar("T")


class Runtime(Protocol):
    """Runs a base with the adapters of skills."""

    def solve(self, history: Array, noise: Array, adapter: Path | None, values: Sequence[Mapping[str, float]]) -> Array:
        """Return the normalised futures (B, 15, 219) that continue normalised histories (B, 5, 219).

        noise: (B, 15, 219). adapter: a skill's checkpoint, or None for the base alone. values: of each body, every
        parameter that the adapter's header names, in SI. Raises CheckpointError for an adapter that cannot be used with
        this base or these values.
        """


_KEPT: Final = 5
"""Adapters that are held, 8 MB each. The oracle asks for another in 14 of 1,757 steps, and reading one takes 16 ms."""


def reread(read: Callable[[Path], T]) -> Callable[[Path], T]:
    """Return a function that reads files: on first use, again when a file has changed, and after _KEPT others."""

    @lru_cache(maxsize=_KEPT)
    def kept(path: Path, state: tuple[int, ...]) -> T:
        return read(path)

    return lambda path: kept(path, state_of(path.stat() if path.exists() else None))


class NumpyRuntime:
    """Runs a base on one processor thread."""

    def __init__(self, base: Base, solver: Solver) -> None:
        self._base, self._solver = base, solver
        times = np.array(solver.times, np.float32)
        self._controlled = reread(lambda path: Controlled(base.model, load_adapter(path, base), times))
        # Twenty tokens are too few for two threads: a second one gains nothing, and on a busy machine waiting for it
        # costs seconds. One thread also keeps the order of sums, and so the motion, whatever the number of cores.
        self._one_thread = partial(ThreadpoolController().limit, limits=1, user_api="blas")
        with self._one_thread():
            self._modulations = base.model.modulations(times)

    def solve(self, history: Array, noise: Array, adapter: Path | None, values: Sequence[Mapping[str, float]]) -> Array:
        """Return the futures that continue histories (Runtime.solve)."""
        with self._one_thread():
            model = self._base.model
            controlled = self._controlled(adapter) if adapter is not None else None
            conditions = controlled.config.conditions(values) if controlled else None

            def field(index: int, noisy: Array) -> Array:
                through = None
                if controlled is not None and conditions is not None:
                    through = controlled.through(conditions, slice(index, index + 1))
                output = model(history, noisy, _at(self._modulations, index), through)
                answer: Array = velocity(model.config.prediction, output, noisy, self._solver.times[index])
                return answer

            future: Array = self._solver.solve(field, noise)
            return future


def _at(modulations: Modulations, index: int) -> Modulations:
    """Return the modulations of one solver time, to broadcast over a batch."""
    part = slice(index, index + 1)
    return Modulations(modulations.blocks[:, :, part], modulations.final[:, part])
