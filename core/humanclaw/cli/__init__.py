"""The command line. Its commands come through the hook humanclaw_commands, ours as anybody else's.

What the user can mend is told in one sentence with a remedy, and the exit code is 2; no traceback.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import click

import humanclaw
from humanclaw.errors import HumanclawError
from humanclaw.plugins import Plugins


class Commands(click.Group):
    """A group that tells errors of the user's kind without a traceback."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except HumanclawError as error:
            click.secho(f"error: {error.message}", fg="red", err=True)
            if error.remedy:
                click.echo(error.remedy, err=True)
            ctx.exit(2)


def build(plugins: Plugins) -> click.Group:
    """The command group with the commands of these plugins."""

    @click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
    @click.version_option(humanclaw.__version__, prog_name="humanclaw")
    def humanclaw_command() -> None:
        """A human body for any tool-calling model: run episodes, look at them, and train the skills."""

    plugins.hook.humanclaw_commands(cli=humanclaw_command)
    return humanclaw_command


def main(args: Sequence[str] | None = None) -> None:
    """Entry point of the console script."""
    sys.exit(build(Plugins.discover()).main(args=args, prog_name="humanclaw"))
