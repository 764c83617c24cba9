"""The implementations that a body is made of, by name. Imports no numpy, so that commands answer at once."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Self

from humanclaw.errors import HumanclawError, PluginError
from humanclaw.plugins.distributions import install
from humanclaw.text.words import did_you_mean

if TYPE_CHECKING:
    from humanclaw.plugins.host import Plugins

SHIPPED: Final = "lite"
"""The motion prior that comes with the package."""
VISION: Final = "vision"
"""The sense that is always on: the picture."""
SENSORS: Final = (VISION, "body", "touch")
"""Vision, the positions of the own limbs, and their contacts."""
MOTION_HISTORIES: Final = ("generated", "simulated")
"""Sources of the frames that a motion continues: the model's own poses, or the body's (humanclaw.body.next_history)."""
SIMULATORS: Final = ("bullet", "mujoco")
"""Simulators by preference, if none is named. Bullet comes first because the benchmark's tables were made with it; it
has no wheels for the newest Pythons."""


@dataclass(frozen=True)
class Backends:
    """Names of the implementations to use, as registered by plugins."""

    simulator: str = ""
    """Empty: the first installed one of SIMULATORS, or else any installed one."""
    renderer: str = "raster"
    generator: str = "dit"
    profile: str = "default"
    """'default' or 'paper': settings of the simulator and of generated motion."""
    sensors: tuple[str, ...] = (VISION,)
    """Senses that an observation reports (see SENSORS)."""
    prior: str = SHIPPED
    """The motion prior that the generator runs."""
    gaze: str = "body"
    """Where the eyes look (humanclaw.world.GAZES)."""
    motion_history: str = "generated"
    """The frames that a motion continues: one of MOTION_HISTORIES."""

    def chosen(self, plugins: Plugins) -> Self:
        """Return the same with defaults filled in and senses in a fixed order, as records name them.

        Raises HumanclawError for an unknown sense or motion history, PluginError if no simulator is installed.
        """
        if self.motion_history not in MOTION_HISTORIES:
            raise HumanclawError(
                f"there is no motion history {self.motion_history!r}.", f"Choose from: {', '.join(MOTION_HISTORIES)}."
            )
        simulator = self.simulator or default_simulator(plugins)
        return replace(self, simulator=simulator, sensors=check_sensors(self.sensors))


def default_simulator(plugins: Plugins) -> str:
    """Return the first installed one of SIMULATORS, or else any installed one. Raises PluginError if there is none."""
    installed = [offer.name for offer in plugins.registered("simulators")]
    preferred = [name for name in SIMULATORS if name in installed] or installed
    if not preferred:
        raise PluginError("no simulator is installed.", f"Run `{install(['humanclaw-mujoco'])}`.")
    return preferred[0]


def check_sensors(names: Iterable[str]) -> tuple[str, ...]:
    """Return the wanted senses and vision, in a fixed order. Raises HumanclawError for an unknown one."""
    asked = set(names)
    if unknown := sorted(asked - set(SENSORS)):
        nearest = did_you_mean(unknown[0], SENSORS) or f"Choose from: {', '.join(SENSORS)}."
        raise HumanclawError(f"there is no sensor {unknown[0]!r}.", nearest)
    return tuple(name for name in SENSORS if name in asked | {VISION})
