"""HumanCLAW agent: pilot, whose eyes were trained here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from humanclaw import hookimpl

if TYPE_CHECKING:
    import click

    from humanclaw import Agent
    from humanclaw.plugins import AgentFactory, Register

__version__ = "0.1.0"


@hookimpl
def humanclaw_agents(register: Register[AgentFactory]) -> None:
    register("pilot", _pilot, "its own picture alone, by a small network that was trained here")


@hookimpl
def humanclaw_commands(cli: click.Group) -> None:
    from humanclaw.cli import LazyCommand

    about = "Train the eyes of the agent pilot: make data, train, measure."
    cli.add_command(LazyCommand("pilot", "humanclaw_pilot.command:command", about))


def _pilot(options: Mapping[str, Any]) -> Agent:
    from humanclaw_pilot.agent import PilotAgent

    return PilotAgent(options)
