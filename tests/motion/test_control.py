import pytest
import torch

from humanclaw.motion.control import Adapter, AdapterConfig
from humanclaw.motion.dit import DiT, ModelConfig

WALK = AdapterConfig("walk", "fourier", ("x", "z", "yaw"), (0.0, 0.4, 0.0), (0.3, 0.4, 0.5))


def _inputs() -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(0)
    history, noisy = (torch.randn(2, frames, 219, generator=generator) for frames in (5, 15))
    return history, noisy, torch.tensor([0.2, 0.7])


@pytest.mark.parametrize("prediction", ["clean", "velocity"])
def test_an_untrained_adapter_leaves_every_bit_of_the_base(shaken, prediction):
    base = shaken(DiT(ModelConfig(32, 3, 4, prediction=prediction)), seed=1)
    adapter = Adapter(base, WALK)
    history, noisy, tau = _inputs()
    residual = adapter.residual(adapter.condition(torch.randn(2, 3)), adapter.modulations(base, tau))
    alone, together = (base(history, noisy, base.modulations(tau), branch) for branch in (None, residual))
    assert torch.equal(alone, together)


def test_only_the_control_branch_learns(shaken):
    base = shaken(DiT(ModelConfig(32, 2, 4, prediction="clean")), seed=1).requires_grad_(False)
    adapter = Adapter(base, WALK)
    before = {name: value.clone() for name, value in base.state_dict().items()}
    optimiser = torch.optim.SGD(adapter.parameters(), lr=0.1)
    history, noisy, tau = _inputs()
    for _ in range(2):  # the zero weights move first, what lies behind them after that
        residual = adapter.residual(adapter.condition(torch.randn(2, 3)), adapter.modulations(base, tau))
        base(history, noisy, base.modulations(tau), residual).square().mean().backward()
        optimiser.step()
    assert all(torch.equal(value, before[name]) for name, value in base.state_dict().items())
    assert all(layer.weight.count_nonzero() > 0 for layer in adapter.weights)
    assert adapter.encode[-1].weight.grad.abs().max() > 0


def test_a_trained_branch_answers_to_its_condition(shaken):
    base = shaken(DiT(ModelConfig(32, 2, 4, prediction="clean")), seed=1)
    adapter = shaken(Adapter(base, WALK), seed=2)
    history, noisy, tau = _inputs()
    outputs = [
        base(
            history,
            noisy,
            base.modulations(tau),
            adapter.residual(adapter.condition(values), adapter.modulations(base, tau)),
        )
        for values in (torch.zeros(2, 3), torch.ones(2, 3))
    ]
    assert not torch.allclose(*outputs)


def test_an_untrained_clean_model_holds_the_last_pose():
    model = DiT(ModelConfig(32, 2, 4, prediction="clean"))
    history, noisy, tau = _inputs()
    assert torch.equal(model(history, noisy, model.modulations(tau)), history[:, -1:].expand(-1, 15, -1))


@pytest.mark.parametrize(("encoder", "params"), [("token", ("x",)), ("mlp", ()), ("conv", ("x",))])
def test_an_encoder_that_does_not_suit_its_parameters_is_refused(encoder, params):
    with pytest.raises(ValueError, match="encoder"):
        AdapterConfig("x", encoder, params, (0.0,) * len(params), (1.0,) * len(params))


def test_the_papers_size_is_the_papers():
    model = DiT(ModelConfig(512, 10, 8))
    millions = sum(parameter.numel() for parameter in model.parameters()) / 1e6
    assert 36 < millions < 44
