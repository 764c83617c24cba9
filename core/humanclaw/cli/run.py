"""`humanclaw run`: one episode, recorded, filmed and reported."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console

from humanclaw.cli.options import Deciders, decider_options, plugin_options


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
