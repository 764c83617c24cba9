"""Measure the time and memory to load a scene as large as a real one: python plugins/habitat/bench.py

Writes a dataset to a temporary folder. Each model has three parts, 5,760 triangles, three textures of 1024 x 1024 and a
collision model of three convex parts; the building has 96 walls. Loads it twice, the first time with an empty cache.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import tempfile
import time
from pathlib import Path

import click
import numpy as np
import trimesh
from PIL import Image

sys.path.insert(0, str(Path(__file__).parent / "tests"))

from toy_dataset import PLACED, box, model, write, write_dataset

from humanclaw import Plugins


def part(rng: np.random.Generator, subdivisions: int) -> trimesh.Trimesh:
    """Return a lump with a texture."""
    lump = trimesh.creation.icosphere(subdivisions=subdivisions, radius=rng.uniform(0.15, 0.35))
    lump.apply_scale(rng.uniform(0.5, 1.5, 3))
    lump.apply_translation(rng.uniform(-0.3, 0.3, 3))
    picture = Image.fromarray(rng.integers(0, 255, (1024, 1024, 3), dtype=np.uint8))
    look = trimesh.visual.material.PBRMaterial(baseColorTexture=picture)
    lump.visual = trimesh.visual.TextureVisuals(uv=lump.vertices[:, :2] * 2, material=look)
    return lump


def write_large(folder: Path, models: int, objects: int) -> None:
    rng = np.random.default_rng(0)
    write_dataset(folder)
    with (folder / "semantics" / "objects.csv").open("a") as table:
        for number in range(models):
            parts = [part(rng, 4), part(rng, 2), part(rng, 2)]
            place = folder / "objects" / "z" / f"z{number}.glb"
            model(place, *parts)
            model(place.with_suffix(".collider.glb"), *(trimesh.convex.convex_hull(piece) for piece in parts))
            config = {"render_asset": place.name, "collision_asset": place.with_suffix(".collider.glb").name}
            write(place.with_suffix(".object_config.json"), config)
            table.write(f"z{number},lump,{rng.choice(['cabinet', 'couch', 'chair', 'lamp'])},x\n")
    walls = [box((0, -0.1, 0), (40, 0, 30))]
    for x, z in ((5 * i, 5 * j) for i in range(8) for j in range(6)):
        walls += [box((x, 0, z), (x + 0.1, 2.7, z + 3.8)), box((x, 0, z), (x + 3.8, 2.7, z + 0.1))]
    model(folder / "stages" / "toy.glb", *walls)
    file = folder / "scenes" / "toy1.scene_instance.json"
    put = [
        {"template_name": f"z{int(rng.integers(models))}", "motion_type": "STATIC",
         "translation": [float(rng.uniform(0.5, 39)), 0.4, float(rng.uniform(0.5, 29))]}
        for _ in range(objects - len(PLACED))
    ]  # fmt: skip
    write(file, json.loads(file.read_text()) | {"object_instances": [*PLACED, *put]})


@click.command()
@click.option("--models", default=60, show_default=True)
@click.option("--objects", default=700, show_default=True)
def main(models: int, objects: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        os.environ["HUMANCLAW_CACHE"] = f"{folder}/cache"
        write_large(Path(folder) / "large", models, objects)
        for which in ("first", "second"):
            begin = time.perf_counter()
            scene = Plugins.discover().scene(f"hssd:{folder}/large")
            print(f"{which} load: {time.perf_counter() - begin:.1f} s")
    triangles = sum(len(scene.assets[obj.asset].mesh.faces) for obj in scene.objects)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"{len(scene.objects)} objects of {len(scene.assets)} assets, {triangles} triangles; at most {peak:.2f} GiB")


if __name__ == "__main__":
    main()
