import numpy as np
import pytest

from humanclaw.motion import PROFILES, SIGMA_MIN, Solver, flow


def _numbers(*shape: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(shape, np.float32)


@pytest.mark.parametrize("tau", [0.0, 0.5, 0.9])
def test_an_answer_in_clean_frames_means_the_velocity_there(tau):
    clean, noise = _numbers(3, 15, 219), _numbers(3, 15, 219, seed=1)
    velocity = clean - (1 - SIGMA_MIN) * noise
    on_the_way = noise + tau * velocity
    assert flow.velocity("clean", clean, on_the_way, tau) == pytest.approx(velocity, abs=1e-4)
    assert flow.velocity("velocity", velocity, on_the_way, tau) is velocity


@pytest.mark.parametrize("solver", [*(profile.solver for profile in PROFILES.values()), Solver("euler", 3)])
def test_a_solver_told_the_true_velocity_arrives_at_the_future(solver):
    clean, noise = _numbers(2, 15, 219), _numbers(2, 15, 219, seed=1)
    arrived = solver.solve(lambda index, noisy: clean - (1 - SIGMA_MIN) * noise, noise)
    assert np.allclose(arrived, clean, atol=1e-3)


def test_midpoint_is_of_second_order_and_euler_of_first():
    def error(method: str, steps: int) -> float:
        solver = Solver(method, steps)  # dx/dtau = x, whose solution at 1 is e
        arrived = solver.solve(lambda index, x: x, np.ones(1))
        return abs(float(arrived[0]) - np.e)

    assert error("midpoint", 20) < error("midpoint", 10) / 3.5
    assert error("euler", 10) / 2.2 < error("euler", 20) < error("euler", 10) / 1.8


def test_a_solver_asks_for_the_field_at_its_times_in_order():
    asked = []
    solver = Solver("midpoint", 2)
    solver.solve(lambda index, x: asked.append(solver.times[index]) or x, np.zeros(1))
    assert asked == [0.0, 0.25, 0.5, 0.75]


def test_noise_depends_on_its_own_key_alone():
    together = flow.noise_of([(7, 1), (7, 2)])
    assert np.array_equal(together[1], flow.noise_of([(7, 2)])[0])
    assert not np.array_equal(together[0], together[1])
    assert abs(together.mean()) < 0.05
    assert abs(together.std() - 1) < 0.05


def test_a_power_above_one_makes_the_first_steps_short():
    solver = Solver("midpoint", 2, power=2.0)
    assert solver.edges == (0.0, 0.25, 1.0)
    assert solver.times == (0.0, 0.125, 0.25, 0.625)
    assert str(solver) == "midpoint, 2 steps, grid power 2"


def test_the_default_asks_the_field_half_as_often_as_euler_twice():
    assert len(PROFILES["default"].solver.times) <= 6
