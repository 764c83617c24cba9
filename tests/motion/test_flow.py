import numpy as np
import pytest
import torch

from humanclaw.motion import flow
from humanclaw.motion.flow import PROFILES, Solver


def _numbers(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(shape, generator=torch.Generator().manual_seed(seed))


def test_the_path_begins_in_noise_and_ends_within_sigma_of_the_clean_future():
    clean, noise = _numbers(2, 15, 219), _numbers(2, 15, 219, seed=1)
    assert torch.equal(flow.noised(clean, noise, torch.zeros(2)), noise)
    end = flow.noised(clean, noise, torch.ones(2))
    assert torch.allclose(end - clean, flow.SIGMA_MIN * noise, atol=1e-6)


def test_the_target_is_the_derivative_of_the_path():
    clean, noise = _numbers(1, 15, 219).double(), _numbers(1, 15, 219, seed=1).double()
    before, after = (flow.noised(clean, noise, torch.tensor([tau], dtype=torch.float64)) for tau in (0.3, 0.5))
    assert torch.allclose((after - before) / 0.2, flow.target(clean, noise))


def test_an_answer_in_clean_frames_and_one_in_velocities_mean_the_same():
    clean, noise, tau = _numbers(3, 15, 219), _numbers(3, 15, 219, seed=1), torch.tensor([0.0, 0.5, 0.9])
    noisy, target = flow.noised(clean, noise, tau), flow.target(clean, noise)
    assert torch.allclose(flow.velocity("clean", clean, noisy, tau), target, atol=1e-5)
    assert torch.allclose(flow.clean("velocity", target, noisy, tau), clean, atol=1e-5)


@pytest.mark.parametrize("solver", [*PROFILES.values(), Solver("euler", 3)])
def test_a_solver_that_is_told_the_true_velocity_arrives_at_the_clean_future(solver):
    clean, noise = _numbers(2, 15, 219), _numbers(2, 15, 219, seed=1)
    arrived = solver.solve(lambda index, noisy: flow.target(clean, noise), noise)
    assert torch.allclose(arrived, clean, atol=1e-3)


def test_midpoint_is_of_second_order_and_euler_of_first():
    def error(method: str, steps: int) -> float:
        solver = Solver(method, steps)  # dx/dtau = x, whose solution at 1 is e
        arrived = solver.solve(lambda index, x: x, torch.ones(1))
        return abs(float(arrived) - np.e)

    assert error("midpoint", 20) < error("midpoint", 10) / 3.5
    assert error("euler", 10) / 2.2 < error("euler", 20) < error("euler", 10) / 1.8


def test_a_solver_asks_for_the_field_at_its_times_in_order():
    asked = []
    solver = Solver("midpoint", 2)
    solver.solve(lambda index, x: asked.append(solver.times[index]) or x, torch.zeros(1))
    assert asked == [0.0, 0.25, 0.5, 0.75]


def test_noise_depends_on_its_own_key_alone():
    together = flow.noise_of([(7, 1), (7, 2)])
    assert torch.equal(together[1], flow.noise_of([(7, 2)])[0])
    assert not torch.equal(together[0], together[1])
    assert abs(float(together.mean())) < 0.05
    assert abs(float(together.std()) - 1) < 0.05


def test_a_power_above_one_makes_the_first_steps_short():
    solver = Solver("midpoint", 2, power=2.0)
    assert solver.edges == (0.0, 0.25, 1.0)
    assert solver.times == (0.0, 0.125, 0.25, 0.625)
    assert str(solver) == "midpoint, 2 steps, grid power 2"


def test_the_default_asks_the_field_at_most_half_as_often_again_as_four_euler_steps():
    assert len(PROFILES["default"].times) <= 6
