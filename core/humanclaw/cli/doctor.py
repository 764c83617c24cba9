"""`humanclaw doctor`: what is installed here, what is missing, and the command that installs it."""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
from collections.abc import Iterator
from typing import Final

import click
from rich.table import Table

from humanclaw.cli.terminal import Console
from humanclaw.episodes.backends import SIMULATORS, Backends, default_simulator
from humanclaw.errors import PluginError
from humanclaw.plugins.distributions import install, own, table
from humanclaw.plugins.host import Plugins
from humanclaw.storage.cache import Cache

_EPISODE: Final = (("scenes", "house"), ("renderers", Backends.renderer), ("agents", "oracle"))
"""What `humanclaw run` needs besides a simulator."""


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def doctor(as_json: bool) -> None:
    """Show what is installed, what is missing, and how to get it.

    Exits with 1 if an episode cannot be played.
    """
    plugins = Plugins.discover()
    rows = [*_machine(), *_packages(), *_broken(plugins)]
    fault = _fault(plugins)
    if as_json:
        found = [dict(zip(("what", "found", "remedy"), row, strict=True)) for row in rows]
        click.echo(json.dumps({"rows": found, "fault": fault}, indent=2))
    else:
        _show(rows)
        click.echo(fault or f"An episode can be played here, on {default_simulator(plugins)}.")
    if fault:
        raise SystemExit(1)


def _machine() -> Iterator[tuple[str, str, str]]:
    cache = Cache("").folder
    used = sum(file.stat().st_size for file in cache.rglob("*") if file.is_file())
    yield "Python", f"{platform.python_version()} on {platform.system()} {platform.machine()}", ""
    yield "CPU cores", str(os.cpu_count()), ""
    yield "cache", f"{cache}, {used / 2**20:.0f} MiB", ""


def _packages() -> Iterator[tuple[str, str, str]]:
    """Yield every first-party distribution: its version, or what it would bring and the command that installs it."""
    for name in sorted(own()):
        try:
            yield name, importlib.metadata.version(name), ""
        except importlib.metadata.PackageNotFoundError:
            yield name, f"not installed ({_brings(name)})", install([name])


def _brings(distribution: str) -> str:
    """Return the names that a distribution brings, such as "executor ray"."""
    found = [f"{kind.removesuffix('s')} {name}" for kind, names in table().items() for name, of in names.items()
             if of == distribution]  # fmt: skip
    return ", ".join(found)


def _broken(plugins: Plugins) -> Iterator[tuple[str, str, str]]:
    for info in plugins.infos:
        if info.error:
            yield info.name, f"disabled: {info.error}", ""


def _fault(plugins: Plugins) -> str:
    """Return why no episode can be played, with the remedy; empty if one can."""
    installed = [one.name for one in plugins.registered("simulators")]
    try:
        plugins.require(*_EPISODE, ("simulators", (installed or SIMULATORS)[-1]))
    except PluginError as error:
        return str(error)
    return ""


def _show(rows: list[tuple[str, str, str]]) -> None:
    """Print what was found, and below it the commands that install what is missing."""
    grid = Table(box=None, show_header=False, pad_edge=False)
    for what, found, _ in rows:
        grid.add_row(what, found)
    console = Console(markup=False, emoji=False, highlight=False)
    console.print(grid)
    for remedy in filter(None, (row[2] for row in rows)):
        console.print(remedy, soft_wrap=True)
