"""Generate furnished houses as scenes, each from a seed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanclaw import hookimpl

if TYPE_CHECKING:
    from humanclaw import Scene
    from humanclaw.plugins import Register, SceneFactory

__version__ = "0.1.0"


def _house(argument: str) -> Scene:
    from humanclaw_houses.reference import open_house

    return open_house(argument)


@hookimpl
def humanclaw_scenes(register: Register[SceneFactory]) -> None:
    register("house", _house, "Generated houses: house:0 to house:40 for validation, house:train-N for training.")
