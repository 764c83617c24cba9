"""The map of an episode as a picture, for the poster."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from PIL import Image, ImageDraw

from humanclaw_report.maps import HouseMap, PathMap

FILLS: Final = {"fixed": "#cfc8b9", "movable": "#e6dfc9", "stairs": "#ffffff"}
GAP: Final = 16
"""Space between the pictures of a poster, pixels."""


def draw_chart(maps: Sequence[PathMap], size: tuple[int, int]) -> Image.Image:
    """Return the maps as one picture of this size (width, height), the highest storey on top."""
    sheet = Image.new("RGB", size, "white")
    height = (size[1] - GAP * (len(maps) - 1)) // len(maps)
    for row, drawn in enumerate(reversed(maps)):  # maps has the lowest storey first.
        sheet.paste(_draw_storey(drawn, (size[0], height)), (0, row * (height + GAP)))
    return sheet


def _draw_storey(path: PathMap, size: tuple[int, int]) -> Image.Image:
    chart = _Chart.of(path.box, size)
    chart.house(path.house)
    chart.walk(path)
    return chart.image.resize(size, Image.Resampling.LANCZOS)


@dataclass(frozen=True, eq=False)
class _Chart:
    """A sheet of twice the wanted size, for smooth edges, and the map from centimetres to its pixels."""

    image: Image.Image
    pen: ImageDraw.ImageDraw
    scale: float
    shift: tuple[float, float]

    @classmethod
    def of(cls, box: tuple[float, float, float, float], size: tuple[int, int]) -> _Chart:
        image = Image.new("RGB", (2 * size[0], 2 * size[1]), "white")
        scale = min(image.width / box[2], image.height / box[3])
        shift = (
            (image.width - scale * box[2]) / 2 - scale * box[0],
            (image.height - scale * box[3]) / 2 - scale * box[1],
        )
        return cls(image, ImageDraw.Draw(image), scale, shift)

    def point(self, x: float, z: float) -> tuple[float, float]:
        return x * self.scale + self.shift[0], z * self.scale + self.shift[1]

    def line(self, points: str) -> list[tuple[float, float]]:
        pairs = (pair.split(",") for pair in points.split())
        return [self.point(float(x), float(z)) for x, z in pairs]

    def corners(self, x: float, z: float, wide: float, deep: float) -> list[float]:
        return [*self.point(x, z), *self.point(x + wide, z + deep)]

    def house(self, house: HouseMap) -> None:
        for x, z, wide, deep, _ in house.rooms:
            # A little larger than the room, so that the floor continues in the doorways.
            self.pen.rectangle(self.corners(x - 8, z - 8, wide + 16, deep + 16), fill="#f3efe6")
        for outline, kind, _ in house.objects:
            self.pen.polygon(self.line(outline), fill=FILLS[kind], outline="#a8a294")
        for outline in house.walls:
            self.pen.polygon(self.line(outline), fill="#4a4e55")

    def walk(self, path: PathMap) -> None:
        for x, z, wide, deep, *_ in path.targets:
            self.pen.rectangle(self.corners(x, z, wide, deep), outline="#1b6e46", width=4)
        for points, colour, _ in path.pieces:
            self.pen.line(self.line(points), fill=colour, width=8, joint="curve")
        for mark, colour in ((path.start, "#3d6ceb"), (path.end, "#e2a030")):
            if mark is None:
                continue
            a, b = self.point(*mark[:2])
            self.pen.ellipse((a - 11, b - 11, a + 11, b + 11), fill="white", outline=colour, width=6)
