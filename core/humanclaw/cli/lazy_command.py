"""Commands that are listed without being loaded."""

from __future__ import annotations

import pkgutil
from typing import Any

import click

from humanclaw.errors import PluginError


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
