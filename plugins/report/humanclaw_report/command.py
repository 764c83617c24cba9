"""`humanclaw report`, `humanclaw film` and `humanclaw watch`: look at recorded and running episodes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from humanclaw.cli import plugin_files

if TYPE_CHECKING:
    from humanclaw import RecordedEpisode


@click.command()
@click.argument("runs", type=click.Path(path_type=Path), nargs=-1, required=True, metavar="RUN...")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="File to write; default: report.html in the run, or in this folder for several runs.",
)
@plugin_files
def report(runs: tuple[Path, ...], out: Path | None, files: tuple[Path, ...]) -> None:
    """Write the page that shows a run, or several side by side: tables, and every episode with its replay."""
    from humanclaw import HumanclawError, Plugins
    from humanclaw_report.page import report_of

    if out and out.suffix != ".html":
        raise HumanclawError(f"a report ends in .html; got {out}.", f"Name {out}.html.")
    click.echo(report_of(runs, Plugins.discover(files), out))


@click.command()
@click.argument("folder", type=click.Path(path_type=Path), metavar="EPISODE")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="MP4 or GIF file to write, or a picture (JPG, PNG) of the whole episode; default: film.mp4 in the episode.",
)
@click.option(
    "--height",
    type=click.IntRange(90, 2160),
    default=720,
    show_default=True,
    help="Height in pixels; the width follows from 16:9.",
)
@click.option(
    "--every",
    type=click.IntRange(1, 30),
    default=2,
    show_default=True,
    help="Keep every Nth frame; recordings have 30 a second.",
)
@click.option("--renderer", default="raster", show_default=True, help="Name of the renderer that draws it.")
@plugin_files
def film(folder: Path, out: Path | None, height: int, every: int, renderer: str, files: tuple[Path, ...]) -> None:
    """Film a recorded episode from behind the body, with the ego view in a corner; or draw its bodies in one picture.

    EPISODE is the folder of an episode, or of a run that holds only one.
    """
    from humanclaw import HumanclawError, Plugins
    from humanclaw_report.film import film as make
    from humanclaw_report.poses import poses

    if out and out.suffix not in (".gif", ".mp4", ".jpg", ".png"):
        remedy = f"Name {out.with_suffix('.mp4')}, or {out.with_suffix('.jpg')} for one picture."
        raise HumanclawError(f"a film ends in .mp4 or .gif; got {out}.", remedy)
    episode, plugins = _episode(folder), Plugins.discover(files)
    out = out or episode.folder / "film.mp4"
    size = (2 * round(height * 8 / 9), height // 2 * 2)
    kind: Literal["mp4", "gif"] = "gif" if out.suffix == ".gif" else "mp4"
    drawing = plugins.make("renderers", renderer)
    try:
        scene = plugins.scene(episode.record.spec.scene)
        if out.suffix in (".jpg", ".png"):
            poses(episode, scene, drawing, out, size)
        else:
            make(episode, scene, drawing, out, kind, every, size)
    finally:
        drawing.close()
    click.echo(out)


def _episode(folder: Path) -> RecordedEpisode:
    """Return the episode in a folder, or the only episode of a run."""
    from humanclaw import RecordedEpisode, RecordError, load_run
    from humanclaw.storage import Folder

    if Folder(folder).has("episode.json"):
        return RecordedEpisode(folder)
    episodes = load_run(folder)
    if len(episodes) != 1:
        raise RecordError(
            f"{folder} holds {len(episodes)} episodes.", f"Name one of them, such as {episodes[0].folder}."
        )
    return episodes[0]


@click.command()
@click.argument("folder", type=click.Path(path_type=Path), metavar="RUN")
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="Port to serve on; default: a free one.")
@plugin_files
def watch(folder: Path, port: int, files: tuple[Path, ...]) -> None:
    """Show a run in progress in a browser on this machine. It changes no file; Ctrl-C ends it."""
    from humanclaw import HumanclawError, Plugins
    from humanclaw_report.watch import Watcher, server

    runs = {record.parents[1] for record in folder.glob("*/*/episode.json")}
    if runs and not any(folder.glob("*/episode.json")):
        raise HumanclawError(f"expected one run; {folder} holds {len(runs)}.", f"Name one, such as {max(runs)}.")
    if not folder.is_dir():
        remedy = "Begin a run in it with `humanclaw run --out FOLDER`, or name the folder of one."
        raise HumanclawError(f"expected the folder of a run; {folder} is no folder.", remedy)
    serving = server(Watcher(folder, Plugins.discover(files).scene), port)
    click.echo(f"http://127.0.0.1:{serving.server_address[1]}/")
    serving.until_interrupted()
