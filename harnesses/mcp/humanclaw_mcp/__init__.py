"""HumanCLAW harness: a Model Context Protocol server. Any MCP client gets the skills as tools."""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanclaw import hookimpl

if TYPE_CHECKING:
    import click

__version__ = "0.1.0"


@hookimpl
def humanclaw_commands(cli: click.Group) -> None:
    from humanclaw.cli import LazyCommand

    help_text = "Serve the skills to agents over the Model Context Protocol."
    cli.add_command(LazyCommand("mcp", "humanclaw_mcp.command:command", help_text))
