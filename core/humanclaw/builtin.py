"""What the core itself brings, registered through the same hooks as everybody else's plugins."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from humanclaw.hookspecs import RegisterFactory, hookimpl

if TYPE_CHECKING:
    import click

    from humanclaw.bench.executors import Executor
    from humanclaw.interfaces import DecisionMaker, MotionGenerator, Verifier


@hookimpl
def humanclaw_motion_generators(register: RegisterFactory) -> None:
    register("dit", _dit, "flow-matching DiT with ControlNet adapters (paper, section 3.3)")


@hookimpl
def humanclaw_decision_makers(register: RegisterFactory) -> None:
    register("oracle", _oracle, "privileged route follower; calls the same tools as a model")
    register("random", _random, "a random skill with random parameters each step")
    register("still", _still, "stops at once")
    register("faulty", _faulty, "the oracle with a faculty missing or a bounded mind, for ablations and root causes")


@hookimpl
def humanclaw_verifiers(register: RegisterFactory) -> None:
    register("oracle", _oracle_verifier, "privileged: lets nobody stop out of reach of the target")


@hookimpl
def humanclaw_executors(register: RegisterFactory) -> None:
    register("local", _local, "processes of this machine")


@hookimpl
def humanclaw_commands(cli: click.Group) -> None:
    from humanclaw.cli import bench, evidence, run, show, train

    for command in (
        run.run, show.skills, show.plugins_command, show.tools, show.report, train.train, train.fidelity, train.naturalness,
        train.speed, train.cards, train.data,
        bench.bench,
    ):  # fmt: skip
        cli.add_command(command)
    for command in (evidence.ablate, evidence.rescue_command):
        bench.bench.add_command(command)


def _dit(profile: str = "default") -> MotionGenerator:
    from humanclaw.motion.generator import DiTGenerator

    return DiTGenerator.shipped(profile)


def _local(workers: int = 1, address: str = "") -> Executor:
    from humanclaw.bench.executors import local

    return local(workers, address)


def _oracle(options: Mapping[str, Any]) -> DecisionMaker:
    from humanclaw.bench.agents import OracleAgent

    return OracleAgent()


def _random(options: Mapping[str, Any]) -> DecisionMaker:
    from humanclaw.bench.agents import RandomAgent

    return RandomAgent()


def _faulty(options: Mapping[str, Any]) -> DecisionMaker:
    from humanclaw.bench import faulty

    return faulty.FaultyAgent(faulty.options(options))


def _oracle_verifier(options: Mapping[str, Any]) -> Verifier:
    from humanclaw.bench.faulty import OracleVerifier

    return OracleVerifier(options)


def _still(options: Mapping[str, Any]) -> DecisionMaker:
    from humanclaw.bench.agents import StillAgent

    return StillAgent()
