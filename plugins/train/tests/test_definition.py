"""Tests that the motion model in torch and the runtime without torch compute the same."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from tiny_motion import WALK

from humanclaw.body import Motion, decode, encode
from humanclaw.motion import (
    PROFILES,
    SIZES,
    AdapterConfig,
    DiTGenerator,
    ModelConfig,
    Solver,
    noise_of,
    shipped_base,
    velocity,
)
from humanclaw_train.eval.rollouts import Command, adapters
from humanclaw_train.model.checkpoint import load_adapter, load_base
from humanclaw_train.model.control import Adapter
from humanclaw_train.model.dit import DiT, Modulations

SHIPPED = adapters([Path(__file__).parents[3] / "skills"])


def _shaken(module, seed: int):
    """Add random numbers to every weight, so that no branch is silent because it starts at zero."""
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in module.parameters():
            parameter.add_(0.05 * torch.randn(parameter.shape, generator=generator))
    return module


def _inputs() -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(0)
    history, noisy = (torch.randn(2, frames, 219, generator=generator) for frames in (5, 15))
    return history, noisy, torch.tensor([0.2, 0.7])


def test_the_papers_size_has_38_million_parameters():
    """A block has 7 h^2 in its modulations and 8 h^2 beside them, so ten with h = 512 have nearly 37 million."""
    size = SIZES["paper"]
    assert (size.layers, size.heads, size.prediction) == (10, 8, "velocity")
    base = DiT(size)
    assert sum(weights.numel() for weights in base.parameters()) == pytest.approx(38e6, rel=0.01)
    blocks = sum(weights.numel() for weights in base.blocks.parameters())
    encoder = 2 * 512 + 512 * 513  # One number to the width, and once more to the width; each with biases.
    adapter = Adapter(base, AdapterConfig("side_step", "mlp", ("x",), (0.0,), (0.2,)))
    assert sum(weights.numel() for weights in adapter.parameters()) == blocks + 10 * 512**2 + encoder


def test_the_papers_solver_takes_30_midpoint_steps_through_the_flow():
    solver = PROFILES["paper"].solver
    assert (solver.method, solver.steps, len(solver.times)) == ("midpoint", 30, 60)
    np.testing.assert_allclose(solver.times, np.arange(60) / 60, atol=1e-12)


@pytest.mark.parametrize("prediction", ["clean", "velocity"])
def test_an_untrained_adapter_leaves_every_bit_of_the_base(prediction):
    base = _shaken(DiT(ModelConfig(32, 3, 4, prediction=prediction)), seed=1)
    adapter = Adapter(base, WALK)
    history, noisy, tau = _inputs()
    residual = adapter.residual(adapter.condition(torch.randn(2, 3)), adapter.modulations(base, tau))
    alone, together = (base(history, noisy, base.modulations(tau), branch) for branch in (None, residual))
    assert torch.equal(alone, together)


def test_only_the_control_branch_learns():
    base = _shaken(DiT(ModelConfig(32, 2, 4, prediction="clean")), seed=1).requires_grad_(False)
    adapter = Adapter(base, WALK)
    before = {name: value.clone() for name, value in base.state_dict().items()}
    optimiser = torch.optim.SGD(adapter.parameters(), lr=0.1)
    history, noisy, tau = _inputs()
    for _ in range(2):  # The zero weights move first; the layers behind them follow.
        residual = adapter.residual(adapter.condition(torch.randn(2, 3)), adapter.modulations(base, tau))
        base(history, noisy, base.modulations(tau), residual).square().mean().backward()
        optimiser.step()
    assert all(torch.equal(value, before[name]) for name, value in base.state_dict().items())
    assert all(layer.weight.count_nonzero() > 0 for layer in adapter.weights)
    assert adapter.encode[-1].weight.grad.abs().max() > 0


def test_an_untrained_clean_model_holds_the_last_pose():
    model = DiT(ModelConfig(32, 2, 4, prediction="clean"))
    history, noisy, tau = _inputs()
    assert torch.equal(model(history, noisy, model.modulations(tau)), history[:, -1:].expand(-1, 15, -1))


def _defined(history: Motion, adapter_file: Path | None, values: dict[str, float], key: int, solver: Solver) -> Motion:
    """Generate with the definition. history: five frames at the origin, facing +Z."""
    base, times = load_base(shipped_base()), torch.tensor(solver.times)
    own, branch = base.model.modulations(times), None
    if adapter_file is not None:
        adapter = load_adapter(adapter_file, base)
        condition, branch = (
            adapter.condition(torch.tensor([[values[name] for name in adapter.config.params]])),
            adapter.modulations(base.model, times),
        )
    state = base.normaliser.forward(torch.from_numpy(encode(history)).float())[None]

    def field(index: int, noisy: torch.Tensor) -> torch.Tensor:
        part = slice(index, index + 1)
        residual = None if branch is None else adapter.residual(condition, branch[:, :, part])
        output = base.model(state, noisy, Modulations(own.blocks[:, :, part], own.final[:, part]), residual)
        return velocity(base.model.config.prediction, output, noisy, times[part])

    future = solver.solve(field, torch.from_numpy(noise_of([(key,)])))
    return decode(base.normaliser.inverse(future)[0].numpy())


@pytest.mark.parametrize(
    ("skill", "profile"), [*((skill, "default") for skill in [*SHIPPED, "base"]), ("base", "paper")]
)
def test_the_runtime_generates_what_the_definition_does(skill, profile):
    path, solver = SHIPPED.get(skill), PROFILES[profile].solver
    command = Command.of(skill, path) if path else None
    values = command.named(command.draw(1, np.random.default_rng(0))[0]) if command else {}
    generator = DiTGenerator(DiTGenerator.load().base, replace(PROFILES["paper"], solver=solver))
    run = generator.generate(generator.start(), path, values, (3,))
    defined = _defined(generator.start(), path, values, 3, solver)
    assert np.abs(run.root - defined.root).max() < 1e-5
    assert np.abs(run.rotations - defined.rotations).max() < 1e-5
