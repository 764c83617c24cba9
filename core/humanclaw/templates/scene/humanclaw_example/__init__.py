"""DESCRIPTION"""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanclaw import hookimpl

if TYPE_CHECKING:
    from humanclaw import Scene
    from humanclaw.hookspecs import Register, SceneFactory

__version__ = "0.1.0"


@hookimpl
def humanclaw_scenes(register: Register[SceneFactory]) -> None:
    register("example", _scene, "A room with a chair in a place of its own: example:0, example:1 ...")


def _scene(argument: str) -> Scene:
    from humanclaw_example.scene import make

    return make(argument)
