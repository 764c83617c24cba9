"""Habitat's primitive shapes, which datasets name instead of a model file: cubeSolid, icosphereSolid_subdivs_1 ...

A name is a kind of shape followed by its settings: https://aihabitat.org/docs/habitat-sim/attributesJSON.html.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from humanclaw import SceneError
from humanclaw.body import Array
from humanclaw.world import Part

DEFAULT_SCALE: Final = (0.1, 0.1, 0.1)
"""Scale of an object whose template is the shape itself, without a config."""
_NAME: Final = re.compile(
    r"(cube|icosphere|uvSphere|cylinder|cone|capsule3D)(Solid|Wireframe)((?:_[A-Za-z]+_[\w.]+?)*)"
)
_GREY: Final = (200, 200, 200)
_DEFAULTS: Final[Mapping[str, Mapping[str, float]]] = {
    "icosphere": {"subdivs": 1},
    "uvSphere": {"rings": 8, "segments": 16},
    "cylinder": {"segments": 12, "halfLen": 1.0},
    "cone": {"segments": 12, "halfLen": 1.25},
    "capsule3D": {"segments": 12, "hemiRings": 4, "halfLen": 0.75},
}
_MOST: Final = {"subdivs": 5, "rings": 128, "segments": 128, "hemiRings": 64}


def is_primitive(name: str) -> bool:
    """Return whether the name of an asset means a primitive shape, not a file."""
    return _NAME.fullmatch(name) is not None


def primitive(name: str) -> list[Part]:
    """Return a shape centred on its origin, with axis +Y: a cube of 2 m, spheres and circles of 1 m radius.

    Raises SceneError if a setting is out of range.
    """
    found = _NAME.fullmatch(name)
    if found is None:
        raise SceneError(f"{name!r} is not one of Habitat's primitive shapes.")
    settings = _settings(name, found[1], found[3])
    mesh = _made(found[1], settings)
    x, y, z = (np.asarray(mesh.vertices, float) - mesh.bounds.mean(axis=0)).T
    vertices: Array = np.stack([x, z, -y], axis=-1)
    return [Part(vertices, np.asarray(mesh.faces, np.int64), None, _GREY)]


def _settings(name: str, kind: str, text: str) -> dict[str, float]:
    """Return the settings in a name; the others have Habitat's defaults."""
    settings = dict(_DEFAULTS.get(kind, {}))
    for key, value in re.findall(r"_([A-Za-z]+)_([\d.]+)", text):
        settings[key] = float(value)
    for key, value in settings.items():
        least = {"segments": 1, "rings": 1, "halfLen": 1e-6}.get(key, 0)
        if not least <= value <= _MOST.get(key, 1000):
            raise SceneError(f"{name}: {key} cannot be {value:g}.")
    return settings


def _made(kind: str, settings: Mapping[str, float]) -> Any:
    """Return the shape as trimesh makes it, with axis +Z."""
    from trimesh import creation

    height, sections = 2 * settings.get("halfLen", 1.0), max(3, int(settings.get("segments", 12)))
    if kind == "cube":
        return creation.box((2, 2, 2))
    if kind == "icosphere":
        return creation.icosphere(int(settings["subdivs"]))
    if kind == "uvSphere":
        return creation.uv_sphere(1.0, count=[max(4, 2 * int(settings["rings"])), sections])
    if kind == "cylinder":
        return creation.cylinder(1.0, height, sections)
    if kind == "cone":
        return creation.cone(1.0, height, sections)
    return creation.capsule(height, 1.0, count=[max(4, 2 * int(settings["hemiRings"])), sections])
