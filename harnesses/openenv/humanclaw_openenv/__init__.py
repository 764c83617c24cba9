"""HumanCLAW harness: the body as an OpenEnv environment, and as an environment of TRL."""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanclaw import hookimpl

if TYPE_CHECKING:
    import click

__version__ = "0.1.0"


@hookimpl
def humanclaw_commands(cli: click.Group) -> None:
    from humanclaw.cli import LazyCommand

    sentence = "Serve training tasks to OpenEnv clients."
    cli.add_command(LazyCommand("openenv", "humanclaw_openenv.command:command", sentence))
