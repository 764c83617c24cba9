"""`humanclaw run`: one episode, recorded, filmed and reported."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from humanclaw.bench.film import film, poster
from humanclaw.bench.geodesics import geodesics
from humanclaw.bench.report import write_report
from humanclaw.bench.tasks import free_episode
from humanclaw.cli.options import parse_pairs, plugin_files
from humanclaw.cli.progress import Progress, summary
from humanclaw.embodiment import Body, Engines
from humanclaw.errors import RecordError
from humanclaw.interfaces import DecisionMaker, Renderer, Verifier
from humanclaw.loop import run_episode
from humanclaw.plugins import Plugins
from humanclaw.records import EpisodeRecord, RecordedEpisode
from humanclaw.scene import Scene


@click.command()
@click.option("--instruction", default="find a couch and sit on it", show_default=True, help="What the body is to do.")
@click.option("--scene", "reference", default="house:0", show_default=True, help="Where: source:argument.")
@click.option(
    "--agent", default="", help="Decision maker by name; the default is oracle, or the model if one is named."
)
@click.option(
    "--model", default="", help="Any litellm model that can call tools, such as openai/gpt-5 or ollama/qwen3."
)
@click.option(
    "--verifier", default="", help="Verifier by name, or none. The default is the model's own, if one is named."
)
@click.option("--option", "pairs", multiple=True, metavar="KEY=VALUE", help="Option of the decision maker. Repeatable.")
@click.option("--max-steps", type=click.IntRange(1, 10_000), default=100, show_default=True, help="Decisions at most.")
@click.option("--seed", type=int, default=0, show_default=True, help="All randomness derives from it.")
@click.option("--profile", type=click.Choice(["default", "paper"]), default="default", show_default=True)
@click.option("--out", type=click.Path(path_type=Path), help="Folder of the record; the default is a new one in runs/.")
@click.option("--film", "kind", type=click.Choice(["mp4", "gif", "none"]), default="mp4", show_default=True)
@plugin_files
def run(
    instruction: str,
    reference: str,
    agent: str,
    model: str,
    verifier: str,
    pairs: tuple[str, ...],
    max_steps: int,
    seed: int,
    profile: str,
    out: Path | None,
    kind: str,
    files: tuple[Path, ...],
) -> None:
    """Give a body an instruction and watch it act."""
    plugins = Plugins.discover(files)
    options = parse_pairs(pairs) | ({"model": model} if model else {})
    name = agent or ("litellm" if model else "oracle")
    maker: DecisionMaker = plugins.make("decision_makers", name, options)
    judge = _verifier(plugins, verifier or ("litellm" if model else "none"), options)
    out = out or Path("runs") / f"{datetime.datetime.now():%Y%m%d-%H%M%S}-{name}"
    scene: Scene = plugins.scene(reference)
    spec = free_episode(
        instruction, scene, seed=seed, max_steps=max_steps, name=f"{reference.replace(':', '-')}-{seed}"
    )
    folder = out / spec.id
    if (folder / "episode.json").exists():
        raise RecordError(f"{folder} already holds a record.", "Name another folder with --out, or remove that one.")
    console = Console()
    if not console.is_terminal:
        console = Console(width=160)  # A pipe has no width; 80 columns would cut the reasons off.
    plugins.add(Progress(console, max_steps), "console_progress")
    with Body(scene, seed=seed, plugins=plugins, engines=Engines(profile=profile)) as body:
        record = run_episode(body, spec, maker, judge, folder=folder, options=options, ruler=geodesics)
    console.print(summary(record, RecordedEpisode(folder).steps))
    _show(plugins, out, folder, scene, kind, console)
    _exit(record)


def _verifier(plugins: Plugins, name: str, options: dict[str, Any]) -> Verifier | None:
    return None if name == "none" else plugins.make("verifiers", name, options)


def _show(plugins: Plugins, out: Path, folder: Path, scene: Scene, kind: str, console: Console) -> None:
    """Film and poster first: the report embeds them."""
    episode = RecordedEpisode(folder)
    if kind != "none":
        renderer: Renderer = plugins.make("renderers", Engines().renderer)
        picture = poster(episode, scene, renderer, folder / "poster.png")
        moving = film(episode, scene, renderer, folder / f"film.{kind}", kind="gif" if kind == "gif" else "mp4")
        renderer.close()
        console.print(f"film: {moving}\npicture: {picture}", soft_wrap=True)
    console.print(f"report: {write_report(out, None, plugins.scene)}", soft_wrap=True)


def _exit(record: EpisodeRecord) -> None:
    if record.outcome == "infra_error":
        raise click.ClickException(f"the provider failed: {record.error}")
