"""PLY, OFF and STL files."""

from __future__ import annotations

import re
import struct
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from humanclaw.body.pose import Array
from humanclaw.errors import SceneError
from humanclaw.world.meshes.parts import PLAIN, Part, mean_colour, numbers, picture_of, text_of, wrong_line
from humanclaw.world.meshes.polygons import Indices, cut

Rows = NDArray[Any]

_KINDS: Final = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_CORNERS: Final = ("vertex_indices", "vertex_index")
_FORMATS: Final = ("ascii", "binary_little_endian", "binary_big_endian")
_RGB: Final = ("red", "green", "blue")
_UV: Final = (("texture_u", "texture_v"), ("u", "v"), ("s", "t"))


class _Field(NamedTuple):
    """A property of an element of a PLY file."""

    name: str
    kind: np.dtype[Any]
    length: np.dtype[Any] | None
    """Kind of the number before the values of a list; None for a single value."""


_Element = tuple[str, int, list[_Field]]
"""Name, number of rows and properties of an element."""


# -- PLY ---------------------------------------------------------------------------------------------------------------
def ply_parts(data: bytes, beside: Callable[[str], bytes], lost: Counter[str]) -> Iterator[Part]:
    """Yield the triangles of a PLY file. beside: reads a file that it names. lost: counts what is left out."""
    elements, picture = _ply(data)
    (vertex,), faces = elements["vertex"] or [np.zeros(0, [(axis, "f4") for axis in "xyz"])], elements["face"]
    points = np.stack([vertex[axis].astype(float) for axis in "xyz"], axis=1)
    loops = [_whole(rows[key]) for rows in faces for key in _CORNERS if key in _names(rows)]
    uv = next((np.stack([vertex[u], vertex[v]], 1) for u, v in _UV if {u, v} <= _names(vertex)), None)
    if faces and all("texcoord" in _names(rows) for rows in faces):  # MeshLab gives each corner its own.
        uv = np.concatenate([rows["texcoord"].reshape(-1, 2) for rows in faces])
        points = points[np.concatenate([loop.ravel() for loop in loops])]
        starts = np.cumsum([0, *(loop.size for loop in loops)])
        loops = [start + np.arange(loop.size).reshape(loop.shape) for start, loop in zip(starts, loops, strict=False)]
    texture = picture_of(picture, beside, lost) if picture and uv is not None else None
    coloured = [rows for rows in (vertex, *faces) if len(rows) and {*_RGB} <= _names(rows)]
    colour = mean_colour(np.stack([coloured[0][key] for key in _RGB], axis=1), lost) if coloured else PLAIN
    yield Part(points, cut(points, loops, lost), None if uv is None else uv.astype(float), colour, texture)


def _whole(values: Rows) -> Indices:
    """Return numbers of vertices. Raises ValueError for one between two."""
    if values.dtype.kind == "f" and (wrong := values[values != np.floor(values)]).size:
        raise ValueError(f"a polygon names vertex {wrong[0]}")
    return values.astype(np.int64)


def _ply(data: bytes) -> tuple[dict[str, list[Rows]], str]:
    """Return the elements of a PLY file by name, and the name of its picture; empty without one.

    The rows of an element are in groups whose lists are equally long.
    """
    head = re.match(rb"ply\s.*?end_header *\r?\n?", data, re.DOTALL)
    if not head:
        raise ValueError("it does not begin with the header of a PLY file")
    lines = [line.split() for line in head[0].decode("utf-8", "replace").splitlines()]
    written = next((words[1] for words in lines if words[:1] == ["format"] and words[1:]), "")
    if written not in _FORMATS:
        raise SceneError(f"its format must be {', '.join(_FORMATS)}, not {written!r}.", "Export it again.")
    order = {"ascii": "", "binary_big_endian": ">"}.get(written, "<")
    listed, body = _listed(lines, order), data[head.end() :]
    if not order:
        body = _packed(body, listed)
    elements, at = defaultdict[str, list[Rows]](list), 0
    for name, count, fields in listed:
        elements[name], at = _rows(body, at, count, fields)
    return elements, next((" ".join(words[2:]) for words in lines if words[:2] == ["comment", "TextureFile"]), "")


def _listed(lines: Iterable[Sequence[str]], order: str) -> list[_Element]:
    """Return what the lines of a header say of the elements. order: of bytes; empty for numbers in text."""
    listed: list[_Element] = []
    for words in lines:
        try:
            if words[:1] == ["element"]:
                listed.append((words[1], len(range(int(words[2]))), []))
            elif words[:1] == ["property"]:
                *kinds, name = words[1:]
                *length, kind = [np.dtype(order + _KINDS[k] if order else "<f8") for k in kinds if k != "list"]
                listed[-1][2].append(_Field(name, kind, length[0] if length else None))
        except (IndexError, KeyError, ValueError) as error:
            raise wrong_line(" ".join(words), "an element with its count, or a property with its type") from error
    return listed


def _packed(text: bytes, listed: Iterable[_Element]) -> bytes:
    """Return numbers in text as bytes: of each line as many as its element has, since some programs write more."""
    lines = filter(bytes.strip, text.splitlines())
    return b"".join(_packed_row(line, fields) for _, count, fields in listed for line in islice(lines, count))


def _packed_row(line: bytes, fields: Sequence[_Field]) -> bytes:
    try:
        row = np.array(line.split(), "<f8").tobytes()
        return row[: _lengths(row, 0, fields)[1]]
    except ValueError as error:
        raise wrong_line(line.decode("utf-8", "replace"), "a number for each property of its header") from error


def _rows(data: bytes, at: int, count: int, fields: Sequence[_Field]) -> tuple[list[Rows], int]:
    """Return the rows of an element, in groups whose lists are equally long, and where the next element begins."""
    if not count or not fields:
        return [], at
    kind = _kind(fields, _lengths(data, at, fields)[0])
    if at + count * kind.itemsize <= len(data):
        rows = np.frombuffer(data, kind, count, at)
        if all((rows[f"#{field.name}"] == rows[f"#{field.name}"][0]).all() for field in fields if field.length):
            return [rows], at + count * kind.itemsize
    groups = defaultdict[tuple[int, ...], list[bytes]](list)
    for _ in range(count):
        lengths, end = _lengths(data, at, fields)
        groups[lengths].append(data[at:end])
        at = end
    return [np.frombuffer(b"".join(rows), _kind(fields, lengths)) for lengths, rows in groups.items()], at


def _lengths(data: bytes, at: int, fields: Sequence[_Field]) -> tuple[tuple[int, ...], int]:
    """Return the lengths of the lists of a row, and where the next row begins. Raises ValueError if the data end."""
    sizes = []
    for _, kind, length in fields:
        size = 1
        if length:
            number = np.frombuffer(data, length, 1, at)[0]
            size = int(number)
            if size != number or size < 0:
                raise ValueError(f"a list has {number} values")
            at += length.itemsize
            sizes.append(size)
        at += size * kind.itemsize
    if at > len(data):
        raise ValueError(f"its data end after {len(data)} bytes, in the middle of a row")
    return tuple(sizes), at


def _kind(fields: Sequence[_Field], lengths: Iterable[int]) -> np.dtype[Any]:
    left, parts = iter(lengths), list[Any]()
    for name, kind, length in fields:
        parts += [(f"#{name}", length), (name, kind, (next(left),))] if length else [(name, kind)]
    return np.dtype(parts)


def _names(rows: Rows) -> set[str]:
    return set(rows.dtype.names or ())


# -- the others --------------------------------------------------------------------------------------------------------
def off_parts(data: bytes, beside: Callable[[str], bytes], lost: Counter[str]) -> Iterator[Part]:
    """Yield the triangles of an OFF file, whose colours and normals are left out. lost: counts what else is."""
    text = "\n".join(line.partition("#")[0] for line in text_of(data).split("\n"))
    head, *rows = [*filter(str.strip, re.sub(r"^\s*(ST)?C?N?OFF", "", text).split("\n"))] or [""]
    if not re.match(r"\s*\d+\s+\d+", head):
        raise ValueError(f"it must be an OFF file in text with its counts; it begins with {head[:20]!r}")
    vertices, count = map(int, head.split()[:2])
    if len(rows) < vertices + count:
        raise ValueError(f"it ends after {len(rows)} of {vertices + count} lines")
    points = numbers("\n".join(rows[:vertices]), 0, 3, 3, np.nan)
    groups = defaultdict[int, list[list[int]]](list)
    for loop in map(_loop, rows[vertices : vertices + count]):
        groups[len(loop)].append(loop)
    yield Part(points, cut(points, (np.array(loops, np.int64) for loops in groups.values()), lost), None, PLAIN)


def _loop(line: str) -> list[int]:
    """Return the corners of a polygon of an OFF file, behind their count and before its colour."""
    words = line.split()
    try:
        size, *corners = map(int, words[: max(int(words[0]), 0) + 1])
    except ValueError:
        size, corners = -1, []
    if size != len(corners):
        raise wrong_line(line, "a count and as many numbers of vertices")
    return corners


def stl_parts(data: bytes, beside: Callable[[str], bytes], lost: Counter[str]) -> Iterator[Part]:
    """Yield the triangles of an STL file, in bytes or text. Raises ValueError if it holds more or fewer."""
    corners = _stl_bytes(data) if b"\0" in data else _stl_text(text_of(data))
    yield Part(corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3), None, PLAIN)


def _stl_bytes(data: bytes) -> Array:
    size = 84 + 50 * struct.unpack_from("<I", data, 80)[0] if len(data) >= 84 else 84
    if size > len(data):
        raise ValueError(f"it ends after {len(data)} of {size} bytes")
    held, rest = divmod(len(data) - 84, 50)  # 80 bytes of header and the count; 12 floats and 2 bytes a triangle.
    if not rest and len(data) > size:
        raise ValueError(f"its header counts {(size - 84) // 50} triangles; it holds {held}")
    rows = np.frombuffer(data[84:size], [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("colour", "<u2")])
    return rows["corners"].astype(float)


def _stl_text(text: str) -> Array:
    lines = text.lower().split("\n")
    counts = Counter(words[0] for line in lines if (words := line.split(maxsplit=1)))
    if counts["endsolid"] < counts["solid"] or counts["vertex"] != 3 * counts["facet"]:
        raise ValueError("it ends in the middle of a solid")
    return numbers("".join(f"{line}\n" for line in lines if line.split(maxsplit=1)[:1] == ["vertex"]), 1, 3, 3, np.nan)
