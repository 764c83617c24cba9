import pytest

torch = pytest.importorskip("torch")

from humanclaw.motion import Normaliser, velocity
from humanclaw_train.model import flow


def _numbers(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(shape, generator=torch.Generator().manual_seed(seed))


def test_the_path_begins_in_noise_and_ends_at_the_clean_future():
    clean, noise = _numbers(2, 15, 219), _numbers(2, 15, 219, seed=1)
    assert torch.equal(flow.noised(clean, noise, torch.zeros(2)), noise)
    end = flow.noised(clean, noise, torch.ones(2))
    assert torch.allclose(end - clean, flow.SIGMA_MIN * noise, atol=1e-6)


def test_the_target_is_the_derivative_of_the_path():
    clean, noise = _numbers(1, 15, 219).double(), _numbers(1, 15, 219, seed=1).double()
    before, after = (flow.noised(clean, noise, torch.tensor([tau], dtype=torch.float64)) for tau in (0.3, 0.5))
    assert torch.allclose((after - before) / 0.2, flow.target(clean, noise))


def test_an_answer_in_clean_frames_and_one_in_velocities_agree():
    clean, noise, tau = _numbers(3, 15, 219), _numbers(3, 15, 219, seed=1), torch.tensor([0.0, 0.5, 0.9])
    noisy, target = flow.noised(clean, noise, tau), flow.target(clean, noise)
    assert torch.allclose(velocity("clean", clean, noisy, tau[:, None, None]), target, atol=1e-5)
    assert torch.allclose(flow.clean("velocity", target, noisy, tau), clean, atol=1e-5)


def test_the_plain_loss_is_the_mean_square_of_the_model_s_error():
    normaliser = Normaliser(torch.zeros(219), torch.ones(219))
    output, wanted, states = _numbers(2, 15, 219), _numbers(2, 15, 219, seed=1), _numbers(2, 20, 219, seed=2)
    plain = flow.Loss(normaliser, flow.PLAIN)(output, wanted, output, states)
    assert torch.allclose(plain, (output - wanted).square().mean())
    assert flow.Loss(normaliser, flow.FULL)(output, wanted, output, states) > 2 * plain
