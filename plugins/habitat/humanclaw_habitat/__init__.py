"""Habitat scene datasets as scenes: hssd:/path/to/dataset#scene."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from humanclaw import hookimpl

if TYPE_CHECKING:
    import click

    from humanclaw import Scene
    from humanclaw.plugins import Register, SceneFactory

__version__ = "0.1.0"


def _open(source: str, argument: str) -> Scene:
    from humanclaw_habitat.source import load_scene

    return load_scene(source, argument)


@hookimpl
def humanclaw_scenes(register: Register[SceneFactory]) -> None:
    register("habitat", partial(_open, "habitat"), "A Habitat scene dataset: habitat:/path/to/dataset#scene.")
    register("hssd", partial(_open, "hssd"), "The Habitat Synthetic Scenes Dataset (HSSD): hssd:/path#scene.")


@hookimpl
def humanclaw_commands(cli: click.Group) -> None:
    from humanclaw.cli import LazyCommand

    summary = "Habitat scene datasets, such as HSSD, and ObjectNav episodes."
    cli.add_command(LazyCommand("habitat", "humanclaw_habitat.command:habitat", summary))
