"""Reader of BVH files. Needs only numpy."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import numpy as np

from humanclaw.body import Array
from humanclaw_train.mocap.source_motion import MocapError, SourceMotion, Tree, euler, read_text

_CHANNELS: Final = frozenset(f"{axis}{kind}" for axis in "xyz" for kind in ("position", "rotation"))
_SLOWEST: Final = 0.2
"""Longest time between two frames, seconds: more than that are milliseconds, or no motion."""


def load_bvh(path: Path, fps: float | None = None) -> SourceMotion:
    """Read a BVH file. A position channel replaces its joint's offset; an end site becomes the joint `<parent>_end`.

    Keywords and channels may be in capitals or not. fps: frames a second in place of what it says. Raises MocapError
    for a broken file.
    """
    head, *tail = re.split(r"^\s*MOTION\b", read_text(path), maxsplit=1, flags=re.IGNORECASE | re.MULTILINE)
    # 3ds Max writes names with blanks, such as `Bip01 L Thigh`.
    joined = re.sub(
        r"(?im)^(\s*(?:ROOT|JOINT)\b)([^{\n]*)", lambda line: f"{line[1]} {'_'.join(line[2].split())} ", head
    )
    tree, channels = _bvh_tree(path, joined.split())
    fps, values = _bvh_frames(path, "".join(tail), sum(map(len, channels)), fps)
    offsets = np.tile(tree.offsets, (len(values), 1, 1))
    local = np.tile(np.eye(3), (*offsets.shape[:2], 1, 1))
    first = 0
    for joint, names in enumerate(channels):
        block = values[:, first : first + len(names)]
        first += len(names)
        for column, name in enumerate(names):
            if name.endswith("position"):
                offsets[:, joint, "xyz".index(name[0])] = block[:, column]
        turns = [column for column, name in enumerate(names) if name.endswith("rotation")]
        if turns:
            local[:, joint] = euler([names[column][0] for column in turns], block[:, turns])
    return tree.motion(path, fps, offsets[:, 0], local, offsets)


def _bvh_tree(path: Path, words: list[str]) -> tuple[Tree, list[tuple[str, ...]]]:
    joints: list[str] = []
    parents: list[int] = []
    offsets: list[list[float]] = []
    channels: list[tuple[str, ...]] = []
    stack: list[int] = []
    tokens = iter(words)
    try:
        for token in tokens:
            keyword = token.upper()
            if keyword in ("ROOT", "JOINT", "END"):
                name = next(tokens)
                joints.append(f"{joints[stack[-1]]}_end" if keyword == "END" else name)
                parents.append(stack[-1] if stack else -1)
                channels.append(())
            elif token == "{":
                stack.append(len(joints) - 1)
            elif token == "}":
                stack.pop()
            elif keyword == "OFFSET":
                offsets.append([float(next(tokens)) for _ in range(3)])
            elif keyword == "CHANNELS":
                channels[-1] = tuple(next(tokens).lower() for _ in range(int(next(tokens))))
    except (StopIteration, IndexError, ValueError) as error:
        raise MocapError(f"{path}: the HIERARCHY of this BVH file is broken.", "Export the file again.") from error
    if not joints or len(offsets) != len(joints) or stack:
        raise MocapError(
            f"{path}: expected a BVH HIERARCHY with one OFFSET a joint.", "Check that the file is complete."
        )
    _check_hierarchy(path, joints, parents, channels)
    return Tree(tuple(joints), tuple(parents), np.array(offsets)), channels


def _check_hierarchy(path: Path, joints: list[str], parents: list[int], channels: list[tuple[str, ...]]) -> None:
    """Raise MocapError for several roots, and for channels that are neither position nor rotation."""
    if len(roots := [name for name, parent in zip(joints, parents, strict=True) if parent < 0]) > 1:
        raise MocapError(
            f"{path}: expected one ROOT; got {', '.join(roots)}.",
            "Export each body to a file of its own, without props.",
        )
    if unknown := sorted({name for names in channels for name in names} - _CHANNELS):
        raise MocapError(
            f"{path}: expected channels of positions and rotations; got the channel {unknown[0]}.",
            "Export the file without it.",
        )


def _bvh_frames(path: Path, text: str, width: int, fps: float | None) -> tuple[float, Array]:
    said = re.match(r"\s*Frames:\s*(\d+)\s*Frame\s+Time:\s*(\S+)(.*)", text, re.IGNORECASE | re.DOTALL)
    try:
        if said is None:
            raise ValueError("these words are missing")
        frames, seconds = int(said[1]), 1 / fps if fps else float(said[2].replace(",", "."))
        values = np.array(said[3].split(), float)
    except ValueError as error:
        expected = "expected `Frames: N`, `Frame Time: seconds` and numbers after MOTION"
        raise MocapError(f"{path}: {expected}; {error}.", "Correct the file, or export it again.") from error
    if not fps and not 0 < seconds <= _SLOWEST:
        expected = f"`Frame Time` must be seconds, above 0 and at most {_SLOWEST}"
        raise MocapError(f"{path}: {expected}; got {said[2]}.", "Give the frames a second: --fps 30.")
    if len(values) != frames * width:
        raise MocapError(
            f"{path}: {frames} frames of {width} channels need {frames * width} numbers; the file has {len(values)}.",
            "The file is cut off, or its Frames is wrong.",
        )
    # Frame times have six or seven digits, so a whole rate comes out slightly off: round it.
    return fps or float(round(1.0 / seconds, 1)), values.reshape(frames, width)
