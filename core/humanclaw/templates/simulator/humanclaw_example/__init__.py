"""DESCRIPTION"""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanclaw import hookimpl

if TYPE_CHECKING:
    from humanclaw import Simulator
    from humanclaw.hookspecs import Register, SimulatorFactory

__version__ = "0.1.0"


@hookimpl
def humanclaw_simulators(register: Register[SimulatorFactory]) -> None:
    register("example", _simulator, "the body does what it is told: no contact, no gravity")


def _simulator(profile: str = "default") -> Simulator:
    from humanclaw_example.world import ExampleWorld

    return ExampleWorld()
