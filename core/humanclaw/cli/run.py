"""`humanclaw run`: one episode, recorded, filmed and reported."""

from __future__ import annotations

import datetime
from pathlib import Path

import click
from rich.console import Console

from humanclaw.cli.options import Deciders, decider_options, plugin_files
from humanclaw.cli.progress import StepProgress, summary
from humanclaw.embodiment import Backends, Body
from humanclaw.errors import RecordError
from humanclaw.interfaces import Reporter
from humanclaw.loop import run_episode
from humanclaw.navigation import geodesics
from humanclaw.plugins import Plugins
from humanclaw.records import EpisodeRecord, RecordedEpisode, name_of
from humanclaw.scene import Scene
from humanclaw.tasks import free_episode


@click.command()
@click.option("--instruction", default="find a couch and sit on it", show_default=True, help="What the body is to do.")
@click.option("--scene", "reference", default="house:0", show_default=True, help="Where: source:argument.")
@decider_options
@click.option("--max-steps", type=click.IntRange(1, 10_000), default=100, show_default=True, help="Decisions at most.")
@click.option("--seed", type=int, default=0, show_default=True, help="All randomness derives from it.")
@click.option("--out", type=click.Path(path_type=Path), help="Folder of the record; the default is a new one in runs/.")
@click.option("--film", "kind", type=click.Choice(["mp4", "gif", "none"]), default="mp4", show_default=True)
@plugin_files
def run(
    instruction: str,
    reference: str,
    deciders: Deciders,
    engines: Backends,
    max_steps: int,
    seed: int,
    out: Path | None,
    kind: str,
    files: tuple[Path, ...],
) -> None:
    """Give a body an instruction and watch it act."""
    plugins = Plugins.discover(files)
    agent, verifier = deciders.make(plugins)
    out = out or Path("runs") / f"{datetime.datetime.now():%Y%m%d-%H%M%S}-{deciders.agent}"
    scene: Scene = plugins.scene(reference)
    spec = free_episode(instruction, scene, seed=seed, max_steps=max_steps, name=f"{name_of(reference)}-{seed}")
    folder = out / spec.id
    if (folder / "episode.json").exists():
        raise RecordError(f"{folder} already holds a record.", "Name another folder with --out, or remove that one.")
    console = Console()
    if not console.is_terminal:
        console = Console(width=160)  # A pipe has no width; 80 columns would cut the reasons off.
    plugins.add(StepProgress(console, max_steps), "console_progress")
    with Body(scene, seed=seed, plugins=plugins, engines=engines) as body:
        record = run_episode(
            body,
            spec,
            agent,
            verifier,
            folder=folder,
            options=deciders.options,
            distance=geodesics,
            meter=deciders.meter(),
        )
    console.print(summary(record, RecordedEpisode(folder).steps))
    _report(plugins, engines, out, folder, kind, console)
    _exit(record)


def _report(plugins: Plugins, engines: Backends, out: Path, folder: Path, kind: str, console: Console) -> None:
    """What the reporters that are installed make of the record."""
    for one in plugins.registered("reports"):
        reporter: Reporter = plugins.make("reports", one.name, film=kind, renderer=engines.renderer)
        for name, path in reporter.write(out, RecordedEpisode(folder), plugins).items():
            console.print(f"{name}: {path}", soft_wrap=True)


def _exit(record: EpisodeRecord) -> None:
    if record.outcome == "infra_error":
        raise click.ClickException(f"the provider failed: {record.error}")
    if record.outcome == "limit_reached":
        raise click.ClickException(f"a limit was reached: {record.error}")
