"""Scenes as bytes, for caches. A scene that is read back has the digest of the packed one."""

from __future__ import annotations

import json
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from humanclaw.body.pose import Pose2D
from humanclaw.errors import SceneError
from humanclaw.world.scene import Asset, Mesh, Room, Scene, SceneObject

_HEAD = "scene"
_MESH = [field.name for field in fields(Mesh)]


def pack_scene(scene: Scene) -> bytes:
    """Return a safetensors file: the arrays of every asset, and one array of JSON with everything else and the
    digest."""
    arrays: dict[str, NDArray[Any]] = {}
    heads = []
    for number, asset in enumerate(scene.assets.values()):
        for name, array in vars(asset.mesh).items():
            if array is not None:
                arrays[f"{number}.{name}"] = np.ascontiguousarray(array)
        points = [np.ascontiguousarray(hull) for hull in asset.hulls]
        arrays[f"{number}.hulls"] = np.concatenate([np.zeros((0, 3), np.float32), *points])
        rest = {key: value for key, value in vars(asset).items() if key not in ("mesh", "hulls")}
        heads.append(rest | {"hulls": [len(hull) for hull in points]})
    head = {
        "name": scene.name, "assets": heads, "objects": [obj.facts for obj in scene.objects],
        "rooms": [vars(r) for r in scene.rooms], "start": vars(scene.start), "notes": dict(scene.notes),
        "digest": scene.digest,
    }  # fmt: skip
    arrays[_HEAD] = np.frombuffer(json.dumps(head).encode(), np.uint8)
    return save(arrays)


def unpack_scene(data: bytes) -> Scene:
    """Read a packed scene. Raises SceneError if the bytes are not a scene, or not the one that was packed."""
    try:
        arrays = load(data)
        head = json.loads(arrays[_HEAD].tobytes())
        assets = [_asset(number, rest, arrays) for number, rest in enumerate(head["assets"])]
        scene = Scene(
            head["name"], {asset.name: asset for asset in assets},
            tuple(SceneObject.of(row) for row in head["objects"]), tuple(Room(**row) for row in head["rooms"]),
            Pose2D(**head["start"]), head["notes"],
        )  # fmt: skip
        same = scene.digest == head["digest"]
    except (
        SafetensorError,
        LookupError,
        TypeError,
        ValueError,
        AttributeError,
        ArithmeticError,
        RecursionError,
    ) as error:
        raise SceneError(f"this is not a packed scene: {error}.") from error
    if not same:
        raise SceneError(f"the packed scene {scene.name!r} is not what its digest says.")
    return scene


def _asset(number: int, rest: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> Asset:
    ends = np.cumsum(rest.pop("hulls"), dtype=int)
    hulls = np.split(arrays[f"{number}.hulls"], ends)[:-1]
    parts = {name: arrays[f"{number}.{name}"] for name in _MESH if f"{number}.{name}" in arrays}
    return Asset(mesh=Mesh(**parts), hulls=tuple(hulls), **rest)
