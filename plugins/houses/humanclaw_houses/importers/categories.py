"""Find the category of a model and check its size, by the table categories.toml."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any, Final

from humanclaw_houses.importers.source_models import Vec3

_UNITS: Final = {"metres": 1.0, "centimetres": 0.01, "millimetres": 0.001, "inches": 0.0254, "feet": 0.3048}
"""Name of a unit to metres."""
_FACTORS: Final = (1.0, 0.95, 1.05, 0.9, 1.1, 0.85, 1.18, 0.8, 1.25, 0.75, 1.33, 0.7, 1.4)
_AXES: Final = ("width", "height", "depth")


@cache
def _table() -> Mapping[str, Any]:
    return tomllib.loads(resources.files(__package__).joinpath("categories.toml").read_text("utf-8"))


def category_of(name: str, group: str = "") -> str:
    """Return the category of a model by its name, or else by its group in the collection; empty if none fits."""
    if _words(group).strip() in _table()["skip_groups"]:
        return ""
    for text in (name, group):
        words = _words(text)
        for rule in _table()["rule"]:
            if any(re.search(f" {re.escape(word)}(s|es)? ", words) for word in rule["words"]):
                return "" if rule.get("skip") else str(rule["category"])
    return ""


def _words(name: str) -> str:
    """Return a name in lower case with a space around each word. Camel case is split into words."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()
    return " " + re.sub(r"[^a-z]+", " ", apart).strip() + " "


def otherwise(category: str, size: Vec3) -> str:
    """Return the category that fits the size: a table 0.4 m high is a coffee table."""
    others = _table()["otherwise"].get(category, ())
    return next((other for other in (category, *others) if not misfit(other, size)), category)


def misfit(category: str, size: Vec3, seat: float | None = None) -> str:
    """Return the reason why a size is impossible for a category; empty if it is possible.

    Width and depth may be swapped, because the front is not known yet. size: metres.
    """
    limits = _table()["sizes"][category]
    off = [
        [
            (axis, value)
            for axis, value in zip(_AXES, way, strict=True)
            if not limits[axis][0] <= value <= limits[axis][1]
        ]
        for way in (size, (size[2], size[1], size[0]))
    ]
    if all(off):
        axis, value = off[0][0]
        return f"{value:.2f} m {axis}, a {category} has {limits[axis][0]} to {limits[axis][1]}"
    if "seat" in limits and seat is not None and not limits["seat"][0] <= seat <= limits["seat"][1]:
        return f"its seat is {seat:.2f} m high, that of a {category} {limits['seat'][0]} to {limits['seat'][1]}"
    return ""


def sits(category: str) -> bool:
    """Return whether objects of a category are seats."""
    return "seat" in _table()["sizes"][category]


def scale_of(category: str, extent: Vec3) -> tuple[str, float] | None:
    """Return the first unit in which an extent is a possible size: its name, and metres per file unit.

    Models in toy-like kits are somewhat too large or too small, so 0.7 to 1.4 times a unit is allowed. None if no unit
    fits.
    """
    for factor in _FACTORS:
        for name, metres in _UNITS.items():
            scale = metres * factor
            if not misfit(category, (extent[0] * scale, extent[1] * scale, extent[2] * scale)):
                return (name if factor == 1.0 else f"{name}, scaled by {factor}"), scale
    return None
