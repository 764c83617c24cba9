"""`humanclaw rerun`: write recorded episodes for the Rerun viewer."""

from __future__ import annotations

from pathlib import Path

import click

from humanclaw.cli import plugin_files


@click.command()
@click.argument("folder", type=click.Path(path_type=Path), metavar="EPISODE|RUN")
@click.option("--out", type=click.Path(path_type=Path), help="File to write; default: episode.rrd in the episode.")
@plugin_files
def rerun(folder: Path, out: Path | None, files: tuple[Path, ...]) -> None:
    """Write recorded episodes for the Rerun viewer; `rerun FILE` shows one.

    EPISODE is the folder of an episode. For a RUN, every episode gets a file in its own folder.
    """
    from humanclaw import HumanclawError, Plugins, load_run
    from humanclaw_rerun.log import house_of, write_recording

    episodes, plugins = load_run(folder), Plugins.discover(files)
    if out and len(episodes) > 1:
        raise HumanclawError(
            f"{folder} holds {len(episodes)} episodes, but --out takes one.",
            f"Name one of them, such as {episodes[0].folder}, or leave out --out.",
        )
    for episode in episodes:
        scene, note = house_of(episode.record, plugins)
        target = out or episode.folder / "episode.rrd"
        write_recording(episode, scene, target, note)
        click.echo(target)
