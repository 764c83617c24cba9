"""An agent with a known fault, for `humanclaw bench counterfactual`: it stops at once, wherever it is."""

from collections.abc import Callable
from types import SimpleNamespace

from humanclaw import hookimpl

SLEEPER = SimpleNamespace(
    name="sleeper",
    description="stops at once, wherever it is",
    capability="ego-spatial distance",
    cause="nav: stop while far",
    agent="still",
    options={},
    fits=lambda spec: True,
)


@hookimpl(optionalhook=True)
def humanclaw_faults(register: Callable[[SimpleNamespace], None]) -> None:
    register(SLEEPER)
