"""OBJ files: the polygons of each material, in the colours and pictures of their MTL files."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from humanclaw.body.pose import Array
from humanclaw.errors import SceneError
from humanclaw.world.meshes.parts import PLAIN, Part, mean_colour, picture_of, text_of
from humanclaw.world.meshes.polygons import cut

_MATERIALS: Final = 3000
"""Maximum materials: each becomes a part."""
_OPTION: Final = re.compile(r"-(?:([ost])((?:\s+[-+]?\.?\d[-+.\de]*){1,3})|mm\s+\S+\s+\S+|\w+\s+\S+)\s+")
"""An option before the name of a picture: s scales it, o moves it."""
_CONTINUED: Final = re.compile(r"(?<![^\0-\x7f])\\\n")
"""The end of a line that goes on. Behind a letter, a backslash is the second half of one in Shift-JIS."""

Corner = tuple[int, int]
"""Numbers of its vertex and its uv; -1 for no uv."""


def obj_parts(data: bytes, beside: Callable[[str], bytes], lost: Counter[str]) -> list[Part]:
    """Return the parts of an OBJ file. beside: reads a file that it names. lost: counts what is left out.

    Raises SceneError for a corner that it does not have, and for more materials than it may have.
    """
    file = _File(beside, lost)
    for line in _CONTINUED.sub(" ", text_of(data)).split("\n"):
        file.take(line)
    if len(file.polygons) > _MATERIALS:
        raise SceneError(f"it has more than {_MATERIALS:,} materials.", "Join those that look alike.")
    return [file.part(*key) for key in file.polygons]


@dataclass
class _Material:
    """Colour and picture of a material, with the numbers of the picture's options."""

    colour: tuple[int, int, int] | None = None
    picture: str = ""
    options: dict[str, list[float]] = field(default_factory=dict)

    def take_picture(self, words: str) -> None:
        """Take the name of its picture, behind its options."""
        while option := _OPTION.match(words):
            self.options[option[1]] = [float(number) for number in (option[2] or "").split()]
            words = words[option.end() :]
        self.picture = words

    def placed(self, uv: Array) -> Array:
        """Return (N, 2) places in its picture, scaled and moved as it says."""
        scale, move = ([*self.options.get(key, ()), usual, usual][:2] for key, usual in (("s", 1.0), ("o", 0.0)))
        return np.asarray(uv * scale + move)


@dataclass
class _File:
    """A file, as far as it is read."""

    beside: Callable[[str], bytes]
    lost: Counter[str]
    vertices: list[list[str]] = field(default_factory=list)
    uvs: list[list[str]] = field(default_factory=list)
    polygons: dict[tuple[str, bool], list[list[Corner]]] = field(default_factory=lambda: defaultdict(list))
    """By the name of their material, and whether all their corners have uv."""
    materials: dict[str, _Material] = field(default_factory=lambda: defaultdict(_Material))
    current: str = ""
    """Material of the polygons that follow."""
    told: str = ""
    """Material of the lines of an MTL file that follow."""

    def take(self, line: str) -> None:
        """Take a line of an OBJ or MTL file."""
        word, _, rest = line.replace("\t", " ").strip().partition(" ")
        numbers = rest.partition("#")[0].split()
        match word.lower():
            case "v":
                self.vertices.append(numbers)
            case "vt":
                self.uvs.append(numbers)
            case "f" | "fo":
                corners = [self._corner(word) for word in numbers]
                self.polygons[self.current, all(uv >= 0 for _, uv in corners)].append(corners)
            case "l" | "p":
                self.lost["lines and points"] += 1
            case "usemtl":
                self.current = rest.strip()
            case "mtllib":
                for name in re.split(r"(?<=\.mtl)\s+", rest.strip(), flags=re.IGNORECASE):
                    self._library(name)
            case "newmtl":
                self.told = rest.strip()
            case "kd":
                values = [min(max(float(number.replace(",", ".")), 0.0), 1.0) for number in numbers]
                red, green, blue = (values * 3)[:3]  # One number is a grey.
                self.materials[self.told].colour = round(255 * red), round(255 * green), round(255 * blue)
            case "map_kd":
                self.materials[self.told].take_picture(rest.strip())

    def _library(self, name: str) -> None:
        try:
            lines = text_of(self.beside(name)).split("\n")
        except (OSError, ValueError):
            self.lost[f"files that cannot be read ({name})"] += 1
            return
        for line in lines:
            try:
                self.take(line)
            except ValueError:  # As of a Kd of a spectrum.
                self.lost[f"lines that cannot be read ({name})"] += 1

    def _corner(self, word: str) -> Corner:
        point, place, *_ = *word.split("/"), ""
        uv = _number(place, self.uvs) if place else -1
        return _number(point, self.vertices), uv if uv in range(len(self.uvs)) else -1

    def part(self, name: str, has_uv: bool) -> Part:
        """Return the polygons of a material, all with or all without uv."""
        material, polygons = self.materials[name], self.polygons[name, has_uv]
        counts = np.array([len(corners) for corners in polygons])
        points, places = np.array([corner for corners in polygons for corner in corners], np.int64).reshape(-1, 2).T
        size = len(self.vertices)
        if (wrong := points[(points < 0) | (points >= size)] + 1).size:
            raise SceneError(f"a face names vertex {wrong[0]} of {size}.", "Check that the file is complete.")
        keys = points * (len(self.uvs) + 1) + places
        _, first, corners = np.unique(keys, return_index=True, return_inverse=True)
        starts = np.cumsum(counts) - counts
        loops = [corners[starts[counts == count, None] + np.arange(count)] for count in np.unique(counts)]
        rows = [self.vertices[point] for point in points[first]]
        vertices = np.array([row[:3] for row in rows], float).reshape(-1, 3)
        colour, uv, picture = material.colour, None, None
        if colour is None and rows and all(len(row) > 5 for row in rows):  # Place and colour.
            colour = mean_colour(np.array([row[3:6] for row in rows], float), self.lost)
        if material.picture and has_uv:
            picture = picture_of(material.picture, self.beside, self.lost)
            uv = material.placed(np.array([self.uvs[place][:2] for place in places[first]], float))
        elif material.picture:
            self.lost["pieces without places in their picture"] += 1
        return Part(vertices, cut(vertices, loops, self.lost), uv, colour or PLAIN, picture)


def _number(word: str, rows: list[list[str]]) -> int:
    """Return a number from 0. OBJ counts from 1, or back from the last row before this line."""
    number = int(word)
    if not number:
        raise SceneError("a face names corner 0: OBJ counts from 1.", "Add 1 to the numbers of its faces.")
    return number - 1 if number > 0 else len(rows) + number
