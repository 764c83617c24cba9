"""Hooks of this distribution. A module of its own, because the package must import without a plugin host."""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanclaw import hookimpl

if TYPE_CHECKING:
    import click


@hookimpl
def humanclaw_commands(cli: click.Group) -> None:
    from humanclaw_train import cli as commands

    for command in commands.COMMANDS:
        cli.add_command(command)
