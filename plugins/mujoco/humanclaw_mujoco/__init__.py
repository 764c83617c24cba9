"""Half-physics on MuJoCo (paper, section "Locomotion-Decoupled Physical Simulation")."""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanclaw import hookimpl

if TYPE_CHECKING:
    from humanclaw import Simulator
    from humanclaw.plugins import Register, SimulatorFactory
    from humanclaw.world import Profile

__version__ = "0.1.0"


def _simulator(profile: str | Profile = "default") -> Simulator:
    from humanclaw_mujoco.world import mujoco

    return mujoco(profile)


def _kinematic(profile: str | Profile = "default") -> Simulator:
    from humanclaw_mujoco.world import kinematic

    return kinematic(profile)


@hookimpl
def humanclaw_simulators(register: Register[SimulatorFactory]) -> None:
    register("mujoco", _simulator, "Half-physics on MuJoCo: installs on every supported Python and system.")
    register("kinematic", _kinematic, "No physics: motion is played back through walls, a baseline.")
