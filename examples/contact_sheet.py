"""A picture of generated houses: python examples/contact_sheet.py [FOLDER] [HOUSES]

Writes houses.jpg: each storey from above, without ceilings. Prints how many of 20 random views in each house show only
a bare wall. The default is 12 houses, written to examples/images.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from humanclaw import Plugins, Renderer, Scene
from humanclaw.body import Pose2D, rest_pose
from humanclaw.world import Camera, MultiFloorMap, WorldState, ego_camera

NOBODY = WorldState(Pose2D(0.0, 0.0, 0.0, -100.0).to_world(rest_pose()), {})
TILE = (460, 330)
SHELL, BARE = ("wall", "floor", "ceiling"), 0.99
"""Categories of a bare wall, and the share of a view that they fill at least."""


def storey(scene: Scene, floor: float) -> Scene:
    """Return one storey without the objects above it, on the ceilings of the storey below."""
    kept = []
    for obj in scene.objects:
        low, high = (corner[1] for corner in scene.aabb(obj.id))
        over = low > floor + (1.0 if obj.category.startswith("ceiling") else 2.3)
        if not over and high > floor - 0.4:
            kept.append(obj)
    return replace(scene, objects=tuple(kept))


def from_above(scene: Scene, floor: float, size: tuple[int, int]) -> Camera:
    """Return a camera 30 m above the floor, from where walls hide little."""
    corners = np.array([[room.x0, room.z0, room.x1, room.z1] for room in scene.rooms])
    low, high = corners[:, :2].min(0) - 0.2, corners[:, 2:].max(0) + 0.2
    middle, (wide, deep) = (low + high) / 2, high - low
    up = np.array([0.0, 0.0, 1.0]) if wide / deep > size[0] / size[1] / 2 else np.array([1.0, 0.0, 0.0])
    across, along = (wide, deep) if up[2] else (deep, wide)
    need = max(along, across * size[1] / size[0])
    eye = np.array([middle[0], floor + 30.0, middle[1]])
    return Camera(eye, np.array([0.0, -1.0, 0.0]), up, float(np.degrees(2 * np.arctan(need / 2 / 27.5))), *size)


def house_tile(renderer: Renderer, scene: Scene) -> Image.Image:
    """Return a picture of the storeys side by side below the name of the house."""
    floors = sorted({room.floor for room in scene.rooms})
    size = TILE[0] // len(floors), TILE[1] - 24
    tile = Image.new("RGB", TILE, "white")
    for k, floor in enumerate(floors):
        renderer.load(storey(scene, floor))
        tile.paste(Image.fromarray(renderer.render(NOBODY, from_above(scene, floor, size)).rgb), (k * size[0], 24))
    furniture = sum(obj.room != "" and obj.category not in ("wall", "floor", "ceiling") for obj in scene.objects)
    words = (
        f"{scene.name}: {len(scene.rooms)} rooms on {len(floors)} floor{'s' * (len(floors) > 1)}, {furniture} objects"
    )
    ImageDraw.Draw(tile).text((6, 4), words, fill="black", font_size=15)
    return tile


def bare_views(renderer: Renderer, scene: Scene, seed: int, count: int = 20) -> int:
    """Return how many views from random places in random directions show only a bare wall."""
    rng, floors = np.random.default_rng(seed), MultiFloorMap.of(scene)
    places = np.concatenate(floors.starts(np.array([scene.start.x, scene.start.floor, scene.start.z]), room=0.35))
    shell = [obj.id for obj in scene.objects if obj.category in SHELL]
    renderer.load(scene)
    found = 0
    for x, floor, z in rng.permutation(places)[:count].tolist():
        place = Pose2D(x, z, float(rng.uniform(-np.pi, np.pi)), floor)
        state = WorldState(place.to_world(rest_pose()), {})
        ids = renderer.render(state, ego_camera(state.body, 96)).ids
        found += np.isin(ids, shell).mean() > BARE
    return found


def sheet(tiles: list[Image.Image], columns: int) -> Image.Image:
    wide, high = tiles[0].size
    rows = -(-len(tiles) // columns)
    whole = Image.new("RGB", (columns * wide, rows * high), "white")
    for number, tile in enumerate(tiles):
        whole.paste(tile, (number % columns * wide, number // columns * high))
    return whole


def main(folder: str = "examples/images", houses: str = "12") -> None:
    plugins = Plugins.discover()
    renderer = plugins.make("renderers", "raster")
    scenes = [plugins.scene(f"house:{number}") for number in range(int(houses))]
    path = Path(folder) / "houses.jpg"
    path.parent.mkdir(parents=True, exist_ok=True)
    sheet([house_tile(renderer, scene) for scene in scenes], 3).save(path, quality=82, optimize=True)
    print(path)
    bare = sum(bare_views(renderer, scene, number) for number, scene in enumerate(scenes))
    print(f"bare walls: {bare} of {20 * len(scenes)} views")


if __name__ == "__main__":
    main(*sys.argv[1:])
