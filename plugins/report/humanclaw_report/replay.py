"""An episode and its house as data for the page's script: compressed arrays in JSON."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import cache
from typing import Any, Final

import markupsafe
import numpy as np
import scipy
from numpy.typing import NDArray

from humanclaw import Motion, RecordedEpisode, Scene
from humanclaw.body import (
    FPS,
    JOINT_INDEX,
    OFFSETS,
    PARENTS,
    SKINS,
    Array,
    matrix_from_vector,
    quaternion_from_matrix,
    skin,
)
from humanclaw.storage import jpeg
from humanclaw.world import STRUCTURE, Asset, CameraMount, Mesh, body_numbers
from humanclaw_report.camera import BEHIND, LOW, side
from humanclaw_report.episode_summary import name_of, named, shown_contacts

EVERY: Final = 2
"""Frames of motion for each frame of the replay; the page interpolates between frames."""
ABOVE: Final = 0.55
"""Height of the camera over the body in a house, radians."""
MILLIMETRES: Final = 1000.0
"""In a metre. The page gets whole numbers: shorter in JSON than metres, and finer than a pixel."""
MOST_FACES: Final = 12_000
"""The page shows the collision hulls of an asset that has more triangles than this."""
MOVED: Final = 0.001
"""An object moves in the replay if it moved farther than this, metres."""


def as_json(value: Any) -> markupsafe.Markup:
    """Return JSON for a script element; `<` is escaped, since a model may have written `</script>`."""
    return markupsafe.Markup(json.dumps(value).replace("<", "\\u003c"))


def data_uri(data: bytes, media: str) -> str:
    return f"data:{media};base64,{base64.b64encode(data).decode()}"


def packed(arrays: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """Return arrays as JSON: name, type and shape of each, and all bytes, little-endian, as base64 of gzip."""
    parts = {name: np.ascontiguousarray(array, array.dtype.newbyteorder("<")) for name, array in arrays.items()}
    # JavaScript opens a typed array only at a multiple of its element size, which is at most four bytes.
    padded = b"".join(part.tobytes() + b"\0" * (-part.nbytes % 4) for part in parts.values())
    head = [{"name": name, "type": part.dtype.name, "shape": list(part.shape)} for name, part in parts.items()]
    return {"arrays": head, "bytes": base64.b64encode(gzip.compress(padded, 6, mtime=0)).decode()}


# -- the body ----------------------------------------------------------------------------------------------------------
def skeleton(gaze: CameraMount) -> dict[str, Any]:
    """Return the body's joints, and where its eyes look."""
    return {"offsets": OFFSETS.round(4).tolist(), "parents": list(PARENTS), "gaze": asdict(gaze)}


@cache
def person() -> dict[str, Any]:
    """Return the body's skin as the page poses it: see humanclaw.body.Skin; people differ in its colours alone."""
    looks = skin()
    arrays: dict[str, NDArray[Any]] = {
        "vertices": np.round(looks.vertices * 1e4).astype(np.int16),
        "normals": np.round(looks.normals * 1e4).astype(np.int16),
        "faces": looks.faces.astype(np.uint16),
        "frames": looks.frames,
        "weights": np.round(looks.weights * 255).astype(np.uint8),
        "regions": looks.regions,
        "palettes": np.stack([skin(name).colours for name in SKINS]),
        "bind": quaternion_from_matrix(matrix_from_vector(looks.bind)).astype(np.float32),
    }
    return packed(arrays)


def replay(
    recorded: RecordedEpisode, names: Mapping[int, str], floors: Sequence[float], open_floor: bool = False
) -> dict[str, Any] | None:
    """Return the motion of the body, of other people and of objects as JSON; None if the record holds no motion.

    open_floor: nothing stands around, so the camera shows what moves, as the film does.
    """
    if not recorded.has_motion:
        return None
    simulated, generated, objects = recorded.motion(), recorded.motion("generated"), recorded.objects()
    kept = np.arange(0, len(simulated), EVERY)
    # Most objects never move: the page takes their place from the house.
    moved = [key for key, path in objects.items() if np.abs(path[:, :3] - path[0, :3]).max() > MOVED]
    people = recorded.people()
    arrays = _pose("simulated", simulated, kept) | _pose("generated", generated, kept)
    for number, person_motion in enumerate(people.values()):
        arrays |= _pose(f"person{number}", person_motion, kept)
    arrays |= {f"object_{key}": objects[key][kept].astype(np.float32) for key in moved}
    return {
        "fps": FPS / EVERY,
        "frames": len(kept),
        "camera": [side(simulated), LOW] if open_floor else [BEHIND, ABOVE],
        "body": skeleton(recorded.record.gaze),
        "looks": [number % len(SKINS) for number in body_numbers(list(people))],
        "contacts": _contacts(recorded, names),
        "floors": list(floors) or [recorded.record.start.floor],
        "targets": [[low, high] for low, high in recorded.record.targets.values()],
        "motion": packed(arrays),
    }


def _pose(kind: str, motion: Motion, kept: NDArray[np.int64]) -> dict[str, NDArray[Any]]:
    turns = quaternion_from_matrix(matrix_from_vector(motion.rotations[kept]))
    return {
        f"{kind}_root": motion.root[kept].astype(np.float32),
        # 16 bits hold a turn to 0.01 degrees, in half the bytes of float32.
        f"{kind}_turns": np.round(turns * 32767).astype(np.int16),
    }


def _contacts(recorded: RecordedEpisode, names: Mapping[int, str]) -> list[list[Any]]:
    """Return each contact above the ground: first and last frame of the replay, joint, and name of the object."""
    return [
        [(first + min(contact.frames)) / EVERY, (first + max(contact.frames)) / EVERY, JOINT_INDEX[contact.joint],
         name_of(names, contact.object_id)]
        for step, (first, _) in zip(recorded.steps, recorded.spans, strict=True)
        for contact in shown_contacts(recorded, step)
        if contact.frames
    ]  # fmt: skip


# -- the house ---------------------------------------------------------------------------------------------------------
def house(scene: Scene) -> dict[str, Any]:
    """Return a scene as textured meshes; each asset and each picture is there once."""
    names, called = sorted({obj.asset for obj in scene.objects}), named(scene)
    meshes = [_mesh(scene.assets[name]) for name in names]
    pictures: dict[bytes, int] = {}
    which = [pictures.setdefault(jpeg(mesh.texture, quality=82), len(pictures)) for mesh in meshes]
    # An index counts within its mesh, so that two bytes hold it unless a mesh has more vertices.
    index = np.uint16 if max(len(mesh.vertices) for mesh in meshes) < 65536 else np.uint32
    starts = np.cumsum([[0, 0], *([len(m.vertices), len(m.faces)] for m in meshes)], axis=0)
    arrays = {
        "vertices": np.round(np.concatenate([m.vertices for m in meshes]) * MILLIMETRES)
        .clip(-32768, 32767)
        .astype(np.int16),
        "uv": np.round(np.concatenate([m.uv for m in meshes]).clip(0, 1) * 65535).astype(np.uint16),
        "faces": np.concatenate([m.faces for m in meshes]).astype(index),
    }
    assets = [
        {"vertices": [int(a[0]), int(b[0])], "faces": [int(a[1]), int(b[1])], "picture": picture}
        for a, b, picture in zip(starts[:-1], starts[1:], which, strict=True)
    ]
    return {
        "assets": assets,
        "objects": [_object(scene, key, names, called[key]) for key in scene.by_id],
        "pictures": [data_uri(picture, "image/jpeg") for picture in pictures],
        "meshes": packed(arrays),
    }


def _object(scene: Scene, key: int, names: Sequence[str], called: str) -> dict[str, Any]:
    obj = scene.by_id[key]
    low, high = scene.aabb(key)
    return {
        "id": key,
        "asset": names.index(obj.asset),
        "name": called,
        "kind": obj.category if obj.category in STRUCTURE else "furniture",
        "place": [*obj.position, *obj.rotation],
        "box": [low.round(3).tolist(), high.round(3).tolist()],
    }


def _mesh(asset: Asset) -> Mesh:
    """Return the asset's mesh, or its collision hulls in its mean colour if the mesh is too large for a page."""
    if len(asset.mesh.faces) <= MOST_FACES or not asset.hulls:
        return asset.mesh
    vertices, faces, count = [], [], 0
    for hull in asset.hulls:
        try:
            simplices = scipy.spatial.ConvexHull(hull).simplices
        except scipy.spatial.QhullError:
            continue  # A flat piece has no volume to draw.
        vertices.append(hull)
        faces.append(_outward(hull, simplices) + count)
        count += len(hull)
    if not faces:
        return asset.mesh
    points = np.concatenate(vertices).astype(np.float32)
    colour = asset.mesh.texture.reshape(-1, 3).mean(0).astype(np.uint8)
    uv = np.full((len(points), 2), 0.5, np.float32)
    return Mesh(points, np.concatenate(faces).astype(np.int32), uv, np.tile(colour, (8, 8, 1)))


def _outward(points: Array | NDArray[np.float32], faces: NDArray[Any]) -> NDArray[Any]:
    """Return the same triangles, counter-clockwise as seen from outside."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    inside = np.einsum("ij,ij->i", np.cross(b - a, c - a), a - points.mean(0)) < 0
    faces = faces.copy()
    faces[inside] = faces[inside][:, ::-1]
    return faces
