"""Time of one chunk by size, solver and runtime (numpy, PyTorch), for one body and many.

A runtime runs a base and an adapter as episodes do, at batch 1 unless a row says otherwise. Weights are random, which
does not change the time.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
import torch

from humanclaw.body import FUTURE, HISTORY, N_JOINTS, STATE_SIZE
from humanclaw.motion import (
    PROFILES,
    SIZES,
    AdapterConfig,
    Card,
    NumpyRuntime,
    Runtime,
    Solver,
    load_base,
)
from humanclaw_train.markdown import table
from humanclaw_train.model.checkpoint import Normaliser, save_adapter, save_base
from humanclaw_train.model.control import Adapter
from humanclaw_train.model.dit import DiT
from humanclaw_train.model.generator import TorchRuntime

RUNTIMES: Final[dict[str, Callable[[Path, Solver], Runtime]]] = {
    "numpy": lambda base, solver: NumpyRuntime(load_base(base), solver),
    "torch": lambda base, solver: TorchRuntime(base, solver, torch.device("cpu")),
}
if torch.cuda.is_available():
    RUNTIMES["torch on the GPU"] = lambda base, solver: TorchRuntime(base, solver, torch.device("cuda"))
SOLVERS: Final = (PROFILES["default"], Solver("midpoint", 4), Solver("midpoint", 30))
_TIMED: Final = AdapterConfig("timed", "fourier", ("x", "z", "yaw"), (0.0, 0.4, 0.0), (0.3, 0.4, 0.5))
_ENOUGH: Final = 3.0
"""Duration of one measurement, seconds; at least one call."""


@dataclass(frozen=True)
class Timing:
    """Time of one chunk for one body, milliseconds: the least of several calls."""

    size: str
    runtime: str
    threads: int
    solver: Solver
    bodies: int
    milliseconds: float
    """Wall time."""
    cpu: float
    """Processor time of all threads. Other load on the machine hardly changes it."""


# -- measuring ---------------------------------------------------------------------------------------------------------
def measure(
    size: str, threads: int, bodies: int, solvers: Sequence[Solver], runtimes: Sequence[str]
) -> Iterator[Timing]:
    """Time each runtime and solver. numpy takes one thread always; torch has its former number afterwards."""
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    rng = np.random.default_rng(0)
    history, noise = (rng.standard_normal((bodies, frames, STATE_SIZE), np.float32) for frames in (HISTORY, FUTURE))
    values = [dict(zip(_TIMED.params, _TIMED.centre, strict=True))] * bodies
    try:
        with tempfile.TemporaryDirectory() as folder:
            base, adapter = _random(size, Path(folder))
            for runtime in runtimes:
                for solver in solvers:
                    solve = RUNTIMES[runtime](base, solver).solve
                    wall, cpu = _least(partial(solve, history, noise, adapter, values))
                    used = threads if runtime == "torch" else 1
                    yield Timing(size, runtime, used, solver, bodies, wall / bodies, cpu / bodies)
    finally:
        torch.set_num_threads(before)


def _random(size: str, folder: Path) -> tuple[Path, Path]:
    """Write a base of random weights and an adapter, and return their checkpoints."""
    torch.manual_seed(0)
    base, adapter = folder / "base.safetensors", folder / "adapter.safetensors"
    model, normaliser = DiT(SIZES[size]), Normaliser(torch.zeros(STATE_SIZE), torch.ones(STATE_SIZE))
    start = torch.zeros(HISTORY, 3), torch.zeros(HISTORY, N_JOINTS, 3)
    digest = save_base(base, model, normaliser, start, Card())
    save_adapter(adapter, Adapter(model, _TIMED), digest, Card())
    return base, adapter


def _least(call: Callable[[], object]) -> tuple[float, float]:
    """Return the least wall and processor time of several calls, ms, after one call to warm up."""
    call()
    wall: list[float] = []
    cpu: list[float] = []
    while not wall or (sum(wall) < _ENOUGH and len(wall) < 30):
        started, spent = time.perf_counter(), time.process_time()
        call()
        wall.append(time.perf_counter() - started)
        cpu.append(time.process_time() - spent)
    # Other load only ever adds time, so the least is closest to the truth.
    return 1000 * min(wall), 1000 * min(cpu)


# -- tables ------------------------------------------------------------------------------------------------------------
def markdown(timings: Sequence[Timing]) -> str:
    """Format ms per chunk and body, wall time and (processor time), by size, runtime, threads and batch."""
    solvers = list(dict.fromkeys(timing.solver for timing in timings))
    rows = dict.fromkeys((t.size, t.runtime, t.threads, t.bodies) for t in timings)
    times = {(t.size, t.runtime, t.threads, t.bodies, t.solver): f"{t.milliseconds:.1f} ({t.cpu:.1f})" for t in timings}
    heads = ["size", "runtime", "threads", "bodies", *(f"{solver.method} {solver.steps}, ms" for solver in solvers)]
    return table(heads, [[*map(str, row), *(times.get((*row, solver), "-") for solver in solvers)] for row in rows])


def timed(sizes: Sequence[str], threads: Sequence[int], bodies: Sequence[int]) -> Iterator[Timing]:
    """Time sizes with every solver on each number of threads, and with the default solver for each number of bodies."""
    for size in sizes:
        for count in threads:
            # numpy and a GPU take one thread whatever is asked.
            yield from measure(size, count, 1, SOLVERS, [*RUNTIMES] if count == threads[0] else ["torch"])
        for many in bodies:
            yield from measure(size, threads[0], many, SOLVERS[:1], [*RUNTIMES])
