"""HumanCLAW harness: scripted agents, from the privileged oracle down to standing still."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from humanclaw import hookimpl

if TYPE_CHECKING:
    from humanclaw.hookspecs import RegisterFactory
    from humanclaw.interfaces import Agent, Verifier

__version__ = "0.1.0"


@hookimpl
def humanclaw_agents(register: RegisterFactory) -> None:
    register("oracle", _oracle, "privileged route follower; calls the same tools as a model")
    register("random", _random, "a random skill with random parameters each step")
    register("still", _still, "stops at once")
    register("faulty", _faulty, "the oracle with a faculty missing or a bounded mind, for ablations and root causes")


@hookimpl
def humanclaw_verifiers(register: RegisterFactory) -> None:
    register("oracle", _oracle_verifier, "privileged: lets nobody stop out of reach of the target")


def _oracle(options: Mapping[str, Any]) -> Agent:
    from humanclaw_scripted.agents import OracleAgent

    return OracleAgent()


def _random(options: Mapping[str, Any]) -> Agent:
    from humanclaw_scripted.agents import RandomAgent

    return RandomAgent()


def _still(options: Mapping[str, Any]) -> Agent:
    from humanclaw_scripted.agents import StillAgent

    return StillAgent()


def _faulty(options: Mapping[str, Any]) -> Agent:
    from humanclaw_scripted import faulty

    return faulty.FaultyAgent(faulty.options(options))


def _oracle_verifier(options: Mapping[str, Any]) -> Verifier:
    from humanclaw_scripted.faulty import OracleVerifier

    return OracleVerifier(options)
