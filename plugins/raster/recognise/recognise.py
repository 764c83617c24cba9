"""Measure how often a detector trained on photos recognises targets: python recognise.py [RENDERER] [HOUSE]...

Looks at every category of target in the houses (house:0 to house:11, or those named) from places where a body can
stand. Counts the targets that fill more than 3 % of a picture. A hit is a box of the right class whose intersection
over union with the target's visible pixels is 0.3 or more. A false box has a target's class and a score of 0.3 and fits
no visible object of that class, however small. The detector is CenterNet with MobileNet-v3, trained on COCO, from the
npm package @vladmandic/human. "Whole" targets are not cut by the edge of the picture; furniture may still hide a part
of them.

RENDERER: any that is registered. Needs node; `make recognise` installs the packages beside this file. Writes pictures
with hits in green and misses in red to build/recognise.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from humanclaw import Plugins, Renderer, Scene
from humanclaw.body import Pose2D, rest_pose
from humanclaw.world import MultiFloorMap, WorldState, ego_camera

HERE, OUT = Path(__file__).parent, Path("build/recognise")
DETECTOR = ("node", str(HERE / "detect.mjs"))
Box = tuple[float, float, float, float, float, str]
"""x0, y0, x1, y1 in pixels, a score from 0 to 1, and the name of a COCO category."""
CATEGORIES = ("chair", "couch", "potted_plant", "bed", "toilet", "tv")
SHARE, OVERLAP, SCORES = 0.03, 0.3, (0.3, 0.5)
"""Least share of a small picture that a target fills, least overlap with a detection, and the scores that count."""
SAME = {"succulent": "potted_plant"}
"""Categories that the detector has in one class with another count as that one."""
VISIBLE = 0.0002
"""Smallest share of a picture at which an object is visible."""
EACH, VIEWS = 2, 2
"""Number of targets per category and house that are looked at, and of views of each."""


@dataclass(frozen=True)
class Target:
    """One target in one picture. box: x0, y0, x1, y1 of its visible pixels. whole: the picture's edge does not cut it.
    share: of the picture that it fills."""

    category: str
    box: tuple[float, float, float, float]
    whole: bool
    share: float


def standing(place: np.ndarray, towards: np.ndarray) -> WorldState:
    yaw = float(np.arctan2(towards[0], towards[2]))
    return WorldState(Pose2D(float(place[0]), float(place[2]), yaw, float(place[1])).to_world(rest_pose()), {})


def views(scene: Scene, renderer: Renderer, seed: int) -> Iterator[tuple[np.ndarray, list[Target]]]:
    """Yield pictures of a house in which a chosen target is large enough, each with all visible targets."""
    rng, floors = np.random.default_rng(seed), MultiFloorMap.of(scene)
    start = np.array([scene.start.x, scene.start.floor, scene.start.z])
    places = np.concatenate(floors.starts(start, room=0.35))
    renderer.load(scene)
    for category in CATEGORIES:
        objects = list(scene.of_category(category))
        for k in rng.permutation(len(objects))[:EACH]:
            obj, left = objects[k], VIEWS
            way = np.array(obj.position) - places
            near = (np.linalg.norm(way[:, [0, 2]], axis=1) > 1.3) & (np.linalg.norm(way[:, [0, 2]], axis=1) < 4.0)
            for at in rng.permutation(np.flatnonzero(near & (np.abs(way[:, 1]) < 1.5)))[:20]:
                state = standing(places[at], way[at])
                # A small picture is enough to see how much the target fills, and is much faster to draw.
                small = renderer.render(state, ego_camera(state.body, 96))
                if left and (small.ids == obj.id).mean() > SHARE:
                    view = renderer.render(state, ego_camera(state.body))
                    yield view.rgb, targets(scene, view.ids, VISIBLE)
                    left -= 1


def targets(scene: Scene, ids: np.ndarray, share: float) -> list[Target]:
    """Return the targets that fill more than a share of the picture."""
    targets = []
    for key, count in zip(*np.unique(ids, return_counts=True), strict=True):
        obj = scene.by_id.get(int(key))
        category = SAME.get(obj.category, obj.category) if obj else ""
        if category in CATEGORIES and count > share * ids.size:
            rows, columns = np.nonzero(ids == key)
            box = float(columns.min()), float(rows.min()), float(columns.max() + 1), float(rows.max() + 1)
            whole = min(box) > 0 and box[2] < ids.shape[1] and box[3] < ids.shape[0]
            targets.append(Target(category, box, whole, float(count / ids.size)))
    return targets


def overlap(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    shared = max(wide, 0.0) * max(high, 0.0)
    area = [(box[2] - box[0]) * (box[3] - box[1]) for box in (a, b)]
    return shared / max(sum(area) - shared, 1e-9)


def score(target: Target, boxes: Sequence[Box]) -> float:
    """Return the highest score of a box of the right class over a target; 0 without one."""
    return max((box[4] for box in boxes if fits(target, box)), default=0.0)


def fits(target: Target, box: Box) -> bool:
    return box[5] == target.category.replace("_", " ") and overlap(target.box, box[:4]) >= OVERLAP


def false_boxes(visible: Sequence[Target], boxes: Sequence[Box]) -> int:
    """Return the number of boxes of a target's class that fit no visible object of the class."""
    names = {category.replace("_", " ") for category in CATEGORIES}
    sure = [box for box in boxes if box[4] >= SCORES[0] and box[5] in names]
    return sum(not any(fits(target, box) for target in visible) for box in sure)


def detected(pictures: Sequence[np.ndarray], command: Sequence[str] = DETECTOR) -> list[Sequence[Box]]:
    """Return the detector's boxes in each of (512, 512, 3) pictures.

    command: a program that reads pictures from its input, rows from the top, and answers each with a line of JSON.
    """
    data = b"".join(picture.tobytes() for picture in pictures)
    lines = subprocess.run(command, input=data, stdout=subprocess.PIPE, check=True).stdout.splitlines()
    return [json.loads(line) for line in lines]


def table(scores: list[tuple[Target, float]]) -> str:
    heads = "".join(f"{head:>9}" for head in ("targets", *(f"at {least}" for least in SCORES)) * 2)
    lines = [f"{'':<14}{'all':>9}{'':<18}{'whole':>9}", f"{'category':<14}{heads}"]
    for name in (*CATEGORIES, "all"):
        of = [(t, s) for t, s in scores if name in (t.category, "all")]
        lines.append(f"{name:<14}{_shares([s for _, s in of])}{_shares([s for t, s in of if t.whole])}")
    return "\n".join(lines)


def _shares(scores: list[float]) -> str:
    shares = (f"{np.mean([score >= least for score in scores]):.0%}" if scores else "-" for least in SCORES)
    return f"{len(scores):>9}" + "".join(f"{share:>9}" for share in shares)


def drawn(picture: np.ndarray, scored: list[tuple[Target, float]]) -> Image.Image:
    image = Image.fromarray(picture)
    for target, value in scored:
        colour = "lime" if value >= SCORES[0] else "red"
        ImageDraw.Draw(image).rectangle(target.box, outline=colour, width=2)
        ImageDraw.Draw(image).text((target.box[0] + 4, target.box[1] + 2), f"{target.category} {value:.2f}", colour)
    return image


def main(drawn_by: str = "raster", *names: str) -> None:
    plugins = Plugins.discover()
    renderer = plugins.make("renderers", drawn_by)
    OUT.mkdir(parents=True, exist_ok=True)
    scenes = [plugins.scene(name) for name in names or [f"house:{number}" for number in range(12)]]
    shown = [view for scene in scenes for view in views(scene, renderer, int(scene.name.split(":")[1].split("-")[-1]))]
    boxes = detected([picture for picture, _ in shown])
    judged, false = [], 0
    for number, ((picture, visible), seen) in enumerate(zip(shown, boxes, strict=True)):
        scored = [(target, score(target, seen)) for target in visible if target.share > SHARE]
        judged += scored
        false += false_boxes(visible, seen)
        drawn(picture, scored).save(OUT / f"{number:04d}.png")
    print(f"{len(shown)} pictures of {len(scenes)} houses, {false / max(len(shown), 1):.2f} false boxes a picture")
    print(table(judged))


if __name__ == "__main__":
    main(*sys.argv[1:])
