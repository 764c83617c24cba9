"""What the core itself brings, registered through the same hooks as everybody else's plugins."""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanclaw.hookspecs import hookimpl

if TYPE_CHECKING:
    import click

    from humanclaw.hookspecs import GeneratorFactory, Register
    from humanclaw.interfaces import MotionGenerator


@hookimpl
def humanclaw_motion_generators(register: Register[GeneratorFactory]) -> None:
    register("dit", _dit, "flow-matching DiT with ControlNet adapters (paper, section 3.3)")


@hookimpl
def humanclaw_commands(cli: click.Group) -> None:
    from humanclaw.cli import check, new, physics, run, show

    looking = (check.check, show.skills, show.plugins_command, show.tools)
    commands = (run.run, *looking, physics.physics, physics.bench_world, new.new)
    for command in commands:
        cli.add_command(command)


def _dit(profile: str = "default") -> MotionGenerator:
    from humanclaw.motion.generator import DiTGenerator

    return DiTGenerator.shipped(profile)
