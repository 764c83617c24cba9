"""Half-physics and pictures on Bullet (paper, section "Locomotion-Decoupled Physical Simulation")."""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanclaw.hookspecs import RegisterFactory, hookimpl

if TYPE_CHECKING:
    from humanclaw.interfaces import Renderer, Simulator

__version__ = "0.1.0"


def _simulator(profile: str = "default") -> Simulator:
    from humanclaw_bullet.simulator import HalfPhysics

    return HalfPhysics(profile)


def _renderer() -> Renderer:
    from humanclaw_bullet.renderer import BulletRenderer

    return BulletRenderer()


@hookimpl
def humanclaw_simulators(register: RegisterFactory) -> None:
    register("bullet", _simulator, "Half-physics on Bullet: driven by pose velocities, carried by contact and gravity.")


@hookimpl
def humanclaw_renderers(register: RegisterFactory) -> None:
    register("bullet", _renderer, "Bullet's software rasteriser: colour, depth and object ids on one CPU core.")
