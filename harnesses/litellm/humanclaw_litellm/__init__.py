"""HumanCLAW harness: a model that litellm can reach chooses and verifies the body's calls (paper, section 3.2)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from humanclaw import hookimpl

if TYPE_CHECKING:
    from humanclaw import Agent, Verifier
    from humanclaw.plugins import AgentFactory, Register, VerifierFactory

__version__ = "0.1.0"


@hookimpl
def humanclaw_agents(register: Register[AgentFactory]) -> None:
    register("litellm", _agent, "a vision-language model of any provider that litellm knows")


@hookimpl
def humanclaw_verifiers(register: Register[VerifierFactory]) -> None:
    register(
        "litellm",
        _verifier,
        "asks a model the skill's checklist about the current view (paper, appendix A)",
    )


def _agent(options: Mapping[str, Any]) -> Agent:
    from humanclaw_litellm.decision import ModelAgent
    from humanclaw_litellm.settings import Settings

    return ModelAgent(Settings.of(options))


def _verifier(options: Mapping[str, Any]) -> Verifier:
    from humanclaw_litellm.settings import Settings
    from humanclaw_litellm.verifier import ModelVerifier

    return ModelVerifier(Settings.of_verifier(options))
