"""List the imported assets that a detector recognises: python pieces.py LIBRARY [RENDERER] > known.txt

Each target of an asset library (humanclaw assets import) stands in front of the wall of a plain room and is seen from
five sides. The detector of recognise.py must recognise it in at least half of the pictures, with a score of 0.3.

The output is the list for `humanclaw assets import --only`: an id per line, followed by a comment with the number of
hits and the mean score. Other assets are written as comments. Install the detector with `make recognise`.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from recognise import CATEGORIES, OUT, SCORES, Target, detected, score, standing, targets

from humanclaw import Plugins, Renderer, Scene
from humanclaw.testing import SceneBuilder
from humanclaw.world import Asset, SceneObject, ego_camera
from humanclaw_houses.library import Library

SIDES = (-60, -30, 0, 30, 60)
"""Angles from the front of an asset at which it is seen, degrees."""
HALF = 0.5
"""Share of the pictures in which the detector must recognise it."""
SMALL = 0.005
"""Smallest share of a picture that an asset fills. Low, because the room holds no other target."""
STAND = 0.5
"""Height of the stand under a television, metres."""


def room(asset: Asset) -> tuple[Scene, int]:
    """Return a scene with an asset in front of a wall, facing +Z, and the id of the object."""
    builder, tall = SceneBuilder(), STAND if asset.category == "tv" else 0.0
    wide, _, deep = np.ptp(asset.mesh.vertices, axis=0).tolist()
    builder.box("floor", (9, 0.2, 9), (0, -0.2, 3.5), (150, 108, 70))
    builder.box("ceiling", (9, 0.2, 9), (0, 2.6, 3.5), (240, 240, 238))
    builder.box("wall", (9, 2.6, 0.1), (0, 0, -deep / 2 - 0.1), (222, 218, 208))
    if tall:
        builder.box("tv_stand", (wide + 0.2, tall, max(deep, 0.4)), (0, 0, 0), (120, 84, 56))
    builder.assets[asset.name] = asset
    builder.objects.append(SceneObject(len(builder.objects) + 1, asset.name, asset.category, (0.0, tall, 0.0)))
    return builder.scene(), len(builder.objects)


def looked_at(asset: Asset, renderer: Renderer) -> list[tuple[np.ndarray, Target]]:
    """Return pictures of an asset, each with its place in the picture."""
    scene, key = room(asset)
    renderer.load(scene)
    far, seen = 1.0 + 0.7 * float(np.ptp(asset.mesh.vertices, axis=0)[[0, 2]].max()), []
    for angle in np.radians(SIDES):
        place = far * np.array([np.sin(angle), 0.0, np.cos(angle)])
        state = standing(place, -place)
        view = renderer.render(state, ego_camera(state.body))
        found = targets(scene, np.where(view.ids == key, view.ids, 0), SMALL)
        seen += [(view.rgb, target) for target in found]
    return seen


def line(name: str, category: str, scores: Sequence[float]) -> str:
    known = [value >= SCORES[0] for value in scores]
    told = f"{category} {sum(known)} of {len(scores)}, {np.mean(scores) if scores else 0:.2f}"
    return f"{name}  # {told}" if known and np.mean(known) >= HALF else f"# {name}: {told}"


def main(folder: str, drawn_by: str = "raster-2x") -> None:
    library, renderer = Library(Path(folder)), Plugins.discover().make("renderers", drawn_by)
    OUT.mkdir(parents=True, exist_ok=True)
    entries = [entry for entry in library.entries if entry.category in CATEGORIES]
    views = [looked_at(library.asset(entry), renderer) for entry in entries]
    boxes = iter(detected([picture for seen in views for picture, _ in seen]))
    for entry, seen in zip(entries, views, strict=True):
        print(line(entry.id, entry.category, [score(target, next(boxes)) for _, target in seen]))


if __name__ == "__main__":
    main(*sys.argv[1:])
