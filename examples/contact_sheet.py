"""Pictures of generated houses: python examples/contact_sheet.py [FOLDER] [HOUSES] [VIEWS]

Writes houses.webp, each storey from above, without ceilings, and views.webp, rooms drawn at random as a body sees them
from far within them. The default is 41 houses and 60 views, written to docs/images.
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
TILE, VIEW = (460, 330), 320
"""Width and height of the picture of a house, and the side of a view, pixels."""


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


def room_views(renderer: Renderer, scene: Scene, seed: int, count: int) -> list[Image.Image]:
    """Return pictures of random rooms, towards their middle from the farthest place where a body can stand."""
    floors, tiles = MultiFloorMap.of(scene), []
    places = np.concatenate(floors.starts(np.array([scene.start.x, scene.start.floor, scene.start.z]), room=0.3))
    renderer.load(scene)
    for number in np.random.default_rng(seed).permutation(len(scene.rooms)):
        room = scene.rooms[number]
        low, high = np.array([room.x0, room.floor - 0.1, room.z0]), np.array([room.x1, room.floor + 0.1, room.z1])
        within = places[((low < places) & (places < high)).all(axis=1)]
        if len(tiles) < count and len(within):
            x, floor, z = within[np.argmax(np.linalg.norm(within - (low + high) / 2, axis=1))].tolist()
            yaw = float(np.arctan2((room.x0 + room.x1) / 2 - x, (room.z0 + room.z1) / 2 - z))
            state = WorldState(Pose2D(x, z, yaw, floor).to_world(rest_pose()), {})
            tiles.append(Image.fromarray(renderer.render(state, ego_camera(state.body)).rgb).resize((VIEW, VIEW)))
            ImageDraw.Draw(tiles[-1]).text((5, 3), f"{scene.name}, {room.called}", "black", font_size=13)
    return tiles


def sheet(tiles: list[Image.Image], columns: int) -> Image.Image:
    wide, high = tiles[0].size
    rows = -(-len(tiles) // columns)
    whole = Image.new("RGB", (columns * wide, rows * high), "white")
    for number, tile in enumerate(tiles):
        whole.paste(tile, (number % columns * wide, number // columns * high))
    return whole


def main(folder: str = "docs/images", houses: str = "41", views: str = "60") -> None:
    plugins = Plugins.discover()
    renderer = plugins.make("renderers", "raster")
    tiles, seen = [], []
    for number in range(count := int(houses)):
        scene = plugins.scene(f"house:{number}")
        tiles.append(house_tile(renderer, scene))
        due = int(views) * (number + 1) // count - int(views) * number // count
        seen += room_views(renderer, scene, number, due)
    Path(folder).mkdir(parents=True, exist_ok=True)
    sheet(tiles, min(count, 4)).save(Path(folder) / "houses.webp", quality=74, method=6)
    sheet(seen, min(len(seen), 5)).save(Path(folder) / "views.webp", quality=74, method=6)
    print(f"{len(tiles)} houses and {len(seen)} views in {folder}")


if __name__ == "__main__":
    main(*sys.argv[1:])
