"""Pictures of generated houses: python examples/contact_sheet.py [FOLDER] [HOUSES]

Writes houses.jpg (each storey from above, without ceilings) and views.jpg (what a standing body sees in them). Prints
their sizes, and how many of 20 random views in each house show only a bare wall. The default is 12 houses, written to
examples/images.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from humanclaw import Plugins, Renderer, Scene
from humanclaw.body import Pose2D, matrix_from_quaternion, rest_pose
from humanclaw.world import Camera, MultiFloorMap, WorldState, ego_camera, gaze_of
from humanclaw_scripted.truth import in_view

SUBJECTS = ("couch", "bed", "toilet", "stairs", "tv", "chair", "potted_plant", "couch", "stairs", "bed", "chair", "tv")
NOBODY = WorldState(Pose2D(0.0, 0.0, 0.0, -100.0).to_world(rest_pose()), {})
TILE, VIEW, EYES = (460, 330), 384, 1.55
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


def standing(place: Pose2D) -> WorldState:
    return WorldState(Pose2D(place.x, place.z, place.yaw, place.floor).to_world(rest_pose()), {})


def viewpoint(scene: Scene, category: str, rng: np.random.Generator) -> Pose2D:
    """Return a reachable place that faces an object of this category, 2 to 4 m away and in view."""
    floors = MultiFloorMap.of(scene)
    start = np.array([scene.start.x, scene.start.floor, scene.start.z])
    places = np.concatenate(floors.starts(start, room=0.4))
    for obj in scene.of_category(category):
        goal = _front(scene, obj.id, 1.0)
        away = np.linalg.norm(places - goal, axis=1)
        for place in rng.permutation(places[(away > 1.2) & (away < 3.2)])[:200]:
            towards = np.array(obj.position) - place
            yaw = float(np.arctan2(towards[0], towards[2]))
            here = Pose2D(float(place[0]), float(place[2]), yaw, float(place[1]))
            plan = floors.grids[int(floors.level(place))]
            if in_view(plan, scene, standing(here), obj.id, gaze_of("body")) and np.linalg.norm(towards) < 4.0:
                return here
    return scene.start


def at_stairs(scene: Scene, upper: bool) -> Pose2D:
    """Return a place that faces the stairs, in the hall or on the landing above it."""
    (stairs,) = scene.of_category("stairs")
    x, _, z = _front(scene, stairs.id, 1.3)
    dx, _, dz = np.array(stairs.position) - [x, 0, z]
    return Pose2D(float(x), float(z), float(np.arctan2(dx, dz)), max(r.floor for r in scene.rooms) if upper else 0.0)


def _front(scene: Scene, key: int, distance: float) -> np.ndarray:
    """Return the (3,) point at this distance in front of an object, metres."""
    obj = scene.by_id[key]
    reach = float(scene.assets[obj.asset].mesh.vertices[:, 2].max()) + distance
    return np.array(obj.position) + matrix_from_quaternion(np.array(obj.rotation)) @ [0.0, 0.0, reach]


def view_tile(renderer: Renderer, scene: Scene, subject: str, seed: int) -> Image.Image:
    rng = np.random.default_rng(seed)
    place = at_stairs(scene, upper=seed % 2 == 0) if subject == "stairs" else viewpoint(scene, subject, rng)
    renderer.load(scene)
    state = standing(place)
    tile = Image.fromarray(renderer.render(state, ego_camera(state.body)).rgb).resize((VIEW, VIEW), Image.LANCZOS)
    ImageDraw.Draw(tile).text((6, VIEW - 20), f"{scene.name}, {subject.replace('_', ' ')}", fill="black", font_size=14)
    return tile


def bare_views(renderer: Renderer, scene: Scene, seed: int, count: int = 20) -> int:
    """Return how many views from random places in random directions show only a bare wall."""
    rng, floors = np.random.default_rng(seed), MultiFloorMap.of(scene)
    places = np.concatenate(floors.starts(np.array([scene.start.x, scene.start.floor, scene.start.z]), room=0.35))
    shell = [obj.id for obj in scene.objects if obj.category in SHELL]
    renderer.load(scene)
    found = 0
    for x, floor, z in rng.permutation(places)[:count].tolist():
        state = standing(Pose2D(x, z, float(rng.uniform(-np.pi, np.pi)), floor))
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
    tall = [scene for scene in scenes if scene.of_category("stairs")]
    sheets = {"houses": [house_tile(renderer, scene) for scene in scenes], "views": []}
    for number, (scene, subject) in enumerate(zip(scenes, SUBJECTS, strict=False)):
        if subject == "stairs" and tall:
            scene = tall[number % len(tall)]
        elif subject == "stairs":
            subject = "chair"
        sheets["views"].append(view_tile(renderer, scene, subject, number))
    Path(folder).mkdir(parents=True, exist_ok=True)
    for name, tiles in sheets.items():
        path = Path(folder) / f"{name}.jpg"
        sheet(tiles, 3 if name == "houses" else 4).save(path, quality=82, optimize=True)
        print(f"{path}: {len(tiles)} pictures, {path.stat().st_size // 1000} kB")
    bare = sum(bare_views(renderer, scene, number) for number, scene in enumerate(scenes))
    print(f"bare walls: {bare} of {20 * len(scenes)} views")


if __name__ == "__main__":
    main(*sys.argv[1:])
