"""`humanclaw habitat`: Habitat's scene datasets and episodes."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import click

from humanclaw import HumanclawError, Plugins, Scene, SceneError
from humanclaw.cli import counted
from humanclaw.records import write_episodes
from humanclaw_habitat.categories import GOALS
from humanclaw_habitat.dataset import Dataset
from humanclaw_habitat.episodes import LeftOut, convert, read_books
from humanclaw_habitat.reference import TRIANGLES, Reference
from humanclaw_habitat.source import load_scene, read_scene
from humanclaw_habitat.starting import check_start

_PLACE = click.Path(path_type=Path)
_skip = click.option("--skip", is_flag=True, help="Leave out what is missing or unsupported, and list it.")
_small = click.option(
    "--movable-small", "small", is_flag=True, help="Make small objects movable that the dataset fixes."
)
_triangles = click.option(
    "--triangles", default=TRIANGLES, show_default=True, type=click.IntRange(12),
    help="Approximate maximum of triangles per object.",
)  # fmt: skip


@click.group()
def habitat() -> None:
    """Habitat scene datasets, such as HSSD, and ObjectNav episodes."""


@habitat.command()
@click.argument("dataset", type=_PLACE)
def scenes(dataset: Path) -> None:
    """List the scenes of a dataset."""
    for name in Dataset.open(dataset).scenes:
        click.echo(f"hssd:{dataset}#{name}")


@habitat.command()
@click.argument("dataset", type=_PLACE)
@click.argument("names", nargs=-1, metavar="[SCENE]...")
@_skip
@_small
@_triangles
def check(dataset: Path, names: tuple[str, ...], skip: bool, small: bool, triangles: int) -> None:
    """Load scenes and list what is in and what is left out. By default all. Later runs load them from the cache.

    Also puts a body on each scene's start in the default simulator. Exits with 1 if a scene fails or anything was left
    out.
    """
    plugins, good = Plugins.discover(), True
    for name in names or tuple(Dataset.open(dataset).scenes):
        try:
            scene = read_scene("hssd", _argument(dataset, name, skip, small, triangles))
            good = _tell(scene) and good
            for obj in check_start(scene, plugins):
                click.echo(f"  falls: object {obj.id} ({obj.category}), because nothing is below it")
        except SceneError as error:
            click.echo(f"{name} fails: {error}", err=True)
            good = False
    if not good:
        click.get_current_context().exit(1)


@habitat.command()
@click.argument("dataset", type=_PLACE)
@click.argument("episodes", type=_PLACE)
@click.option("--out", required=True, type=_PLACE, help="File to write, for `humanclaw bench run --split`.")
@click.option("--max-steps", default=100, show_default=True, type=click.IntRange(1), help="Decisions in an episode.")
@_skip
@_small
@_triangles
def episodes(dataset: Path, episodes: Path, out: Path, max_steps: int, skip: bool, small: bool, triangles: int) -> None:
    """Convert ObjectNav episodes to a file of one episode a line.

    They are a folder with content/*.json.gz, or one file.

    Exits with 1 if anything was left out.
    """
    left_out = LeftOut(skip)
    specs = convert(
        read_books(episodes, left_out),
        lambda name: load_scene("hssd", _argument(dataset, name, skip, small, triangles)),
        left_out,
        max_steps=max_steps,
    )
    for reason, count in left_out.reasons.items():
        click.echo(f"left out: {reason}" + (f" ({count} episodes)" if count > 1 else ""), err=True)
    if not specs:
        raise HumanclawError(f"no episode of {episodes} can be used.", "See the reasons above.")
    write_episodes(out, specs)
    click.echo(f"{out}")
    categories = Counter(spec.target_category for spec in specs)
    click.echo(f"  episodes      {len(specs)} in {counted(len({spec.scene for spec in specs}), 'scene')}")
    click.echo("  categories    " + ", ".join(f"{name} {count}" for name, count in categories.most_common()))
    if left_out.reasons:
        click.get_current_context().exit(1)


def _argument(dataset: Path, name: str, skip: bool, small: bool, triangles: int) -> str:
    """Return the argument that opens a scene, whatever the working directory."""
    return Reference(dataset.resolve(), name, skip, small, triangles).argument


def _tell(scene: Scene) -> bool:
    """Print what is in a scene. Returns whether nothing was left out."""
    targets = Counter(obj.category for obj in scene.objects if obj.category in GOALS)
    triangles = sum(len(scene.assets[obj.asset].mesh.faces) for obj in scene.objects)
    movable = sum(obj.movable for obj in scene.objects)
    objects, assets = counted(len(scene.objects), "object"), counted(len(scene.assets), "asset")
    click.echo(
        f"{scene.name}: {objects} ({movable} movable) of {assets}, {triangles} triangles, "
        f"{counted(len({room.name for room in scene.rooms}), 'room')}; "
        + (", ".join(f"{name} {count}" for name, count in sorted(targets.items())) or "no targets")
    )
    for note, what in (("left_out", "left out"), ("not_read", "not read"), ("ignored", "ignored")):
        for line in json.loads(scene.notes[note]):
            click.echo(f"  {what}: {line}")
    return not json.loads(scene.notes["left_out"])
