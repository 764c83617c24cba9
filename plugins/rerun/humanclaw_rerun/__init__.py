"""HumanCLAW plugin: recorded episodes as recordings of the Rerun viewer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanclaw import hookimpl

if TYPE_CHECKING:
    import click

__version__ = "0.1.0"


@hookimpl
def humanclaw_commands(cli: click.Group) -> None:
    from humanclaw.cli import LazyCommand

    about = "Write recorded episodes for the Rerun viewer."
    cli.add_command(LazyCommand("rerun", "humanclaw_rerun.command:rerun", about))
