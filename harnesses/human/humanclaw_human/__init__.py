"""HumanCLAW harness: a person at the keyboard decides what the body does."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from humanclaw import hookimpl

if TYPE_CHECKING:
    from humanclaw import Agent
    from humanclaw.plugins import AgentFactory, Register

__version__ = "0.1.0"


@hookimpl
def humanclaw_agents(register: Register[AgentFactory]) -> None:
    register("human", _human, "a person at the keyboard, with the view in the browser")


def _human(options: Mapping[str, Any]) -> Agent:
    from humanclaw_human.person import Person, Settings

    return Person(Settings.of(options))
