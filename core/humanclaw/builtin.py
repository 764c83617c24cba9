"""What the core itself brings, registered through the same hooks as everybody else's plugins."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from humanclaw.hookspecs import RegisterFactory, hookimpl

if TYPE_CHECKING:
    import click

    from humanclaw.interfaces import DecisionMaker, MotionGenerator


@hookimpl
def humanclaw_motion_generators(register: RegisterFactory) -> None:
    register("dit", _dit, "flow-matching DiT with ControlNet adapters (paper, section 3.3)")


@hookimpl
def humanclaw_decision_makers(register: RegisterFactory) -> None:
    register("oracle", _oracle, "privileged route follower; calls the same tools as a model")
    register("random", _random, "a random skill with random parameters each step")
    register("still", _still, "stops at once")


@hookimpl
def humanclaw_commands(cli: click.Group) -> None:
    from humanclaw.cli import bench, run, show, train

    for command in (
        run.run, show.skills, show.plugins_command, show.tools, show.report, train.train, train.fidelity, train.data,
        bench.bench,
    ):  # fmt: skip
        cli.add_command(command)


def _dit(profile: str = "default") -> MotionGenerator:
    from humanclaw.motion.generator import DiTGenerator

    return DiTGenerator.shipped(profile)


def _oracle(options: Mapping[str, Any]) -> DecisionMaker:
    from humanclaw.bench.agents import OracleAgent

    return OracleAgent()


def _random(options: Mapping[str, Any]) -> DecisionMaker:
    from humanclaw.bench.agents import RandomAgent

    return RandomAgent()


def _still(options: Mapping[str, Any]) -> DecisionMaker:
    from humanclaw.bench.agents import StillAgent

    return StillAgent()
