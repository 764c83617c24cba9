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


def _camera(*, lens: bool = False, noise: bool = False) -> Renderer:
    from humanclaw_raster.camera import CameraRenderer

    return CameraRenderer(_renderer(), lens=lens, noise=noise)


@hookimpl
def humanclaw_renderers(register: Register[RendererFactory]) -> None:
    register("raster", _renderer, "Software rasterizer: colour, depth and object ids on one CPU core.")
    register("raster-2x", partial(_renderer, smooth=True), "raster with smooth edges, from 2 x 2 samples per pixel.")
    register("raster-lens", partial(_camera, lens=True), "raster through a mild wide-angle lens.")
    register("raster-noise", partial(_camera, noise=True), "raster with the noise of a camera's sensor.")
    register("raster-camera", partial(_camera, lens=True, noise=True), "raster with lens and noise.")
