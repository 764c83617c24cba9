"""The implementations that a body is made of, by name. Imports no numpy, so that commands answer at once."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Self

from humanclaw.errors import HumanclawError, PluginError

if TYPE_CHECKING:
    from humanclaw.plugins.host import Plugins

SHIPPED: Final = "lite"
"""The motion prior that comes with the package."""
SENSORS: Final = ("vision", "body", "touch")
"""Senses that an observation can report. Vision, the picture, is always on."""
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
    """'default' or 'paper': settings of the simulator and of the motion solver."""
    sensors: tuple[str, ...] = ("vision",)
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
        raise PluginError("no simulator is installed.", "Run `pip install humanclaw-mujoco`.")
    return preferred[0]


def check_sensors(names: Iterable[str]) -> tuple[str, ...]:
    """Return the wanted senses and vision, in a fixed order. Raises HumanclawError for an unknown one."""
    asked = set(names)
    unknown = asked - set(SENSORS)
    if unknown:
        raise HumanclawError(f"there is no sensor {sorted(unknown)[0]!r}.", f"Choose from: {', '.join(SENSORS)}.")
    return tuple(name for name in SENSORS if name in asked | {"vision"})
