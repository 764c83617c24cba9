"""Generated, furnished houses: a scene from a seed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanclaw.hookspecs import RegisterFactory, hookimpl

if TYPE_CHECKING:
    from humanclaw.scene import Scene

__version__ = "0.1.0"


def _house(argument: str) -> Scene:
    from humanclaw_houses.source import house

    return house(argument)


@hookimpl
def humanclaw_scenes(register: RegisterFactory) -> None:
    register("house", _house, "Generated houses: house:0 to house:40 for validation, house:train-N for training.")
