"""Pictures of a world from a software rasterizer: colour, depth and object ids on one CPU core."""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanclaw import hookimpl

if TYPE_CHECKING:
    from humanclaw import Renderer
    from humanclaw.plugins import Register, RendererFactory

__version__ = "0.1.0"


def _renderer() -> Renderer:
    from humanclaw_raster.renderer import RasterRenderer

    return RasterRenderer()


@hookimpl
def humanclaw_renderers(register: Register[RendererFactory]) -> None:
    register("raster", _renderer, "Software rasterizer: colour, depth and object ids on one CPU core.")
