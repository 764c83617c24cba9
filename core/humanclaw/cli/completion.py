"""Completion of names in a shell: of what is installed, and of what the files named by --plugin register."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

Complete = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]


def names_of(kind: str, ending: str = "") -> Complete:
    """Return what completes the name of a registered item, such as one of the `agents`.

    ending: text that follows each name, such as the colon of a scene.
    """

    def complete(context: click.Context, parameter: click.Parameter, begun: str) -> list[CompletionItem]:
        before, comma, last = begun.rpartition(",") if kind == "skills" else ("", "", begun)
        found = ((one, told) for one, told in _registered(kind, context.params) if one.startswith(last))
        return [CompletionItem(f"{before}{comma}{name}{ending}", help=told) for name, told in found]

    return complete


def _registered(kind: str, given: dict[str, Any]) -> Sequence[tuple[str, str]]:
    """Return name and description of the registered items of a kind. Completion never fails: a broken file has none."""
    from humanclaw.errors import HumanclawError
    from humanclaw.plugins.host import Plugins

    try:
        plugins = Plugins.discover(tuple(map(Path, given.get("files") or ())))
    except HumanclawError:
        return ()
    return [(one.name, one.description) for one in plugins.registered(kind)]
