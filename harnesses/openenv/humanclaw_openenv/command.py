"""`humanclaw openenv`."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import click

from humanclaw import Choice, Gym, Plugins
from humanclaw.cli import HOST, parse_pairs, plugin_options


@click.command("openenv")
@click.option("--tasks", default="train", show_default=True, help="Source of training tasks.")
@click.option("--option", "pairs", multiple=True, metavar="KEY=VALUE", help="Of the source of tasks. Repeatable.")
@click.option(
    "--reward", "weights", multiple=True, metavar="NAME=WEIGHT", help="Weight of a reward (default: the tasks')."
)
@click.option(
    "--sessions", type=click.IntRange(1, 128), default=16, show_default=True, help="Maximum sessions at once."
)
@click.option("--host", default=HOST, show_default=True, help="Address to listen at. Who reaches it can use the body.")
@click.option("--port", type=click.IntRange(1, 65535), default=8000, show_default=True, help="Port to listen at.")
@plugin_options
def command(
    tasks: str, pairs: tuple[str, ...], weights: tuple[str, ...], sessions: int, host: str, port: int,
    files: tuple[Path, ...], choice: Choice,
) -> None:  # fmt: skip
    """Serve training tasks to OpenEnv clients. Ctrl-C ends it."""
    from humanclaw_openenv.server import serve

    plugins = Plugins.discover(files, choice)
    rewards = parse_pairs(weights) or None
    gym = partial(Gym, tasks, rewards, options=parse_pairs(pairs), agent="openenv", plugins=plugins)
    with gym() as first:
        # Refuses wrong names and options, and compiles the renderer, before anybody connects and waits.
        first.reset(0)
    click.echo(f"http://{host}:{port}")
    serve(gym, sessions, host, port)
