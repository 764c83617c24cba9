"""HumanCLAW harness: scripted agents, from the privileged oracle to one that stands still."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from humanclaw import hookimpl

if TYPE_CHECKING:
    from collections.abc import Callable

    from humanclaw import Agent, Verifier
    from humanclaw.plugins import AgentFactory, Register, VerifierFactory
    from humanclaw_scripted.faults import Fault

__version__ = "0.1.0"


@hookimpl
def humanclaw_agents(register: Register[AgentFactory]) -> None:
    register("oracle", _oracle, "privileged route follower; calls the same tools as a model")
    register("random", _random, "a random skill with random parameters each step")
    register("guess", _guess, "answers with an option of the question at random, or with the first: chance")
    register("seeing", _seeing, "depth and ids of its own view, no map, no pose: perfect perception")
    register("wanderer", _wanderer, "walks and turns at random, never stops: chance")
    register("still", _still, "stops at once")
    register("faulty", _faulty, "the oracle without a capability or with limits, for ablations and root causes")


@hookimpl(optionalhook=True)
def humanclaw_faults(register: Callable[[Fault], None]) -> None:
    from humanclaw_scripted.faults import FAULTS

    for fault in FAULTS.values():
        register(fault)


@hookimpl
def humanclaw_verifiers(register: Register[VerifierFactory]) -> None:
    register("oracle", _oracle_verifier, "privileged: rejects a stop out of reach of the target")


def _oracle(options: Mapping[str, Any]) -> Agent:
    from humanclaw.plugins import read_options
    from humanclaw_scripted.meeting import SociableOracle
    from humanclaw_scripted.options import OracleOptions

    return SociableOracle(read_options(OracleOptions, options).words)


def _guess(options: Mapping[str, Any]) -> Agent:
    from humanclaw.plugins import read_options
    from humanclaw_scripted.baselines import GuessingAgent
    from humanclaw_scripted.options import GuessOptions

    return GuessingAgent(read_options(GuessOptions, options).first)


def _random(options: Mapping[str, Any]) -> Agent:
    from humanclaw_scripted.baselines import RandomAgent

    return RandomAgent()


def _seeing(options: Mapping[str, Any]) -> Agent:
    from humanclaw_scripted.frontier_agent import SeeingAgent

    return SeeingAgent()


def _wanderer(options: Mapping[str, Any]) -> Agent:
    from humanclaw_scripted.baselines import WanderingAgent

    return WanderingAgent()


def _still(options: Mapping[str, Any]) -> Agent:
    from humanclaw_scripted.baselines import StillAgent

    return StillAgent()


def _faulty(options: Mapping[str, Any]) -> Agent:
    from humanclaw_scripted.faulty import FaultyAgent
    from humanclaw_scripted.options import FaultyOptions

    return FaultyAgent(FaultyOptions.of(options))


def _oracle_verifier(options: Mapping[str, Any]) -> Verifier:
    from humanclaw.plugins import read_options
    from humanclaw_scripted.faulty import OracleVerifier
    from humanclaw_scripted.options import VerifierOptions

    return OracleVerifier(read_options(VerifierOptions, options))
