"""What a body is made of, by name: free of numpy, so that a command answers before it loads anything."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Self

from humanclaw.errors import HumanclawError, PluginError

if TYPE_CHECKING:
    from humanclaw.plugins.host import Plugins

SENSORS: Final = ("vision", "body", "touch")
"""Vision is always on: it is the picture."""
SIMULATORS: Final = ("bullet", "mujoco")
"""Which one a body runs in where nobody says: the benchmark's rows are Bullet's, which has no wheels for the newest
Pythons."""


@dataclass(frozen=True)
class Backends:
    """Names of the implementations to use, as plugins registered them."""

    simulator: str = ""
    """Empty: the first of SIMULATORS that is installed, or else whatever is."""
    renderer: str = "raster"
    generator: str = "dit"
    profile: str = "default"
    """'default' or 'paper': settings of the simulator and the motion solver."""
    sensors: tuple[str, ...] = ("vision",)
    """What an observation tells of the last call (humanclaw.sensors); vision is the picture, and always on."""

    def chosen(self, plugins: Plugins) -> Self:
        """Return the same with every name filled in and in order: what records and versions name. Raises
        HumanclawError for an unknown sensor, PluginError if no simulator is installed."""
        simulator = self.simulator or default_simulator(plugins)
        return replace(self, simulator=simulator, sensors=check_sensors(self.sensors))


def default_simulator(plugins: Plugins) -> str:
    """Choose the first of SIMULATORS that is installed, or else whatever is. Raises PluginError if nothing is."""
    installed = [offer.name for offer in plugins.registered("simulators")]
    preferred = [name for name in SIMULATORS if name in installed] or installed
    if not preferred:
        raise PluginError("no simulator is installed.", "Run `pip install humanclaw-mujoco`.")
    return preferred[0]


def check_sensors(names: Iterable[str]) -> tuple[str, ...]:
    """Put the sensors asked for, vision among them, in a fixed order. Raises HumanclawError for an unknown one."""
    asked = set(names)
    unknown = asked - set(SENSORS)
    if unknown:
        raise HumanclawError(f"there is no sensor {sorted(unknown)[0]!r}.", f"Choose from: {', '.join(SENSORS)}.")
    return tuple(name for name in SENSORS if name in asked | {"vision"})
