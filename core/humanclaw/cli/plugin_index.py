"""`humanclaw plugins index`, `search` and `install`: an index of plugins, and pip."""

from __future__ import annotations

import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import click

from humanclaw.errors import HumanclawError
from humanclaw.plugins import distributions
from humanclaw.plugins.host import Plugins
from humanclaw.plugins.index import SHIPPED, Entry, Index, requirement
from humanclaw.storage.files import write_atomically
from humanclaw.text.words import counted

F = TypeVar("F", bound=Callable[..., Any])


def _place(command: F) -> F:
    told = "The index: a file or an https address. The default is that of the first-party plugins."
    return click.option("--index", "place", default=str(SHIPPED), show_default=False, metavar="FILE|URL", help=told)(
        command
    )


@click.command()
@click.argument("folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), help="The file; the default is index.json beside the wheels.")
@click.option("--by-name", is_flag=True, help="For wheels that pip finds by name: leave out where they lie.")
def index(folder: Path, out: Path | None, by_name: bool) -> None:
    """Make an index of plugins from a folder of wheels. No code of theirs runs.

    Skill folders are checked, and the motion of trained skills is measured. Host the folder anywhere.
    """
    from humanclaw.testing.indexing import index_of  # Imported here: it loads bodies.

    found, left_out = index_of(folder, Plugins.discover(), by_name)
    for name, reason in left_out.items():
        click.echo(f"left out: {name}: {reason}", err=True)
    if not found.plugins:
        raise HumanclawError(f"{folder} holds no wheel of a plugin.", "Build one with `python -m build --wheel`.")
    path = out or folder / "index.json"
    write_atomically(path, found.json())
    click.echo(f"wrote {path}: {counted(len(found.plugins), 'plugin')}")


@click.command()
@click.argument("words", nargs=-1, metavar="[WORD]...")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@_place
def search(words: tuple[str, ...], as_json: bool, place: str) -> None:
    """Find plugins in an index: licence, checks, fidelity.

    A plugin is found if each WORD is in its name, summary, skills or hooks.
    """
    known = Index.read(place)
    found = Index(known.format, tuple(known.search(words)))
    if as_json:
        click.echo(found.json())
        return
    for line in (line for one in found.plugins for line in _lines(one) if line):
        click.echo(line)
    if not found.plugins:
        click.echo(f"None of {counted(len(known.plugins), 'plugin')} has {' and '.join(words)}.")


@click.command()
@click.argument("name")
@click.option("--dry-run", is_flag=True, help="Only print what pip would be asked.")
@_place
def install(name: str, dry_run: bool, place: str) -> None:
    """Install a plugin of an index with pip.

    pip compares the wheel with the digest in the index. A plugin runs as your own code does.
    """
    entry = Index.read(place).entry(name)
    asked = distributions.requirements([entry.name]) if place == str(SHIPPED) else [requirement(entry, place)]
    command = ["-m", "pip", "install", *asked]
    click.echo(shlex.join(["python", *command]))
    if not dry_run:
        sys.exit(subprocess.run([sys.executable, *command], check=False).returncode)


def _lines(entry: Entry) -> Iterator[str]:
    yield f"{entry.name} {entry.version} ({entry.licence or 'licence not given'})"
    yield f"  {entry.summary}" if entry.summary else ""
    for one in entry.skills:
        passed = f"fails {', '.join(one.faults)}" if one.faults else "passes every check"
        yield f"  skill {one.name}: {f'not checked: {one.unchecked}' if one.unchecked else passed}"
        for key, found in one.fidelity.items():
            yield f"    {key}: slope {found.slope:.2f}, error {found.error:g}; of the best constant {found.constant:g}"
    if data := dict.fromkeys(text for one in entry.skills for text in one.data):
        yield f"  data: {'; '.join(data)}"
    if code := [hook for hook in entry.hooks if not (entry.skills and hook in ("skills", "recipes"))]:
        yield f"  Python, not checked: {', '.join(code)}"
