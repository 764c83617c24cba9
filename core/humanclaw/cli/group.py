"""The command line. All its commands but `run` come through the hook humanclaw_commands, the core's own included.

An error that the user can mend is printed in one sentence with a remedy; the exit code is 2. Ctrl-C exits with 130.
Neither prints a traceback.
"""

from __future__ import annotations

import errno
import logging
import os
import pkgutil
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.text import Text

from humanclaw.cli.options import INTERRUPTED, ChosenAgents, agent_options, plugin_options, scene_option, seed_option
from humanclaw.cli.terminal import Console, guarded
from humanclaw.errors import HumanclawError, PluginError
from humanclaw.plugins.distributions import bringing, install, table
from humanclaw.text.words import nearest

if TYPE_CHECKING:
    from humanclaw.plugins.host import Modules, Plugins

_LOG = logging.getLogger(__name__)
_NO_ROOM = {errno.ENOSPC, errno.EROFS, errno.EACCES, getattr(errno, "EDQUOT", errno.ENOSPC)}
"""Errors of the system, not of the program: disk full, quota used up, read-only, not allowed."""
_FIRST = ("run", "play", "report")
_DEVELOPERS = ("cards", "data", "fidelity", "naturalness", "physics", "pilot", "show", "speed", "train")
"""Commands for those who train motion, or write simulators and agents."""


class Commands(click.Group):
    """A group that prints user errors without a traceback.

    plugins: called when a command is unknown, or all are listed. So `humanclaw run` starts before any plugin is loaded.
    """

    def __init__(self, *args: Any, plugins: Callable[[], Plugins | Modules], **options: Any) -> None:
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
        """Return the error for a missing command: the distribution that brings it, or the nearest names."""
        if distribution := bringing("commands", name):
            return HumanclawError(f"command {name!r} is not installed.", f"Run `{install([distribution])}`.")
        known = dict.fromkeys(self.commands, "")
        question = nearest(name, {**table()["commands"], **known})
        return HumanclawError(f"there is no command {name!r}.", question or "See `humanclaw --help`.")

    def list_commands(self, ctx: click.Context) -> list[str]:
        self._load()
        return super().list_commands(ctx)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands that most people need first, and those of developers last."""
        names = self.list_commands(ctx)
        first = [name for name in _FIRST if name in names]
        rest = [name for name in names if name not in (*_FIRST, *_DEVELOPERS)]
        parts = {"Commands": first + rest, "For developers": [name for name in names if name in _DEVELOPERS]}
        width = max(map(len, names), default=0)
        for title, listed in parts.items():
            rows = [(name.ljust(width), self.commands[name].get_short_help_str(70)) for name in listed]
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)

    def _load(self) -> None:
        if not self._complete:
            self._plugins().tell("humanclaw_commands", cli=self)
            self._complete = True

    def add_command(self, cmd: click.Command, name: str | None = None) -> None:
        """Add a command. A command of the same name that is there already stays; the log says so."""
        there = self.commands.get(name or cmd.name or "")
        if there is not None and there is not cmd:
            message = "command %r of %s is already that of %s, and is left out"
            _LOG.warning(message, name or cmd.name, _home(cmd), _home(there))
            return
        super().add_command(cmd, name)

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except click.NoSuchOption as error:
            meant = [*(error.possibilities or ()), *_choosing(error)]
            raise click.NoSuchOption(error.option_name, possibilities=meant, ctx=error.ctx) from None
        except click.BadParameter as error:
            if not error.message.endswith(" range."):
                raise
            raise click.BadParameter(_ranged(error), error.ctx, error.param, error.param_hint) from None
        except HumanclawError as error:
            _complain(error.message)
            if error.remedy:
                click.echo(error.remedy, err=True)
            ctx.exit(2)
        except OSError as error:
            if error.errno not in _NO_ROOM:
                raise
            _complain(f"{error.filename or 'a file'} cannot be written: {error.strerror}.")
            ctx.exit(2)
        except KeyboardInterrupt:
            click.echo("Interrupted.", err=True)
            ctx.exit(INTERRUPTED)


def _choosing(error: click.NoSuchOption) -> Iterator[str]:
    """Yield the options that take what was written as an option: `--format latex` for `--latex`."""
    value = error.option_name.lstrip("-")
    for parameter in error.ctx.command.params if error.ctx else ():
        if isinstance(parameter.type, click.Choice) and value in parameter.type.choices:
            yield f"{parameter.opts[0]} {value}"


def _ranged(error: click.BadParameter) -> str:
    """Return the message with the bounds that click leaves out where a word is no number."""
    kind: dict[str, Any] = {**error.param.type.to_info_dict()} if error.param else {}
    bounds = {"at least": kind.get("min"), "at most": kind.get("max")}
    named = [f"{word} {bound}" for word, bound in bounds.items() if bound is not None]
    return error.message.replace("float range.", "number range.").replace(" range.", f": {', '.join(named)}.")


def _complain(message: str) -> None:
    Console(stderr=True).print(Text(f"error: {message}", "red"), soft_wrap=True)


def _home(command: click.Command) -> str:
    """Return the package that a command comes from."""
    if target := getattr(command, "target", ""):
        return str(target).partition(".")[0]
    return getattr(command.callback, "__module__", "").partition(".")[0] or "a group"


class LazyCommand(click.Command):
    """A command that is imported when it is called, so that listing commands stays fast.

    target: module:name of the command. sentence: its line in the list.
    """

    def __init__(self, name: str, target: str, sentence: str) -> None:
        super().__init__(name, help=sentence)
        self.target = target

    def load(self) -> click.Command:
        """Return the command itself. Raises PluginError if its module cannot be imported, or holds no such command."""
        try:
            command = pkgutil.resolve_name(self.target)
        except Exception as error:  # Third-party code may raise anything.
            message = f"command {self.name!r} cannot be loaded from {self.target}: {type(error).__name__}: {error}."
            raise PluginError(message) from error
        if not isinstance(command, click.Command):
            raise PluginError(f"{self.target} is of type {type(command).__name__}; expected a click command.")
        return command

    def make_context(
        self, info_name: str | None, args: list[str], parent: click.Context | None = None, **extra: Any
    ) -> click.Context:
        return self.load().make_context(info_name, args, parent, **extra)


@click.command(context_settings={"allow_extra_args": True})
@click.option("--instruction", default="find a couch and sit on it", show_default=True, help="What the body is to do.")
@scene_option(default="house:0")
@agent_options
@click.option("--max-steps", type=click.IntRange(1, 10_000), default=100, show_default=True, help="Decisions at most.")
@seed_option(help="All randomness derives from it.")
@click.option("--out", type=click.Path(path_type=Path), help="Folder of the record; the default is a new one in runs/.")
@click.option("--film", type=click.Choice(["mp4", "gif", "none"]), default="mp4", show_default=True)
@click.option("--with", "partner", default="", help="A second model or agent, such as human, with a body beside it.")
@click.option(
    "--with-instruction", "partner_instruction", default="", help="What the second is to do, if not the same."
)
@click.option(
    "--clock",
    type=click.Choice(["paused", "real"]),
    default="paused",
    show_default=True,
    help="Whether the world waits while an agent thinks, or goes on: then 3 s of thought cost six steps.",
)
@plugin_options
def run(instruction: str, reference: str, agents: ChosenAgents, files: tuple[Path, ...], **options: object) -> None:
    """Give a body an instruction and watch it act."""
    for word in click.get_current_context().args:
        option = "--plugin" if word.endswith(".py") else "--instruction"
        raise HumanclawError(f"run takes options alone; got {word!r:.60}.", f"Did you mean {option} {word!r:.60}?")
    console = Console(markup=False, emoji=False, highlight=False)  # Instructions and paths may contain brackets.
    with console.status("Loading the plugins") as status:
        # Imported here: it takes a second, and the user sees the status by then.
        from humanclaw.cli.run import play

        # click checked the options.
        play(instruction, reference, agents, files, console, status, **options)  # type: ignore[arg-type]


def build(plugins: Callable[[], Plugins | Modules]) -> click.Group:
    """Return the command group: `run`, and on demand the commands of plugins and of the core."""

    @click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]}, plugins=plugins)
    @click.version_option(package_name="humanclaw", prog_name="humanclaw")
    def humanclaw_command() -> None:
        """Give any tool-calling model a human body: run episodes, look at them, train skills."""

    humanclaw_command.add_command(run)
    return humanclaw_command


def main(args: Sequence[str] | None = None) -> None:
    """Run the command line. What it prints cannot control the terminal."""
    os.environ["PYTHONSAFEPATH"] = "1"  # A stranger's folder may hold a json.py, for the processes that we start in it.
    with guarded():
        try:
            sys.exit(build(_installed).main(args=args, prog_name="humanclaw"))
        except Exception:  # Python would print the traceback past the guard, with the controls in its message.
            traceback.print_exc()
            sys.exit(1)


def _installed() -> Modules:
    from humanclaw.plugins.host import Modules

    return Modules()
