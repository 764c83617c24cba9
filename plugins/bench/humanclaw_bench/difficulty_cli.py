"""`humanclaw bench difficulty`: how hard a split is, as numbers and as the paper's figure 7, with a route a tier."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import click
import numpy as np
from PIL import Image, ImageDraw

from humanclaw import EpisodeSpec, HumanclawError, Plugins, Renderer, Scene
from humanclaw.body import rest_pose
from humanclaw.storage import save_picture
from humanclaw.world import Camera, DistanceField, MultiFloorMap, WorldState, goals_at
from humanclaw_bench.difficulty import THRESHOLDS, TIERS, Tier, overall, scores_of, tier_of, tiers
from humanclaw_bench.splits import load_split, summary

COLOURS: Final = {"easy": "#2f8f57", "medium": "#2f6fd6", "hard": "#d6407f"}
BARS: Final = {"distance": (0.5, "m"), "choice": (1.0, "turns and rooms"), "obstacle": (0.5, "objects within 1 m")}
"""Width of a histogram's bar, and its unit."""
SIDE: Final = 400
"""Side of a histogram and of a map, pixels."""
_TITLE: Final = 30
"""Height of a title, pixels."""
_FINE: Final = 2
"""A map is drawn this much larger, for smooth lines."""


@click.command()
@click.option("--split", "name", default="val", show_default=True, help="A split, or a file of episodes.")
@click.option("--out", type=click.Path(path_type=Path), help="Also draw a picture: PNG or JPEG file.")
@click.option("--renderer", default="raster", show_default=True, help="Name of the renderer that draws the routes.")
def difficulty(name: str, out: Path | None, renderer: str) -> None:
    """Print how hard the episodes of a split are; --out also draws histograms, and a route of each tier."""
    specs = [spec for spec in load_split(name) if spec.difficulty]
    if not specs:
        raise HumanclawError(f"no episode of split {name!r} has a difficulty.", "Name another split, such as val.")
    for key, value in summary(specs).items():
        click.echo(f"{key:<13} {value}")
    if out:
        click.echo(save_picture(picture(specs, Plugins.discover(), renderer), out))


def picture(specs: Sequence[EpisodeSpec], plugins: Plugins, renderer: str) -> Image.Image:
    """Draw a histogram of each dimension above the route of an episode of each tier. Raises HumanclawError."""
    for spec in specs:
        if not spec.start or not spec.target_ids:
            lost = "target_ids" if spec.start else "start"
            problem = f"a route goes from start to target_ids; episode {spec.id!r} has no {lost}."
            raise HumanclawError(problem, "Give it both, or leave out --out.")
    sheet = Image.new("RGB", (SIDE * len(TIERS), 2 * SIDE + _TITLE), "white")
    counts = Counter(overall(spec.difficulty) for spec in specs if spec.difficulty)
    drawing: Renderer = plugins.make("renderers", renderer)
    try:
        for column, (dimension, tier) in enumerate(zip(THRESHOLDS, TIERS, strict=True)):
            values = [scores_of(spec.difficulty)[dimension] for spec in specs if spec.difficulty]
            sheet.paste(histogram(dimension, values), (column * SIDE, 0))
            spec = typical(specs, tier)
            sheet.paste(_route(spec, plugins.scene(spec.scene), drawing), (column * SIDE, SIDE + _TITLE))
            assert spec.difficulty
            facts = ", ".join(f"{key} {value:g}" for key, value in scores_of(spec.difficulty).items())
            place = (column * SIDE + 10, SIDE + _TITLE / 2)
            ImageDraw.Draw(sheet).text(
                place, f"{tier}, {counts[tier]} of {len(specs)}: {spec.target_category}, {facts}", COLOURS[tier],
                font_size=13, anchor="lm",
            )  # fmt: skip
    finally:
        drawing.close()
    return sheet


def histogram(dimension: str, values: Sequence[float]) -> Image.Image:
    """Draw how many episodes have which value, up to the largest of 99 % of them, in the colours of the tiers."""
    width, unit = BARS[dimension]
    # A threshold belongs to the tier below it, so each bar holds its upper edge.
    counts = np.bincount(np.maximum(np.ceil(np.array(values) / width).astype(int) - 1, 0))
    counts = counts[: max(1, int(np.ceil(np.quantile(values, 0.99) / width)))]
    image = Image.new("RGB", (SIDE, SIDE), "white")
    draw, step, base = ImageDraw.Draw(image), (SIDE - 40) / len(counts), SIDE - 40
    for number, count in enumerate(counts):
        x, colour = 20 + number * step, COLOURS[tier_of(dimension, (number + 0.5) * width)]
        draw.rectangle((x + 1, base - 280 * count / counts.max(), x + step - 1, base), colour)
    for mark in (0, *THRESHOLDS[dimension], len(counts) * width):
        draw.text((20 + mark / width * step, base + 6), f"{mark:g}", "black", font_size=15, anchor="ma")
    draw.text((20, 12), f"{dimension}, {unit}", "black", font_size=18)
    shares = Counter(tier_of(dimension, value) for value in values)
    for number, tier in enumerate(TIERS):
        legend = f"{tier} {shares[tier] / len(values):.0%}"
        draw.text((SIDE - 20, 12 + 22 * number), legend, COLOURS[tier], font_size=17, anchor="ra")
    return image


def typical(specs: Sequence[EpisodeSpec], tier: Tier) -> EpisodeSpec:
    """Return the episode whose dimensions are all of a tier and whose way is of the median length of such ones.

    Raises HumanclawError if there is none.
    """
    known = [(spec, spec.difficulty) for spec in specs if spec.difficulty]
    fitting = sorted((hard.distance, spec.id, spec) for spec, hard in known if set(tiers(hard).values()) == {tier})
    if not fitting:
        raise HumanclawError(f"no episode is {tier} in every dimension.", "Name a larger split with --split.")
    return fitting[len(fitting) // 2][2]


def _route(spec: EpisodeSpec, scene: Scene, renderer: Renderer) -> Image.Image:
    """Draw the shortest way of an episode on its house from above, without what begins over its highest head."""
    assert spec.difficulty
    assert spec.start
    floors, colour = MultiFloorMap.of(scene), COLOURS[overall(spec.difficulty)]
    goals = np.concatenate([goals_at(floors, scene, key) for key in spec.target_ids])
    way = DistanceField.of(floors, goals).path(np.array([spec.start.x, spec.start.floor, spec.start.z]))
    top = way[:, 1].max() + 1.9
    seen = (obj for obj in scene.objects if obj.category != "ceiling" and scene.aabb(obj.id)[0][1] < top)
    renderer.load(replace(scene, objects=tuple(seen)))
    camera = _above(scene)
    image = Image.fromarray(renderer.render(WorldState(spec.start.to_world(rest_pose()), {}), camera).rgb)
    draw, points = ImageDraw.Draw(image), [(float(x), float(y)) for x, y in camera.pixels(way)]
    draw.line(points, colour, 6 * _FINE, "curve")
    draw.circle(points[0], 7 * _FINE, "white", colour, 3 * _FINE)
    draw.circle(points[-1], 7 * _FINE, colour, "white", 3 * _FINE)
    return image.resize((SIDE, SIDE), Image.Resampling.LANCZOS)


def _above(scene: Scene) -> Camera:
    """Return a camera far above a house, with all rooms in its picture; +X is right and +Z down."""
    corners = np.array([[(room.x0, room.z0), (room.x1, room.z1)] for room in scene.rooms])
    low, high = corners.min((0, 1)), corners.max((0, 1))
    # From so far that the rays are nearly parallel.
    (x, z), metres = (low + high) / 2, 80.0
    # Half the longer side is .5: the rest is a margin.
    fov = float(np.degrees(2 * np.arctan(0.56 * (high - low).max() / metres)))
    down, north = np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, -1.0])
    return Camera(np.array([x, metres, z]), down, north, fov, _FINE * SIDE, _FINE * SIDE)
