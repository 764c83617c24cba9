"""Pictures of a world from a software rasterizer: colour, depth and object ids on one CPU core."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from humanclaw import hookimpl

if TYPE_CHECKING:
    from humanclaw import Renderer
    from humanclaw.plugins import Register, RendererFactory

__version__ = "0.1.0"


def _renderer(*, smooth: bool = False) -> Renderer:
    from humanclaw_raster.renderer import RasterRenderer

    return RasterRenderer(smooth=smooth)


@hookimpl
def humanclaw_renderers(register: Register[RendererFactory]) -> None:
    register("raster", _renderer, "Software rasterizer: colour, depth and object ids on one CPU core.")
    register("raster-2x", partial(_renderer, smooth=True), "raster with smooth edges, from 2 x 2 samples per pixel.")
