"""The metric, by hand."""

from math import isnan
from types import SimpleNamespace

from humanclaw import Call, Plugins, StepRecord
from humanclaw_example import example


def step(number, end, status="executed"):
    call = Call("amble") if status == "executed" else None
    return StepRecord(step=number, status=status, attempts=(), call=call, start=(0.0, 0.9, 0.0), end=end)


def test_it_is_the_mean_over_executed_steps():
    steps = (step(0, (0.3, 0.9, 0.4)), step(1, (0.0, 0.9, 0.1)), step(2, (9.0, 0.9, 9.0), "invalid"))
    assert round(example(SimpleNamespace(steps=steps)), 6) == (0.5 + 0.1) / 2


def test_it_does_not_apply_to_an_episode_without_a_step():
    assert isnan(example(SimpleNamespace(steps=())))


def test_it_is_found_once_it_is_installed():
    assert "example" in {info.name for info in Plugins.discover().infos}
