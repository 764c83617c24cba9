"""Half-physics on Bullet (paper, section "Locomotion-Decoupled Physical Simulation")."""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanclaw import hookimpl

if TYPE_CHECKING:
    import click

    from humanclaw.hookspecs import Register, SimulatorFactory
    from humanclaw.interfaces import Simulator

__version__ = "0.1.0"


def _simulator(profile: str = "default") -> Simulator:
    from humanclaw_bullet.simulator import HalfPhysics

    return HalfPhysics(profile)


@hookimpl
def humanclaw_simulators(register: Register[SimulatorFactory]) -> None:
    register("bullet", _simulator, "Half-physics on Bullet: driven by pose velocities, carried by contact and gravity.")


@hookimpl
def humanclaw_commands(cli: click.Group) -> None:
    from humanclaw_bullet import command

    cli.add_command(command.physics)
    cli.add_command(command.bench_world)
