"""Generate chunks of `walk`, base and adapter, in five runtimes: prints rows for peers.py, which starts it."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from statistics import median

import numpy as np
import onnxruntime
import openvino
import torch
from perf import spent

from humanclaw import Plugins
from humanclaw.body.pose import encode
from humanclaw.motion import PROFILES, DiTGenerator, shipped_base, velocity
from humanclaw.motion.flow import noise_of
from humanclaw.motion.runtime import NumpyRuntime
from humanclaw_train.model.checkpoint import load_adapter, load_base
from humanclaw_train.model.dit import Modulations
from humanclaw_train.model.generator import TorchRuntime

SAMPLES = 5
SOLVER = PROFILES["default"].solver


class Walk(torch.nn.Module):
    """The whole chunk as one graph, for runtimes that read one."""

    def __init__(self, adapter: Path) -> None:
        super().__init__()
        base = load_base(shipped_base())
        self.base, self.adapter = base.model, load_adapter(adapter, base)
        self.times = torch.tensor(SOLVER.times)
        self.modulations = Modulations(*(part.detach() for part in self.base.modulations(self.times)))
        self.branch = self.adapter.modulations(self.base, self.times).detach()

    def forward(self, history: torch.Tensor, noise: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
        """Return normalised futures (B, 15, 219)."""
        condition = self.adapter.condition(values)

        def field(index: int, noisy: torch.Tensor) -> torch.Tensor:
            step = slice(index, index + 1)
            at = Modulations(self.modulations.blocks[:, :, step], self.modulations.final[:, step])
            output = self.base(history, noisy, at, self.adapter.residual(condition, self.branch[:, :, step]))
            return velocity(self.base.config.prediction, output, noisy, self.times[step])

        return SOLVER.solve(field, noise)


def runtimes(bodies: int) -> Mapping[str, Callable[[], np.ndarray]]:
    """Return what generates a chunk for a number of bodies, by runtime; ours first."""
    generator, path = DiTGenerator.load(), Plugins.discover().skills["walk"].adapter
    clean = np.stack([encode(generator.start())] * bodies).astype(np.float32)
    commands = [{"x": 0.0, "z": 0.3 + k / 640, "yaw": 0.1} for k in range(bodies)]
    history, noise = generator.base.normaliser.forward(clean), noise_of([[k] for k in range(bodies)])
    ours = NumpyRuntime(generator.base, SOLVER)
    eager = TorchRuntime(shipped_base(), SOLVER, torch.device("cpu"))
    walk = Walk(path).eval().requires_grad_(False)
    inputs = [history, noise, walk.adapter.config.conditions(commands).astype(np.float32)]
    tensors, compiled = tuple(map(torch.from_numpy, inputs)), torch.compile(walk)
    with tempfile.TemporaryDirectory() as folder:
        file, names = f"{folder}/walk.onnx", ["history", "noise", "values"]
        torch.onnx.export(walk, tensors, file, input_names=names, dynamo=False)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        session = onnxruntime.InferenceSession(file, options, ["CPUExecutionProvider"])
        fixed = {"INFERENCE_NUM_THREADS": 1, "INFERENCE_PRECISION_HINT": "f32"}
        network = openvino.compile_model(file, "CPU", fixed)
    return {
        "numpy, as shipped": lambda: ours.solve(history, noise, path, commands),
        "torch": lambda: eager.solve(history, noise, path, commands),
        "torch.compile": lambda: compiled(*tensors).numpy(),
        "onnxruntime": lambda: session.run(None, dict(zip(names, inputs, strict=True)))[0],
        "openvino": lambda: network(inputs)[0].copy(),
    }


def main() -> None:
    torch.set_num_threads(1)
    rows: dict[str, list[float]] = {}
    for bodies in (1, 8, 64):
        solves = runtimes(bodies)
        # The first call compiles or reads what later ones keep.
        outputs = {name: solve() for name, solve in solves.items()}
        times: dict[str, list[float]] = {name: [] for name in solves}
        for _ in range(SAMPLES):
            for name, solve in solves.items():
                times[name].append(spent(lambda again=solve, count=64 // bodies: [again() for _ in range(count)]) / 64)
        for name, output in outputs.items():
            difference = np.abs(output - outputs["numpy, as shipped"]).max()
            rows.setdefault(name, []).extend((1e3 * median(times[name]), float(difference)))
    print(json.dumps(rows))


if __name__ == "__main__":
    main()
