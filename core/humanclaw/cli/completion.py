"""Completion of names in a shell: of what is installed, and of what the files named by --plugin register."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import click
from click.shell_completion import CompletionItem

Complete = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]


def names_of(kind: str) -> Complete:
    """Return what completes the name of a registered item, such as one of the `agents`.

    Of `scenes`, it completes the source and its colon, then the names that the source's factory tells.
    """

    def complete(context: click.Context, parameter: click.Parameter, begun: str) -> list[CompletionItem]:
        before, comma, last = begun.rpartition(",") if kind == "skills" else ("", "", begun)
        found: list[CompletionItem] = []
        with suppress(Exception):  # Completion never fails: a broken file has no names.
            files = tuple(map(Path, context.params.get("files") or ()))
            found += (CompletionItem(before + comma + name, help=told) for name, told in _names(kind, last, files))
        return [item for item in found if item.value.startswith(begun)]

    return complete


def names_or_files(kind: str) -> Complete:
    """Return what completes the name of a registered item, or a file."""
    names = names_of(kind)
    # The file comes first: click's script for bash forgets what it was told before one.
    return lambda context, parameter, begun: [CompletionItem(begun, "file"), *names(context, parameter, begun)]


def _names(kind: str, begun: str, files: tuple[Path, ...]) -> Iterator[tuple[str, str]]:
    """Yield names and descriptions of the registered items of a kind."""
    from humanclaw.plugins.host import Plugins

    source, colon, _ = begun.partition(":") if kind == "scenes" else ("", "", "")
    for one in Plugins.discover(files).registered(kind):
        if not colon:
            yield one.name + ":" * (kind == "scenes"), one.description
        elif one.name == source and hasattr(one.value, "names"):
            yield from ((f"{source}:{name}", "") for name in one.value.names())
