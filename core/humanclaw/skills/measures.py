"""Measures: named, signed quantities of half a second of motion that parameters command.

A skill's schema.json declares its role (`x-role`) and the measure that each trained parameter commands (`x-measure`).
Scoring, training and calling read these declarations and never a skill's name. Plugins add measures through the
hook `humanclaw_measures`. Needs numpy alone, so that training runs where there is no plugin host.

    {"x-role": "locomotion", "properties": {"z_cm": {"type": "integer", "x-measure": "hips.forward", ...}}, ...}
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import pi
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, Literal, get_args

import numpy as np

from humanclaw.body.pose import HISTORY, Array, heading
from humanclaw.errors import PluginError
from humanclaw.storage.files import MIB, read_file

Role = Literal["locomotion", "sit", "posture", "gesture", "grasp", "release", "stop"]
"""The purpose of a skill: `locomotion` takes the body somewhere or turns it, `sit` lowers it onto a seat, `posture`
changes how it stands, `gesture` moves limbs in place, `grasp` closes a hand and `release` opens it, `stop` declares the
task complete and ends the episode."""
ROLES: Final[tuple[Role, ...]] = get_args(Role)
_UNITS: Final = MappingProxyType({"_cm": ("m", 0.01), "_deg": ("rad", pi / 180)})
"""Ending of a name to the SI unit and the factor into it."""


# -- measures ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Measure:
    """One number of a chunk: how far the body got, turned or rose.

    function: canonical chunks, root (N, 20, 3) and rotations (N, 20, 24, 3), 5 frames of history and 15 of future, to
    (N,) in SI.
    """

    name: str
    unit: Literal["m", "rad"]
    description: str
    mirror: Literal[1, -1] | None
    """Sign of the value once left and right have changed places; None for a measure of one side, such as the height of
    the right hand, which is worked out anew from the mirrored motion."""
    function: Callable[[Array, Array], Array]

    def __call__(self, root: Array, rotations: Array) -> Array:
        """Measure canonical chunks: root (N, 20, 3) and rotations (N, 20, 24, 3) to (N,), SI."""
        return np.asarray(self.function(root, rotations))


def _rise(root: Array, rotations: Array) -> Array:
    return np.asarray(root[:, -1, 1] - root[:, HISTORY - 1, 1])


_BUILTIN: Final = (
    Measure("hips.left", "m", "Displacement of the hips to the left of where they faced.", -1, lambda p, r: p[:, -1,
    0]),
    Measure("hips.forward", "m", "Displacement of the hips to where they faced.", 1, lambda p, r: p[:, -1, 2]),
    Measure("hips.back", "m", "Displacement of the hips away from where they faced.", 1, lambda p, r: -p[:, -1, 2]),
    Measure("heading.left", "rad", "Change of heading, a left turn positive.", -1, lambda p, r: heading(r[:, -1, 0])),
    Measure("hips.rise", "m", "Rise of the hips, as by the height of a stair step climbed.", 1, _rise),
    Measure("hips.drop", "m", "Descent of the hips, as by the height of a stair step.", 1, lambda p, r: -_rise(p, r)),
    Measure("hips.height", "m", "Height of the hips above the floor at the end.", 1, lambda p, r: p[:, -1, 1]),
)  # fmt: skip
MEASURES: Final[Mapping[str, Measure]] = MappingProxyType({measure.name: measure for measure in _BUILTIN})
"""The measures that come with the core, by name. Displacements and turns are from the last history frame to the last
frame."""


# -- declarations ------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Parameter:
    """A parameter of a skill as its schema declares it, and the measure that it commands."""

    key: str
    """Its name in the schema and in calls, with its unit: z_cm."""
    measure: str
    """Name of a measure; empty for a parameter that commands none."""
    low: float
    """Least value that may be asked for, SI; minus infinity without a bound."""
    high: float

    @property
    def name(self) -> str:
        """Its name behind the contract, in Control.values and in the adapter's header: the key without its unit, z for
        z_cm."""
        return si_name(self.key)


def read_schema(folder: Path) -> dict[str, Any]:
    """Read the schema.json of a skill's folder. Raises PluginError if it is missing or no JSON object."""
    try:
        text = read_file(folder / "schema.json", MIB).decode("utf-8")
        schema = json.loads(text)
    except (OSError, ValueError, RecursionError) as error:
        raise PluginError(f"skill folder {folder.name!r}: schema.json cannot be read: {error}.") from error
    if not isinstance(schema, dict):
        raise PluginError(f"skill folder {folder.name!r}: schema.json holds no object.", "Write a JSON schema.")
    return schema


def parameters_of(schema: Mapping[str, Any]) -> tuple[Parameter, ...]:
    """Return the parameters of a schema, in its order."""
    return tuple(_parameter(key, part) for key, part in schema.get("properties", {}).items())


def _parameter(key: str, part: Mapping[str, Any]) -> Parameter:
    low, high = part.get("minimum", float("-inf")), part.get("maximum", float("inf"))
    return Parameter(key, part.get("x-measure", ""), to_si(key, low), to_si(key, high))


def si_name(key: str) -> str:
    """Return the name of a parameter without its unit: z for z_cm, yaw for yaw_deg."""
    return next((key.removesuffix(unit) for unit in _UNITS if key.endswith(unit)), key)


def si_unit(key: str) -> str:
    """Return the unit of a parameter behind the contract: m for z_cm, rad for yaw_deg, empty for a name without one."""
    return _unit_of(key)[0]


def to_si(key: str, value: float) -> float:
    """Convert a parameter to SI: names that end in _cm become metres, in _deg radians; others stay as they are."""
    return float(value) * _unit_of(key)[1]


def from_si(key: str, value: float) -> float:
    """Convert a parameter to the unit of its name: the inverse of to_si."""
    return float(value) * (1 / _unit_of(key)[1])  # 1 / 0.01 is 100; a quotient by 0.01 would round otherwise.


def _unit_of(key: str) -> tuple[str, float]:
    return next((unit for suffix, unit in _UNITS.items() if key.endswith(suffix)), ("", 1.0))


def outcomes(
    parameters: Sequence[Parameter], root: Array, rotations: Array, measures: Mapping[str, Measure] = MEASURES
) -> Array:
    """Return what chunks achieve of each parameter: canonical root (N, 20, 3) and rotations (N, 20, 24, 3) to (N, k),
    SI.

    Raises PluginError for a parameter that commands no known measure.
    """
    columns = [find(parameter, measures)(root, rotations) for parameter in parameters]
    return np.stack(columns, -1) if columns else np.zeros((len(root), 0))


def find(parameter: Parameter, measures: Mapping[str, Measure] = MEASURES) -> Measure:
    """Find the measure that a parameter commands. Raises PluginError if there is none of that name."""
    if parameter.measure not in measures:
        raise PluginError(
            f"parameter {parameter.key!r} commands {parameter.measure or 'no measure'!r}, which nothing here measures.",
            f"Set its x-measure to one of: {', '.join(measures)}; or register it with the hook humanclaw_measures.",
        )
    return measures[parameter.measure]
