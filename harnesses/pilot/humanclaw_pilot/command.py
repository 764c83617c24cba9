"""`humanclaw pilot`: make data, train, measure."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from pathlib import Path

import click

from humanclaw import HumanclawError, Plugins
from humanclaw.cli import parse_pairs, seed_option


@click.group("pilot")
def command() -> None:
    """Train the eyes of the agent pilot: make data, train, measure."""


@command.command()
@click.option("--houses", default="0:150", show_default=True, metavar="FIRST:END", help="Training houses.")
@click.option("--views", type=click.IntRange(1), default=60, show_default=True, help="Views of each.")
@click.option("--agent", default="", help="Take the views that this agent comes to see, instead of random ones.")
@click.option("--option", "pairs", multiple=True, metavar="KEY=VALUE", help="Of the agent. Repeatable.")
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder; files in it stay as they are.")
def data(houses: str, views: int, agent: str, pairs: tuple[str, ...], out: Path) -> None:
    """Draw views with labels, one file a house."""
    from humanclaw_pilot.data import planted, played, written

    plugins, (first, end) = Plugins.discover(), _range(houses)
    out.mkdir(parents=True, exist_ok=True)
    poses = [] if agent else [pose for _, pose in played(plugins, "wanderer", {}, 0, range(2), 30)]
    for number in range(first, end):
        path = out / f"{agent or 'random'}-{number}.npz"
        if path.exists():
            continue
        seeds = range(10 * number, 10 * number + 10)
        seen = (view for view, _ in played(plugins, agent, parse_pairs(pairs), number, seeds, views // 4))
        examples = list(islice(seen, views) if agent else planted(plugins, number, poses, views))
        if examples:
            written(path, examples)
        click.echo(f"{path}: {len(examples)} views")


def _files(folders: Sequence[Path]) -> list[Path]:
    files = [file for folder in folders for file in sorted(folder.glob("*.npz"))]
    if not files:
        raise HumanclawError(
            f"no views (*.npz) are in {', '.join(map(str, folders))}.", "Make some with `humanclaw pilot data`."
        )
    return files


def _range(houses: str) -> tuple[int, int]:
    first, colon, end = houses.partition(":")
    if not (colon and first.isdecimal() and end.isdecimal() and int(first) < int(end)):
        raise HumanclawError(f"--houses expects FIRST:END, such as 0:150; it got {houses!r}.", "Give two numbers.")
    return int(first), int(end)


@command.command()
@click.argument("folders", type=click.Path(exists=True, path_type=Path), nargs=-1, required=True)
@click.option("--steps", type=click.IntRange(1), default=2000, show_default=True, help="Of 32 views.")
@click.option("--start", type=click.Path(path_type=Path), default=None, help="Weights to go on from.")
@seed_option(help="Of weights and views.")
@click.option("--out", type=click.Path(path_type=Path), required=True, help="File of weights.")
def train(folders: tuple[Path, ...], steps: int, start: Path | None, seed: int, out: Path) -> None:
    """Train the eyes on folders of data."""
    from humanclaw_pilot import training

    training.train(training.read(_files(folders)), out, steps, seed, click.echo, start)


@command.command()
@click.argument("folder", type=click.Path(exists=True, path_type=Path))
@click.option("--weights", type=click.Path(path_type=Path), default=None, help="File of weights; the shipped ones.")
@click.option("--certain", default=0.5, show_default=True, help="Share from which a cell counts.")
def measure(folder: Path, weights: Path | None, certain: float) -> None:
    """Measure recall, precision and depth on data that the eyes have not learnt from."""
    from humanclaw_pilot import training
    from humanclaw_pilot.network import WEIGHTS, Eyes

    views = training.read(_files([folder]))
    for category, count, recall, precision, wrong in training.measure(Eyes.read(weights or WEIGHTS), views, certain):
        click.echo(
            f"{category:13s} {count:5d} views: recall {recall:.2f}, precision {precision:.2f}, depth {wrong:.0%}"
        )
