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
from humanclaw.world.meshes.parts import (
    CLAMPED,
    CLEAR,
    PLAIN,
    SHINING,
    Part,
    goes_beyond,
    mean_colour,
    numbers,
    picture_of,
    text_of,
    wrong_line,
)
from humanclaw.world.meshes.polygons import Indices, cut

_MATERIALS: Final = 3000
"""Maximum materials: each becomes a part."""
_OPTION: Final = re.compile(r"-(?:([ost])((?:\s+[-+]?\.?\d[-+.\de]*){1,3})|mm\s+\S+\s+\S+|\w+\s+\S+)\s+")
"""An option before the name of a picture: s scales it, o moves it."""
_CONTINUED: Final = re.compile(r"(?<![^\0-\x7f])\\ *\n")
"""The end of a line that goes on. Behind a letter, a backslash is the second half of one in Shift-JIS."""
_FACE: Final = re.compile(r"fo?( +-?0(/(-?0)?(/(-?0)?)?)?)* *", re.IGNORECASE)
"""A line of a face, all its numbers 0."""
_NONE: Final = 1 << 62
"""Number of the uv of a corner that has none: more than there are."""
_WORDS: Final = str.maketrans("fFoO/", "     ")


def obj_parts(data: bytes, beside: Callable[[str], bytes], lost: Counter[str]) -> list[Part]:
    """Return the parts of an OBJ file. beside: reads a file that it names. lost: counts what is left out.

    Raises SceneError for a line that cannot be read, for a corner that the file does not have, and for more materials
    than it may have.
    """
    text = text_of(data).replace("\t", " ")
    if "\\" in text:
        text = _CONTINUED.sub(" ", f"{text}\n")
    if text.startswith(" ") or "\n " in text:
        text = re.sub(r"(?m)^ +", "", text)
    file = _File(_Lines(text), beside, lost)
    if len(file.polygons) > _MATERIALS:
        raise SceneError(f"it has more than {_MATERIALS:,} materials.", "Join those that look alike.")
    return [file.part(*key) for key in sorted(file.polygons)]


class _Lines:
    """The lines of a text by their first two letters, without a loop over them: a scan has millions."""

    def __init__(self, text: str) -> None:
        self._data = np.frombuffer(f"{text}\n\n".encode(), np.uint8)
        starts = np.append(0, np.flatnonzero(self._data == ord("\n")) + 1)[:-1]
        self._lengths = np.diff(starts)
        self._heads = [self._data[starts[:-1] + k] | 32 for k in (0, 1)]  # In lower case; a blank stays one.

    def where(self, *heads: str) -> Indices:
        """Return the numbers of the lines that begin with one of heads."""
        first, second = self._heads
        chosen = [(first == ord(head[0])) & (second == ord(head[1]) if head[1:] else True) for head in heads]
        return np.flatnonzero(np.any(chosen, axis=0))

    def others(self, *heads: str) -> Indices:
        """Return the numbers of the lines that begin with none of heads."""
        return np.setdiff1d(np.arange(len(self._lengths)), self.where(*heads), assume_unique=True)

    def text(self, numbers: Indices) -> str:
        """Return these lines, each with its end."""
        chosen = np.zeros(len(self._lengths), bool)
        chosen[numbers] = True
        return bytes(self._data[: self._lengths.sum()][np.repeat(chosen, self._lengths)]).decode()


@dataclass
class _Material:
    """Colour and picture of a material, with the numbers of the picture's options."""

    colour: tuple[int, int, int] | None = None
    picture: str = ""
    options: dict[str, list[float]] = field(default_factory=dict)
    clamped: bool = False
    """Whether its picture ends at its edges."""
    lost: set[str] = field(default_factory=set)
    """What is left out of each piece of it."""

    def take(self, word: str, rest: str) -> None:
        """Take a line of an MTL file. Raises ValueError if it cannot be read."""
        numbers = rest.partition("#")[0].split()
        match word.lower():
            case "kd":
                values = [min(max(float(number.replace(",", ".")), 0.0), 1.0) for number in numbers]
                red, green, blue = (values * 3)[:3]  # One number is a grey.
                self.colour = round(255 * red), round(255 * green), round(255 * blue)
            case "map_kd":
                self.take_picture(rest.strip())
            case "d" | "tr" if numbers and float(numbers[-1]) != (word.lower() == "d"):
                self.lost.add(CLEAR)
            case "map_d":
                self.lost.add(CLEAR)
            case "ke" if any(float(number) > 0 for number in numbers):
                self.lost.add(SHINING)
            case "map_ke":
                self.lost.add(SHINING)

    def take_picture(self, words: str) -> None:
        """Take the name of its picture, behind its options."""
        while option := _OPTION.match(words):
            self.clamped |= re.fullmatch(r"-clamp\s+on\s+", option[0]) is not None
            self.options[option[1]] = [float(number) for number in (option[2] or "").split()]
            words = words[option.end() :]
        self.picture = words

    def placed(self, uv: Array) -> Array:
        """Return (N, 2) places in its picture, scaled and moved as it says."""
        scale, move = ([*self.options.get(key, ()), usual, usual][:2] for key, usual in (("s", 1.0), ("o", 0.0)))
        return np.asarray(uv * scale + move)


class _File:
    """A file: its vertices, places in pictures, materials, and the polygons of each of those."""

    def __init__(self, lines: _Lines, beside: Callable[[str], bytes], lost: Counter[str]) -> None:
        self._beside, self._lost = beside, lost
        self._lines, points, places = lines, lines.where("v "), lines.where("vt")
        self._vertices = numbers(lines.text(points), 1, 3, 6, np.nan)
        self._uvs = numbers(lines.text(places), 1, 1, 2, 0.0)
        self._materials, self._names = defaultdict[str, _Material](_Material), [""]
        self._changes: list[int] = []
        """Numbers of the lines from which on the polygons have the next of the names."""
        others = lines.others("v ", "vt", "vn", "f ", "fo", "#", "*")
        for number, line in zip(others.tolist(), lines.text(others).split("\n"), strict=False):
            self._take(number, line)
        self.polygons = defaultdict[tuple[int, bool], list[Indices]](list)
        """(K, corners, 2) numbers of vertices and of uv, -1 for none; by the first use of their material, and whether a
        corner has no uv."""
        self._take_faces(lines.where("f ", "fo"), points, places)

    def _take(self, number: int, line: str) -> None:
        """Take a line of anything but numbers."""
        word, _, rest = line.strip().partition(" ")
        match word.lower():
            case "v":
                raise wrong_line(line, "3 numbers")
            case "l" | "p":
                self._lost["lines and points"] += 1
            case "surf" | "curv" | "curv2":
                self._lost["curved surfaces"] += 1
            case "usemtl":
                self._names.append(rest.strip())
                self._changes.append(number)
            case "mtllib":
                for name in re.split(r"(?<=\.mtl)\s+", rest.strip(), flags=re.IGNORECASE):
                    self._library(name)

    def _library(self, name: str) -> None:
        try:
            lines = text_of(self._beside(name)).split("\n")
        except (OSError, ValueError):
            self._lost[f"files that cannot be read ({name})"] += 1
            return
        material = _Material()
        for line in lines:
            word, _, rest = line.replace("\t", " ").strip().partition(" ")
            if word.lower() == "newmtl":
                material = self._materials[rest.strip()]
                continue
            try:
                material.take(word, rest)
            except ValueError:  # As of a Kd of a spectrum.
                self._lost[f"lines that cannot be read ({name})"] += 1

    def _take_faces(self, where: Indices, points: Indices, places: Indices) -> None:
        """Take the polygons of the lines of these numbers. points, places: those of the vertices and uv."""
        first = {name: self._names.index(name) for name in set(self._names)}
        used = np.array([first[name] for name in self._names])[np.searchsorted(self._changes, where)]
        above = np.stack([np.searchsorted(points, where), np.searchsorted(places, where)], axis=-1)
        lines = self._lines.text(where).split("\n")[:-1]
        for shape, rows in _alike(lines).items():
            corners = _corners(shape, [lines[k] for k in rows])
            if (corners == 0).any():
                raise SceneError("a face names corner 0: OBJ counts from 1.", "Add 1 to the numbers of its faces.")
            corners = np.where(corners > 0, corners - 1, corners + above[rows, None])
            corners[..., 1][(corners[..., 1] < 0) | (corners[..., 1] >= above[rows, None, 1])] = -1
            keys = 2 * used[rows] + (corners[..., 1] < 0).any(axis=1)
            order = np.argsort(keys, kind="stable")
            for some in np.split(order, np.flatnonzero(np.diff(keys[order])) + 1):
                self.polygons[int(keys[some[0]]) // 2, bool(keys[some[0]] % 2)].append(corners[some])

    def part(self, number: int, bare: bool) -> Part:
        """Return the polygons of a material; bare: those of which a corner has no uv."""
        material = self._materials[self._names[number]]
        blocks = sorted(self.polygons[number, bare], key=lambda block: block.shape[1])
        points, places = np.concatenate([block.reshape(-1, 2) for block in blocks]).T
        size = len(self._vertices)
        if (wrong := points[(points < 0) | (points >= size)] + 1).size:
            raise SceneError(f"a face names vertex {wrong[0]} of {size}.", "Check that the file is complete.")
        _, first, corners = np.unique(points * (len(self._uvs) + 1) + places, return_index=True, return_inverse=True)
        ends = np.cumsum([block[..., 0].size for block in blocks])[:-1]
        loops = [c.reshape(block.shape[:2]) for c, block in zip(np.split(corners, ends), blocks, strict=True)]
        rows = self._vertices[points[first]]
        colour, uv, picture = material.colour, None, None
        if colour is None and np.isfinite(rows[:, 3:]).all() and len(rows):  # Place and colour.
            colour = mean_colour(rows[:, 3:], self._lost)
        self._lost.update(material.lost)
        if material.picture and not bare and np.isfinite(self._uvs[places[first]]).all():
            picture = picture_of(material.picture, self._beside, self._lost)
            uv = material.placed(self._uvs[places[first]])
            if material.clamped and goes_beyond(uv):
                self._lost[CLAMPED] += 1
        elif material.picture:
            self._lost["pieces without places in their picture"] += 1
        return Part(rows[:, :3], cut(rows[:, :3], loops, self._lost), uv, colour or PLAIN, picture)


def _alike(lines: list[str]) -> dict[str, Indices]:
    """Return the numbers of the lines of each shape, which is a line with 0 for each of its numbers."""
    data = np.frombuffer("\n".join(lines).encode(), np.uint8).copy()
    digit = (data >= ord("0")) & (data <= ord("9"))
    data[digit] = ord("0")
    again = digit & np.append(False, digit[:-1])
    shapes = data[~again].tobytes().decode().split("\n") if lines else []
    if len(set(shapes)) == 1:
        return {shapes[0]: np.arange(len(lines))}
    numbers_of = defaultdict[str, list[int]](list)
    for number, shape in enumerate(shapes):
        numbers_of[shape].append(number)
    return {shape: np.array(some) for shape, some in numbers_of.items()}


def _corners(shape: str, lines: list[str]) -> Indices:
    """Return the (K, corners, 2) numbers of vertex and uv, as they are written, of K lines of a shape; _NONE for no uv.

    Raises SceneError, which quotes the first line, if its shape is not a face's.
    """
    if "#" in shape:
        shape, lines = shape.partition("#")[0], [line.partition("#")[0] for line in lines]
    if not _FACE.fullmatch(shape):
        raise wrong_line(lines[0], "numbers of its corners, as in f 1/1 2/2 3/3")
    words = [word.split("/") for word in shape.split()[1:]]
    written = np.fromstring("\n".join(lines).translate(_WORDS), np.int64, sep=" ").reshape(len(lines), -1)
    written = np.pad(written, ((0, 0), (0, 1)), constant_values=_NONE)
    at, columns = 0, list[tuple[int, int]]()
    for word in words:
        columns.append((at, at + 1 if any(word[1:2]) else -1))
        at += sum(map(bool, word))
    return written[:, np.array(columns, int).reshape(-1, 2)]
