"""The core's own plugin: commands, rewards and the motion generator, registered through the public hooks."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from humanclaw.plugins.hookspecs import hookimpl

if TYPE_CHECKING:
    from pathlib import Path

    import click

    from humanclaw.motion.generator import MotionGenerator
    from humanclaw.plugins.hookspecs import GeneratorFactory, Register, Reward, SceneFactory
    from humanclaw.world.scene import Scene

_COMMANDS = (
    ("check", "check:check", "Check skills against the contract, and play them."),
    ("play", "play_skill:play", "Play one skill with these parameters, and film it."),
    ("skills", "show:skills", "List the skills: parameters, adapter, where they come from."),
    ("plugins", "show:plugins_command", "List the plugins, what they provide, and why one is disabled."),
    ("tools", "show:tools", "Print the skills as the tool list of a model's interface."),
    ("physics", "physics:physics", "Run the physics checks of half-physics."),
    ("doctor", "doctor:doctor", "Show what is installed, what is missing, and how to get it."),
    ("new", "new:new", "Begin a skill, agent, scene ... of your own."),
)


@hookimpl
def humanclaw_motion_generators(register: Register[GeneratorFactory]) -> None:
    register("dit", _dit, "flow-matching DiT with ControlNet adapters (paper, section 3.3)")


@hookimpl
def humanclaw_priors(register: Register[Path]) -> None:
    from humanclaw.motion.checkpoint import shipped_base

    register("lite", shipped_base(), "The shipped motion prior: 3.35 M parameters.")


@hookimpl
def humanclaw_scenes(register: Register[SceneFactory]) -> None:
    register("floor", _floor, "an empty floor of 20 by 20 metres")


@hookimpl
def humanclaw_rewards(register: Register[Reward]) -> None:
    from humanclaw.minds.rewards import REWARDS

    for name, (reward, told) in REWARDS.items():
        register(name, reward, told)


@hookimpl
def humanclaw_commands(cli: click.Group) -> None:
    from humanclaw.cli import LazyCommand

    for name, target, told in _COMMANDS:
        cli.add_command(LazyCommand(name, f"humanclaw.cli.{target}", told))


def _dit(profile: str = "default", prior: Path | None = None) -> MotionGenerator:
    from humanclaw.motion.generator import DiTGenerator

    return DiTGenerator.load(prior, profile)


def _floor(argument: str) -> Scene:
    from humanclaw.testing.scenes import SceneBuilder

    builder = SceneBuilder.on_floor()
    return replace(builder.scene(), name="floor")
