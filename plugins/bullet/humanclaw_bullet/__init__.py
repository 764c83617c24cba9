"""Half-physics on Bullet (paper, section "Locomotion-Decoupled Physical Simulation")."""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING

from humanclaw import hookimpl

if TYPE_CHECKING:
    from humanclaw import Simulator
    from humanclaw.plugins import Register, SimulatorFactory
    from humanclaw.world import Profile

__version__ = "0.1.0"


def _simulator(profile: str | Profile = "default") -> Simulator:
    from humanclaw_bullet.world import bullet

    return bullet(profile)


@hookimpl
def humanclaw_simulators(register: Register[SimulatorFactory]) -> None:
    # PyBullet has no wheels for the newest Pythons. Without it, this simulator is not registered.
    if importlib.util.find_spec("pybullet"):
        register(
            "bullet", _simulator, "Half-physics on Bullet: driven by pose velocities, carried by contact and gravity."
        )
