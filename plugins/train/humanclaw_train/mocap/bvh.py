"""Reader of BVH files. Needs only numpy."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from humanclaw.body import Array
from humanclaw_train.mocap.source_motion import MocapError, SourceMotion, Tree, euler, read_text


def load_bvh(path: str | Path, licence: str = "", unit: float = 1.0) -> SourceMotion:
    """Read a BVH file. A position channel replaces its joint's offset; an end site becomes the joint `<parent>_end`.

    unit: metres per unit of the file. Raises MocapError for a broken file.
    """
    path = Path(path)
    head, _, tail = read_text(path).partition("MOTION")
    tree, channels = _bvh_tree(path, head.split())
    fps, values = _bvh_frames(path, tail.split(), sum(map(len, channels)))
    offsets = np.tile(tree.offsets, (len(values), 1, 1))
    local = np.tile(np.eye(3), (*offsets.shape[:2], 1, 1))
    first = 0
    for joint, names in enumerate(channels):
        block = values[:, first : first + len(names)]
        first += len(names)
        for column, name in enumerate(names):
            if name.endswith("position"):
                offsets[:, joint, "XYZ".index(name[0])] = block[:, column]
        turns = [column for column, name in enumerate(names) if name.endswith("rotation")]
        if turns:
            local[:, joint] = euler([names[column][0].lower() for column in turns], block[:, turns])
    positions, rotations = tree.motion(offsets[:, 0], local, offsets)
    rest = tree.rest()
    rest = replace(rest, positions=rest.positions * unit)
    return SourceMotion(fps, tree.joints, tree.parents, positions * unit, rotations, rest, str(path), licence)


def _bvh_tree(path: Path, words: list[str]) -> tuple[Tree, list[tuple[str, ...]]]:
    joints: list[str] = []
    parents: list[int] = []
    offsets: list[list[float]] = []
    channels: list[tuple[str, ...]] = []
    stack: list[int] = []
    tokens = iter(words)
    try:
        for token in tokens:
            if token in ("ROOT", "JOINT", "End"):
                name = next(tokens)
                joints.append(f"{joints[stack[-1]]}_end" if token == "End" else name)
                parents.append(stack[-1] if stack else -1)
                channels.append(())
            elif token == "{":
                stack.append(len(joints) - 1)
            elif token == "}":
                stack.pop()
            elif token == "OFFSET":
                offsets.append([float(next(tokens)) for _ in range(3)])
            elif token == "CHANNELS":
                channels[-1] = tuple(next(tokens) for _ in range(int(next(tokens))))
    except (StopIteration, IndexError, ValueError) as error:
        raise MocapError(f"{path}: the HIERARCHY of this BVH file is broken.", "Export the file again.") from error
    if not joints or len(offsets) != len(joints) or stack:
        raise MocapError(
            f"{path}: expected a BVH HIERARCHY with one OFFSET a joint.", "Check that the file is complete."
        )
    return Tree(tuple(joints), tuple(parents), np.array(offsets)), channels


def _bvh_frames(path: Path, words: list[str], width: int) -> tuple[float, Array]:
    try:
        frames, seconds = int(words[1]), float(words[4])
        values = np.array(words[5:], float)
    except (IndexError, ValueError) as error:
        raise MocapError(f"{path}: expected `Frames: N`, `Frame Time: seconds` and numbers after MOTION.") from error
    if len(values) != frames * width:
        raise MocapError(
            f"{path}: {frames} frames of {width} channels need {frames * width} numbers; the file has {len(values)}.",
            "Download the file again.",
        )
    # Frame times have six or seven digits, so a whole rate comes out slightly off: round it.
    return float(round(1.0 / seconds, 1)), values.reshape(frames, width)
