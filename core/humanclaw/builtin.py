"""The core's own plugin: commands, rewards and the motion generator, registered through the public hooks."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from humanclaw.plugins.hookspecs import hookimpl

if TYPE_CHECKING:
    from pathlib import Path

    import click

    from humanclaw.motion.protocol import MotionGenerator
    from humanclaw.plugins.hookspecs import GeneratorFactory, Register, Reward, SceneFactory
    from humanclaw.records.transition import Transition
    from humanclaw.world.scene import Scene

_COMMANDS = (
    ("check", "check:check", "Check skills against the contract, and play them."),
    ("play", "play:play", "Play one skill with these parameters, and film it."),
    ("skills", "show:skills", "List the skills: parameters, adapter, where they come from."),
    ("plugins", "show:plugins_command", "List the plugins: what each provides, and how to get others."),
    ("tools", "show:tools", "Print the skills as the tool list of a model's interface."),
    ("physics", "physics:physics", "Check that simulators obey the laws of half-physics."),
    ("new", "new:new", "Begin a skill, agent, scene ... of your own."),
)

_REWARDS = {
    "success": "1 for a stop at the target, seated on it if the task says so",
    "progress": "metres by which the step shortened the way to the target",
    "honest": "-1 for a false claim to see the target, 1 for the first true one",
    "seen": "1 for a stop with the target in view and words that say so",
    "touch": "1 for a stop whose reasoning names what touched the body",
    "contact": "-1 for a step that touches anything but the target",
    "verifier": "-1 for a call that the verifier replaced",
}
"""Name to description of the functions in humanclaw.gym.rewards, which load when a reward is asked for."""


@hookimpl
def humanclaw_motion_generators(register: Register[GeneratorFactory]) -> None:
    register("dit", _dit, "flow-matching DiT with ControlNet adapters (paper, section 3.3)")


@hookimpl
def humanclaw_priors(register: Register[Path]) -> None:
    from humanclaw.motion.checkpoint import shipped_base

    register("lite", shipped_base(), "The shipped motion prior: 3.35 M parameters.")


@hookimpl
def humanclaw_scenes(register: Register[SceneFactory]) -> None:
    register("floor", _floor, "a tiled floor; floor:up=0.18,0.28,3 has stairs, floor:sit=0.5 a bench")


@hookimpl
def humanclaw_rewards(register: Register[Reward]) -> None:
    for name, about in _REWARDS.items():
        register(name, partial(_reward, name), about)


@hookimpl
def humanclaw_commands(cli: click.Group) -> None:
    from humanclaw.cli import LazyCommand

    for name, target, sentence in _COMMANDS:
        cli.add_command(LazyCommand(name, f"humanclaw.cli.{target}", sentence))


def _reward(name: str, transition: Transition) -> float:
    from humanclaw.gym import rewards

    return float(getattr(rewards, name)(transition))


def _dit(profile: str = "default", prior: Path | None = None) -> MotionGenerator:
    from humanclaw.motion.generator import DiTGenerator

    return DiTGenerator.load(prior, profile)


def _floor(argument: str) -> Scene:
    from humanclaw.skills.floor_scenes import floor_scene

    return floor_scene(argument)
