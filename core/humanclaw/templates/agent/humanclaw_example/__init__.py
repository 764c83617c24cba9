"""DESCRIPTION"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from humanclaw import hookimpl

if TYPE_CHECKING:
    from humanclaw import Agent
    from humanclaw.hookspecs import AgentFactory, Register

__version__ = "0.1.0"


@hookimpl
def humanclaw_agents(register: Register[AgentFactory]) -> None:
    register("example", _agent, "walks straight on, and stops after ten steps")


def _agent(options: Mapping[str, Any]) -> Agent:
    from humanclaw_example.agent import ExampleAgent

    return ExampleAgent()
