"""Write a small dataset in Habitat's format: two rooms with a doorway, and an object for every rule."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image

HALF = 0.5**0.5
"""Sine and cosine of 45 degrees, from which quaternions of quarter turns are made."""


def box(low: tuple[float, ...], high: tuple[float, ...], colour: tuple[int, ...] = (180, 120, 60)) -> trimesh.Trimesh:
    mesh = trimesh.creation.box(bounds=[low, high])
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=[*colour, 255])
    mesh.visual = trimesh.visual.TextureVisuals(material=material)
    return mesh


def write(path: Path, values: Any) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(values))
    return path


def model(path: Path, *parts: trimesh.Trimesh) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    scene = trimesh.Scene()
    for number, part in enumerate(parts):
        scene.add_geometry(part, node_name=f"part{number}", geom_name=f"part{number}")
    path.write_bytes(scene.export(file_type="glb"))
    return path


def walls() -> list[trimesh.Trimesh]:
    """8 m by 6 m, floor at 0, walls 2.7 m high; a wall at x = 4 with a doorway from z = 2.5 to 3.7."""
    grey = (200, 200, 195)
    return [
        box((0, -0.1, 0), (8, 0, 6), (150, 110, 80)), box((0, 2.7, 0), (8, 2.8, 6), (240, 240, 240)),
        box((-0.1, 0, 0), (0, 2.7, 6), grey), box((8, 0, 0), (8.1, 2.7, 6), grey),
        box((0, 0, -0.1), (8, 2.7, 0), grey), box((0, 0, 6), (8, 2.7, 6.1), grey),
        box((3.95, 0, 0), (4.05, 2.7, 2.5), grey), box((3.95, 0, 3.7), (4.05, 2.7, 6), grey),
        box((3.95, 2.1, 2.5), (4.05, 2.7, 3.7), grey),
    ]  # fmt: skip


def couch() -> list[trimesh.Trimesh]:
    """2 m wide, 0.9 m deep, 0.85 m high, seat at 0.42 m; looks to -Z as Habitat wants, its back at +Z. Origin at the
    floor."""
    red = (170, 60, 50)
    return [
        box((-1, 0, -0.45), (1, 0.42, 0.25), red), box((-1, 0, 0.25), (1, 0.85, 0.45), red),
        box((-1, 0, -0.45), (-0.85, 0.6, 0.25), red), box((0.85, 0, -0.45), (1, 0.6, 0.25), red),
    ]  # fmt: skip


def television() -> list[trimesh.Trimesh]:
    """1.2 m wide, 0.7 m high, 0.1 m deep; Z is its up and it looks to -Y. Its origin is the middle of its back's lower
    edge."""
    return [box((-0.6, -0.1, 0), (0.6, 0, 0.7), (20, 20, 25))]


def plant() -> list[trimesh.Trimesh]:
    """0.4 m wide and deep, 1 m high; its origin is at the top of the pot, 0.3 m over its bottom."""
    return [
        box((-0.2, -0.3, -0.2), (0.2, 0, 0.2), (150, 90, 60)),
        box((-0.05, 0, -0.05), (0.05, 0.7, 0.05), (40, 120, 40)),
    ]


def cup() -> list[trimesh.Trimesh]:
    """A cup of 10 cm, its origin at a lower corner."""
    return [box((0, 0, 0), (0.1, 0.1, 0.1), (240, 240, 250))]


def chair() -> list[trimesh.Trimesh]:
    """0.5 m by 0.5 m with a seat at 0.45 m and a back at +Z, 0.9 m high."""
    return [box((-0.25, 0.4, -0.25), (0.25, 0.45, 0.25)), box((-0.25, 0.45, 0.2), (0.25, 0.9, 0.25))] + [
        box((x, 0, z), (x + 0.05, 0.4, z + 0.05)) for x in (-0.25, 0.2) for z in (-0.25, 0.2)
    ]


PLACED: list[dict[str, Any]] = [
    # 0: the couch, a quarter turn to the left: what looked to -Z looks to -X.
    {"template_name": "couch1", "translation": [7.3, 0, 3], "rotation": [HALF, 0, HALF, 0], "motion_type": "STATIC"},
    # 1: the television on the wall at x = 0, its back to the wall: a quarter turn to the right, it looks to +X.
    {"template_name": "tv1", "translation": [0, 1.0, 3], "rotation": [HALF, 0, -HALF, 0], "motion_type": "STATIC"},
    # 2: the plant, stretched to one and a half times its height.
    {
        "template_name": "plant1",
        "translation": [7.5, 0.45, 5.5],
        "non_uniform_scale": [1, 1.5, 1],
        "motion_type": "KINEMATIC",
    },
    # 3: the cup, placed by its centre of mass.
    {"template_name": "cup1", "translation": [1.0, 0.05, 5.0], "translation_origin": "COM", "motion_type": "DYNAMIC"},
    # 4: the chair, with a collision model of its own, half as large again.
    {"template_name": "chair1", "translation": [1.0, 0, 1.0], "uniform_scale": 1.2, "motion_type": "STATIC"},
]
"""The objects of the scene, in order."""


def room(name: str, low: tuple[float, float], high: tuple[float, float]) -> dict[str, Any]:
    (x0, z0), (x1, z1) = low, high
    loop = [[x0, 0.02, z0], [x1, 0.02, z0], [x1, 0.02, z1], [x0, 0.02, z1]]
    return {"name": name, "label": name, "poly_loop": loop, "floor_height": 0.02, "extrusion_height": 2.7}


def write_dataset(folder: Path) -> Path:
    """The folder as the published ones are laid out; returns it."""
    write(folder / "toy.scene_dataset_config.json", {
        "stages": {"paths": {".json": ["stages"]}},
        "objects": {"default_attributes": {"friction_coefficient": 0.7}, "paths": {".json": ["objects/*"]}},
        "scene_instances": {
            "default_attributes": {"semantic_scene_instance": "%%CONFIG_NAME_AS_ASSET_FILENAME%%.semantic_config.json"},
            "paths": {".json": ["scenes"]},
        },
        "semantic_scene_descriptor_instances": {"paths": {".json": ["semantics/scenes/*"]}},
    })  # fmt: skip
    (folder / "README.md").write_text("---\nlanguage: en\nlicense: cc-by-nc-4.0\n---\n# Toy\n")
    model(folder / "stages" / "toy.glb", *walls())
    write(
        folder / "stages" / "toy.stage_config.json", {"render_asset": "toy.glb", "up": [0, 1, 0], "front": [0, 0, -1]}
    )
    for name, parts, config in (
        ("couch1", couch(), {"up": [0, 1, 0], "front": [0, 0, -1]}),
        ("tv1", television(), {"up": [0, 0, 1], "front": [0, -1, 0]}),
        ("plant1", plant(), {}),
        ("cup1", cup(), {"mass": 0.3, "friction_coefficient": 0.4}),
        ("chair1", chair(), {"collision_asset": "chair1.collider.glb"}),
    ):
        model(folder / "objects" / name[0] / f"{name}.glb", *parts)
        write(folder / "objects" / name[0] / f"{name}.object_config.json", {"render_asset": f"{name}.glb", **config})
    model(folder / "objects" / "c" / "chair1.collider.glb",
          box((-0.25, 0, -0.25), (0.25, 0.45, 0.25)), box((-0.25, 0.45, 0.2), (0.25, 0.9, 0.25)))  # fmt: skip
    (folder / "semantics").mkdir()
    (folder / "semantics" / "objects.csv").write_text(
        "id,name,main_category,wnsynsetkey\ncouch1,Red "
        "couch,couch,sofa.n.01\ntv1,Television,,television_receiver.n.01\n"
        "plant1,Ficus,potted_plant,pot_plant.n.01\ncup1,Cup,cup,cup.n.01\nchair1,Chair,chair,chair.n.01\n"
    )
    write(folder / "semantics" / "scenes" / "toy1.semantic_config.json", {
        "region_annotations": [room("living room", (0, 0), (4, 6)), room("bedroom", (4, 0), (8, 6))]
    })  # fmt: skip
    write(folder / "scenes" / "toy1.scene_instance.json", {
        "stage_instance": {"template_name": "stages/toy"}, "translation_origin": "asset_local",
        "object_instances": PLACED,
    })  # fmt: skip
    return folder


def episode(number: int, category: str, position: list[float], rotation: list[float], **more: Any) -> dict[str, Any]:
    return {"episode_id": str(number), "scene_id": "toy1", "start_position": position, "start_rotation": rotation,
            "object_category": category, "goals": [], "info": {"geodesic_distance": 5.0}, **more}  # fmt: skip


def write_episodes(folder: Path, episodes: list[dict[str, Any]], goals: dict[str, list[dict[str, Any]]]) -> Path:
    """An ObjectNav split: an empty list of all scenes, and a file a scene."""
    (folder / "content").mkdir(parents=True)
    with gzip.open(folder / "val.json.gz", "wt") as text:
        json.dump({"episodes": [], "goals_by_category": {}}, text)
    with gzip.open(folder / "content" / "toy1.json.gz", "wt") as text:
        json.dump({"episodes": episodes, "goals_by_category": goals}, text)
    return folder


def textured(path: Path, mime: str = "image/png") -> Path:
    """A box with a green picture, its base colour left white."""
    mesh = trimesh.creation.box(bounds=[(0, 0, 0), (0.1, 0.1, 0.1)])
    picture = Image.fromarray(np.full((8, 8, 3), (0, 160, 0), np.uint8))
    look = trimesh.visual.material.PBRMaterial(baseColorTexture=picture, baseColorFactor=[255, 128, 0, 255])
    mesh.visual = trimesh.visual.TextureVisuals(uv=mesh.vertices[:, :2] * 10, material=look)
    return model(path, mesh)
