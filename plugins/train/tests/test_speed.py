"""Tests of timing and its table."""

import pytest

torch = pytest.importorskip("torch")

from humanclaw.motion import SIZES, ModelConfig, Solver
from humanclaw_train.eval import speed
from humanclaw_train.eval.speed import SOLVERS, Timing, markdown, measure


@pytest.fixture(autouse=True)
def _small(monkeypatch):
    monkeypatch.setitem(SIZES, "lite", ModelConfig(32, 1, 4, prediction="clean"))
    monkeypatch.setattr(speed, "_ENOUGH", 0.0)


def test_more_evaluations_take_longer_and_many_bodies_less_each():
    one = list(measure("lite", 1, 1, [Solver("euler", 2), Solver("midpoint", 30)], ["torch"]))
    assert one[1].cpu > 5 * one[0].cpu
    (many,) = measure("lite", 1, 16, [Solver("euler", 2)], ["torch"])
    assert many.cpu < one[0].cpu


def test_measuring_leaves_the_number_of_threads_as_it_was():
    before = torch.get_num_threads()
    list(measure("lite", before + 1, 1, [Solver("euler", 1)], ["torch"]))
    assert torch.get_num_threads() == before


def test_numpy_takes_one_thread_and_torch_those_that_it_is_given():
    timings = measure("lite", 2, 1, [Solver("euler", 1)], ["numpy", "torch"])
    assert [(one.runtime, one.threads) for one in timings] == [("numpy", 1), ("torch", 2)]


def test_the_table_has_a_column_for_each_solver():
    timings = [
        Timing("lite", "torch", 1, SOLVERS[0], 1, 18.04, 17.0),
        Timing("lite", "torch", 1, Solver("midpoint", 30), 1, 250.0, 240.0),
        Timing("paper", "torch", 2, SOLVERS[0], 1, 300.0, 500.0),
    ]
    assert "| lite | torch | 1 | 1 | 18.0 (17.0) | 250.0 (240.0) |" in markdown(timings)
    assert "| paper | torch | 2 | 1 | 300.0 (500.0) | - |" in markdown(timings)
