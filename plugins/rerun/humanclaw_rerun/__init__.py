"""HumanCLAW plugin: episodes as recordings of the Rerun viewer, live or from records."""

from __future__ import annotations

import functools
import os
from typing import TYPE_CHECKING, Final

from humanclaw import hookimpl

if TYPE_CHECKING:
    import click
    import numpy as np
    from numpy.typing import NDArray

    from humanclaw import Chunk, EpisodeRecord, StepRecord
    from humanclaw_rerun.live import Live

__version__ = "0.1.0"

TARGET: Final = "HUMANCLAW_RERUN"
"""Environment variable that turns on live logging: address of a viewer, or folder for one .rrd file per episode."""


@hookimpl
def humanclaw_commands(cli: click.Group) -> None:
    from humanclaw.cli import LazyCommand

    cli.add_command(
        LazyCommand("rerun", "humanclaw_rerun.command:rerun", "Write recorded episodes for the Rerun viewer.")
    )


@hookimpl
def humanclaw_chunk(episode: EpisodeRecord, step: int, chunk: Chunk) -> None:
    if live := _live(os.environ.get(TARGET, "")):
        live.chunk(episode, chunk)


@hookimpl
def humanclaw_step(episode: EpisodeRecord, step: StepRecord, view: NDArray[np.uint8]) -> None:
    if live := _live(os.environ.get(TARGET, "")):
        live.step(episode, step, view)


@hookimpl
def humanclaw_episode_end(episode: EpisodeRecord) -> None:
    if live := _live(os.environ.get(TARGET, "")):
        live.end(episode)


# Hooks are called for every chunk, and a viewer must get one connection only.
@functools.cache
def _live(target: str) -> Live | None:
    """Return the logger of a target, the same at every call; None for an empty target."""
    if not target:
        return None
    from humanclaw_rerun.live import Live

    return Live(target)
