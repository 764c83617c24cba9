"""The command line. Its commands come through the hook humanclaw_commands, ours as anybody else's.

What the user can mend is told in one sentence with a remedy, and the exit code is 2; what Ctrl-C ends exits with 130;
no traceback.
"""

from __future__ import annotations

import errno
import logging
import pkgutil
import sys
from collections.abc import Callable, Sequence
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.console import Console

from humanclaw.cli.options import INTERRUPTED, Deciders, decider_options, plugin_options
from humanclaw.errors import HumanclawError, PluginError
from humanclaw.plugins.distributions import bringing, install, table
from humanclaw.text.words import nearest

if TYPE_CHECKING:
    from humanclaw.plugins.host import Plugins

_LOG = logging.getLogger(__name__)
_NO_ROOM = {errno.ENOSPC, errno.EROFS, errno.EACCES, getattr(errno, "EDQUOT", errno.ENOSPC)}
"""What is no fault of the program, and of no use as a traceback: disk full, quota used up, read-only, not allowed."""


class Commands(click.Group):
    """A group that tells errors of the user's kind without a traceback.

    plugins: asked for further commands when a name is not among those that are there, or all are listed. So `humanclaw
    run` is under way before a plugin is loaded.
    """

    def __init__(self, *args: Any, plugins: Callable[[], Plugins], **options: Any) -> None:
        super().__init__(*args, **options)
        self._plugins = plugins
        self._complete = False

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in self.commands:
            self._load()
        if cmd_name not in self.commands and not ctx.resilient_parsing:
            raise self._missing(cmd_name)
        return super().get_command(ctx, cmd_name)

    def _missing(self, name: str) -> HumanclawError:
        """Say what brings a command that is not there, or which ones have nearly its name."""
        if distribution := bringing("commands", name):
            return HumanclawError(f"command {name!r} is not installed.", f"Run `{install([distribution])}`.")
        known = dict.fromkeys(self.commands, "")
        told = nearest(name, {**table()["commands"], **known})
        return HumanclawError(f"there is no command {name!r}.", told or "See `humanclaw --help`.")

    def list_commands(self, ctx: click.Context) -> list[str]:
        self._load()
        return super().list_commands(ctx)

    def _load(self) -> None:
        if not self._complete:
            self._plugins().tell("humanclaw_commands", cli=self)
            self._complete = True

    def add_command(self, cmd: click.Command, name: str | None = None) -> None:
        """Add a command. One of the same name that is there already stays, the core's before all; the log says so."""
        there = self.commands.get(name or cmd.name or "")
        if there is not None and there is not cmd:
            told = "command %r of %s is already that of %s, and is left out"
            _LOG.warning(told, name or cmd.name, _home(cmd), _home(there))
            return
        super().add_command(cmd, name)

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except HumanclawError as error:
            click.secho(f"error: {error.message}", fg="red", err=True)
            if error.remedy:
                click.echo(error.remedy, err=True)
            ctx.exit(2)
        except OSError as error:
            if error.errno not in _NO_ROOM:
                raise
            click.secho(f"error: {error.filename or 'a file'} cannot be written: {error.strerror}.", fg="red", err=True)
            ctx.exit(2)
        except KeyboardInterrupt:
            click.echo("Interrupted.", err=True)
            ctx.exit(INTERRUPTED)


def _home(command: click.Command) -> str:
    """Return the package that a command comes from."""
    if target := getattr(command, "target", ""):
        return str(target).partition(".")[0]
    return getattr(command.callback, "__module__", "").partition(".")[0] or "a group"


class LazyCommand(click.Command):
    """A command that is loaded when it is called: listing the commands costs nothing that only calling them needs.

    target: module:name of the command. sentence: what the list says of it.
    """

    def __init__(self, name: str, target: str, sentence: str) -> None:
        super().__init__(name, help=sentence)
        self.target = target

    def load(self) -> click.Command:
        """Return the command itself. Raises PluginError if its module cannot be imported, or holds no such command."""
        try:
            command = pkgutil.resolve_name(self.target)
        except Exception as error:  # A plugin is code of somebody else.
            told = f"command {self.name!r} cannot be loaded from {self.target}: {type(error).__name__}: {error}."
            raise PluginError(told) from error
        if not isinstance(command, click.Command):
            raise PluginError(f"{self.target} is no command: it is of type {type(command).__name__}.")
        return command

    def make_context(
        self, info_name: str | None, args: list[str], parent: click.Context | None = None, **extra: Any
    ) -> click.Context:
        return self.load().make_context(info_name, args, parent, **extra)


@click.command()
@click.option("--instruction", default="find a couch and sit on it", show_default=True, help="What the body is to do.")
@click.option("--scene", "reference", default="house:0", show_default=True, help="Where: source:argument.")
@decider_options
@click.option("--max-steps", type=click.IntRange(1, 10_000), default=100, show_default=True, help="Decisions at most.")
@click.option("--seed", type=int, default=0, show_default=True, help="All randomness derives from it.")
@click.option("--out", type=click.Path(path_type=Path), help="Folder of the record; the default is a new one in runs/.")
@click.option("--film", type=click.Choice(["mp4", "gif", "none"]), default="mp4", show_default=True)
@plugin_options
def run(instruction: str, reference: str, deciders: Deciders, files: tuple[Path, ...], **options: object) -> None:
    """Give a body an instruction and watch it act."""
    console = Console(markup=False, emoji=False, highlight=False)  # What is told is somebody's own words, or a path.
    console.print(f'{deciders.agent} in {reference}: "{instruction}"', soft_wrap=True)
    with console.status("Loading the plugins") as status:
        # What an episode needs takes a second to import; whoever typed the command has been answered by then.
        from humanclaw.cli.play import play

        play(instruction, reference, deciders, files, console, status, **options)  # type: ignore[arg-type]


def build(plugins: Callable[[], Plugins]) -> click.Group:
    """Return the command group with `run` and, once they are asked for, the commands of the plugins, the core's among
    them."""

    @click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]}, plugins=plugins)
    @click.version_option(package_name="humanclaw", prog_name="humanclaw")
    def humanclaw_command() -> None:
        """Give any tool-calling model a human body: run episodes, look at them, train skills."""

    humanclaw_command.add_command(run)
    return humanclaw_command


def main(args: Sequence[str] | None = None) -> None:
    """Entry point of the console script. A letter that the output has not, as in a pipe on Windows, is told by its
    number."""
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    sys.exit(build(_discover).main(args=args, prog_name="humanclaw"))


def _discover() -> Plugins:
    from humanclaw.plugins.host import Plugins

    return Plugins.discover()
