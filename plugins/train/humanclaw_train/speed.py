"""Time of one chunk by size, solver and runtime (numpy, PyTorch, ONNX Runtime, OpenVINO), for one body and many.

    humanclaw speed --threads 1 2

The solver is timed with the velocity field of base and adapter, at batch 1 unless a row says otherwise. The modulations
depend only on tau and are computed beforehand for every runtime. Weights are random, which does not change the time.
ONNX Runtime and OpenVINO are measured if installed (`pip install onnx onnxscript onnxruntime openvino`).
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Final

import numpy as np
import torch
from threadpoolctl import ThreadpoolController
from torch import Tensor, nn

import humanclaw.motion as inference
from humanclaw import HumanclawError
from humanclaw.body import FUTURE, HISTORY, STATE_SIZE
from humanclaw.cli import show_markdown
from humanclaw.motion import PROFILES, SIZES, AdapterConfig, DiTGenerator, Solver
from humanclaw_train.checkpoint import weights_of
from humanclaw_train.control import Adapter
from humanclaw_train.dit import DiT, Modulations
from humanclaw_train.fidelity import milliseconds
from humanclaw_train.flow import velocity
from humanclaw_train.rollouts import Command, Installed, adapters
from humanclaw_train.tables import as_json, table

SOLVERS: Final = (PROFILES["default"], Solver("midpoint", 4), Solver("midpoint", 30))
GOALS: Final = {"lite": 50.0, "paper": 250.0}
"""Limit of the default solver's time per chunk, ms."""
_TIMED: Final = AdapterConfig("timed", "fourier", ("x", "z", "yaw"), (0.0, 0.4, 0.0), (0.3, 0.4, 0.5))
_ENOUGH: Final = 3.0
"""Duration of one measurement, seconds; at least one call."""


class VelocityField(nn.Module):
    """Base and adapter as one function. Modulations are arguments, so that one export serves every solver."""

    def __init__(self, base: DiT, adapter: Adapter) -> None:
        super().__init__()
        self.base, self.adapter = base, adapter

    def forward(
        self, history: Tensor, noisy: Tensor, values: Tensor, tau: Tensor, blocks: Tensor, final: Tensor, branch: Tensor
    ) -> Tensor:
        """Return the velocity (B, 15, 219).

        history (B, 5, 219), noisy (B, 15, 219), values (B, k), tau (1,), and the modulations of that tau.
        """
        residual = self.adapter.residual(self.adapter.condition(values), branch)
        output = self.base(history, noisy, Modulations(blocks, final), residual)
        return velocity(self.base.config.prediction, output, noisy, tau)


Evaluate = Callable[[tuple[Tensor, ...]], Tensor]
"""Maps the arguments of VelocityField.forward to its result."""


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


# -- runtimes ----------------------------------------------------------------------------------------------------------
def _numpy(field: VelocityField, example: tuple[Tensor, ...], threads: int) -> Evaluate:
    base = inference.DiT(field.base.config, weights_of(field.base))
    adapter = inference.Adapter(base, field.adapter.config, weights_of(field.adapter))
    limit = partial(ThreadpoolController().limit, limits=threads, user_api="blas")
    controlled = cache(lambda tau: inference.Controlled(base, adapter, np.array([tau], np.float32)))

    def evaluate(arguments: tuple[Tensor, ...]) -> Tensor:
        history, noisy, values, tau, blocks, final, _ = (part.numpy() for part in arguments)
        at = float(tau[0])
        with limit():  # BLAS alone: numpy has no setting of its own.
            through = controlled(at).through(values)
            output = base(history, noisy, inference.Modulations(blocks, final), through)
        return torch.from_numpy(inference.velocity(base.config.prediction, output, noisy, at))

    return evaluate


def _torch(field: VelocityField, example: tuple[Tensor, ...], threads: int) -> Evaluate:
    torch.set_num_threads(threads)
    return lambda arguments: field(*arguments)


def _onnx(field: VelocityField, example: tuple[Tensor, ...], threads: int) -> Evaluate:
    import onnxruntime  # type: ignore[import-not-found,unused-ignore]

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
    session = onnxruntime.InferenceSession(_exported(field, example), options, providers=["CPUExecutionProvider"])
    names = [part.name for part in session.get_inputs()]

    def evaluate(arguments: tuple[Tensor, ...]) -> Tensor:
        fed = {name: value.numpy() for name, value in zip(_NAMES, arguments, strict=True) if name in names}
        return torch.from_numpy(session.run(None, fed)[0])

    return evaluate


def _openvino(field: VelocityField, example: tuple[Tensor, ...], threads: int) -> Evaluate:
    import openvino  # type: ignore[import-not-found,unused-ignore]

    core = openvino.Core()
    model = core.read_model(model=_exported(field, example))
    settings = {"INFERENCE_NUM_THREADS": threads, "PERFORMANCE_HINT": "LATENCY", "INFERENCE_PRECISION_HINT": "f32"}
    compiled = core.compile_model(model, "CPU", settings)
    names = {name for part in compiled.inputs for name in part.get_names()}

    def evaluate(arguments: tuple[Tensor, ...]) -> Tensor:
        fed = {name: value.numpy() for name, value in zip(_NAMES, arguments, strict=True) if name in names}
        return torch.from_numpy(next(iter(compiled(fed).values())).copy())

    return evaluate


_NAMES: Final = ("history", "noisy", "values", "tau", "blocks", "final", "branch")


def _exported(field: VelocityField, example: tuple[Tensor, ...]) -> bytes:
    """Export the field as ONNX for the batch size of the example."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # About constants in the trace, which are intended, and the old exporter.
        path = Path(folder) / "field.onnx"
        torch.onnx.export(
            field, example, str(path), input_names=list(_NAMES), output_names=["v"], opset_version=17, dynamo=False
        )
        return path.read_bytes()


RUNTIMES: Final[dict[str, tuple[tuple[str, ...], Callable[[VelocityField, tuple[Tensor, ...], int], Evaluate]]]] = {
    "numpy": ((), _numpy),
    "torch": ((), _torch),
    "onnxruntime": (("onnx", "onnxruntime"), _onnx),
    "openvino": (("onnx", "openvino"), _openvino),
}
"""Name to the packages that the runtime needs and the function that prepares a field for it."""


def installed() -> list[str]:
    """Return the runtimes that are installed."""
    return [name for name, (needs, _) in RUNTIMES.items() if all(map(importlib.util.find_spec, needs))]


# -- measuring ---------------------------------------------------------------------------------------------------------
def measure(
    size: str, threads: int, bodies: int, solvers: Sequence[Solver], runtimes: Sequence[str]
) -> Iterator[Timing]:
    """Time each runtime and solver. Afterwards torch has its former number of threads."""
    before = torch.get_num_threads()
    torch.manual_seed(0)
    base = DiT(SIZES[size])
    field = VelocityField(base, Adapter(base, _TIMED)).eval().requires_grad_(False)
    history, noise = torch.randn(bodies, HISTORY, STATE_SIZE), torch.randn(bodies, FUTURE, STATE_SIZE)
    values = torch.zeros(bodies, 3)
    try:
        for runtime in runtimes:
            arguments = _arguments(field, Solver("euler", 1), history, noise, values)
            evaluate = RUNTIMES[runtime][1](field, arguments[0], threads)
            for solver in solvers:
                given = _arguments(field, solver, history, noise, values)
                taken = _least(partial(_solve, solver, evaluate, given, noise))
                yield Timing(size, runtime, threads, solver, bodies, *(part / bodies for part in taken))
    finally:
        torch.set_num_threads(before)


@torch.inference_mode()
def _arguments(
    field: VelocityField, solver: Solver, history: Tensor, noise: Tensor, values: Tensor
) -> list[tuple[Tensor, ...]]:
    times = torch.tensor(solver.times)
    own, branch = field.base.modulations(times), field.adapter.modulations(field.base, times)
    every = []
    for index in range(len(times)):
        one = slice(index, index + 1)
        parts = (own.blocks[:, :, one], own.final[:, one], branch[:, :, one])
        every.append((history, noise, values, times[one], *(part.contiguous() for part in parts)))
    return every


@torch.inference_mode()
def _solve(solver: Solver, evaluate: Evaluate, arguments: Sequence[tuple[Tensor, ...]], noise: Tensor) -> Tensor:
    def at(index: int, noisy: Tensor) -> Tensor:
        history, _, *rest = arguments[index]
        return evaluate((history, noisy, *rest))

    future: Tensor = solver.solve(at, noise)
    return future


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
    found = {(t.size, t.runtime, t.threads, t.bodies, t.solver): f"{t.milliseconds:.1f} ({t.cpu:.1f})" for t in timings}
    heads = ["size", "runtime", "threads", "bodies", *(f"{solver.method} {solver.steps}, ms" for solver in solvers)]
    return table(heads, [[*map(str, row), *(found.get((*row, solver), "-") for solver in solvers)] for row in rows])


def verdict(timings: Sequence[Timing]) -> str:
    """Compare the best time of each size and runtime with the size's limit, for the default solver."""
    lines = []
    for size, goal in GOALS.items():
        fits = [t for t in timings if t.size == size and t.bodies == 1 and t.solver == SOLVERS[0]]
        for runtime in dict.fromkeys(t.runtime for t in fits):
            best = min((t for t in fits if t.runtime == runtime), key=lambda t: t.milliseconds)
            word = "within" if best.milliseconds < goal else "over"
            lines.append(
                f"{size}, {runtime}, {best.threads} threads: {best.milliseconds:.1f} ms, {word} {goal:.0f} ms."
            )
    return "\n".join(lines)


def _printed(timings: Iterator[Timing]) -> Iterator[Timing]:
    """Yield the same timings, but print each at once, because the whole takes minutes."""
    for timing in timings:
        print(timing, file=sys.stderr, flush=True)
        yield timing


def main(arguments: Sequence[str] | None = None, skills: Installed | None = None) -> int:
    """Run the command line. skills: returns the adapters of the installed skills; the first is timed."""
    options = _parser().parse_args(arguments)
    runtimes = installed()
    timings: list[Timing] = []
    for size in options.sizes:
        for threads in options.threads:
            timings += _printed(measure(size, threads, 1, SOLVERS, runtimes))
        for bodies in options.bodies:
            timings += _printed(measure(size, options.threads[0], bodies, SOLVERS[:1], runtimes))
    if options.json:
        print(as_json(timings))
        return 0
    show_markdown(markdown(timings))
    show_markdown(f"\n{verdict(timings)}")
    absent = [name for name in RUNTIMES if name not in runtimes]
    if absent:
        print(f"Not installed, not measured: {', '.join(absent)}.")
    try:
        generator, paths = DiTGenerator.shipped(), adapters(options.adapters, installed=skills)
        skill = next(iter(paths))
        command = Command.of(skill, paths[skill])
        values = command.named(command.draw(1, np.random.default_rng(0))[0])
        taken = milliseconds(generator, paths[skill], values, 20)
        print(f"The shipped generator as episodes run it, {skill}, corrected: {taken:.1f} ms a chunk.")
    except HumanclawError as error:
        print(f"The shipped weights were not timed: {error}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="humanclaw speed", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--sizes", nargs="+", choices=list(SIZES), default=["lite", "paper"], help="sizes of the base")
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2], help="numbers of CPU threads")
    parser.add_argument(
        "--bodies", type=int, nargs="*", default=[8, 64], help="batch sizes, timed with the default solver"
    )
    parser.add_argument(
        "--adapters", type=Path, nargs="*", help="folders to search for adapters (default: the installed skills)"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    return parser


if __name__ == "__main__":
    sys.exit(main())
