"""Reader of AMC motion on its ASF skeleton. Needs only numpy."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from humanclaw.body import Array
from humanclaw_train.mocap.source_motion import MocapError, SourceMotion, Tree, euler, read_text

ASF_INCH: Final = 0.0254
"""Metres in an inch. ASF lengths are inches divided by the file's own `length`."""
_CHANNELS: Final = frozenset(f"{kind}{axis}" for kind in "tr" for axis in "xyz")
_FPS: Final = 120.0
"""Rate of AMC files that do not say theirs, as those of CMU and HDM05."""
_RATES: Final = ("samples-per-second", "fps", "frame-rate", "framerate")


@dataclass(frozen=True)
class _Bone:
    """A bone, or the root. end: (3,) from its beginning, metres. frame: (3, 3) axes that its channels refer to."""

    name: str
    end: Array
    frame: Array
    order: str
    """Axes that a rotation turns about, first to last, such as `xyz`."""
    dof: tuple[str, ...]

    def motion(self, values: Array) -> tuple[Array, Array]:
        """Return the (T, 3) translation and (T, 3, 3) rotation of (T, channels) values, in the parent's frame."""
        named = dict(zip(self.dof, values.T, strict=True))
        none = np.zeros(len(values))
        moved = np.stack([named.get(f"t{axis}", none) for axis in "xyz"], -1)
        turned = euler(self.order[::-1], np.stack([named.get(f"r{axis}", none) for axis in self.order[::-1]], -1))
        return moved @ self.frame.T, np.asarray(self.frame @ turned @ self.frame.T)


@dataclass(frozen=True)
class _Skeleton:
    tree: Tree
    bones: Mapping[str, _Bone]
    unit: float
    """Metres per unit of length."""
    angle: str
    """Unit of angles: deg or rad."""


def _skeleton_of(amc: Path) -> Path:
    """Return the ASF file beside an AMC file whose name is the longest prefix of the AMC's. Raises MocapError.

    A number is a prefix of no longer number: 1.asf is the skeleton of 1_01.amc, not of 10_01.amc.
    """
    matches = [asf for asf in amc.parent.glob("*.asf") if re.match(rf"{re.escape(asf.stem)}(?<!\d(?=\d))", amc.stem)]
    if not matches:
        raise MocapError(
            f"No .asf file beside {amc} has a name that {amc.stem} begins with.", "Put the subject's .asf file there."
        )
    return max(matches, key=lambda asf: len(asf.stem))


def load_amc(path: Path, fps: float | None = None) -> SourceMotion:
    """Read an AMC motion on the ASF skeleton beside it, in metres. fps: frames a second in place of what it says.

    Joint `x` is where bone x begins; `x_end` is the tip of a last bone. Raises MocapError for broken files.
    """
    asf = _asf(_skeleton_of(path))
    head, rows = _amc_rows(path)
    # The unit of an AMC's angles is its own word, or else its skeleton's.
    radians = "radians" in head or ("degrees" not in head and asf.angle.startswith("rad"))
    degrees = np.degrees(1.0) if radians else 1.0
    offsets = np.tile(asf.tree.offsets, (len(rows), 1, 1))
    local = np.tile(np.eye(3), (*offsets.shape[:2], 1, 1))
    for joint, name in enumerate(asf.tree.joints):
        if name in asf.bones and asf.bones[name].dof:
            bone = asf.bones[name]
            scale = [degrees if channel[0] == "r" else asf.unit for channel in bone.dof]
            moved, local[:, joint] = bone.motion(_values(path, bone, rows) * scale)
            offsets[:, joint] += moved
    fps = fps or next((float(head[word]) for word in _RATES if word in head), None)
    motion = asf.tree.motion(path, fps or _FPS, offsets[:, 0], local, offsets)
    return motion if fps else replace(motion, note=f"{_FPS:g} frames a second assumed: --fps gives another rate")


def _values(path: Path, bone: _Bone, rows: list[dict[str, list[float]]]) -> Array:
    values = [row.get(bone.name, []) for row in rows]
    if any(len(value) != len(bone.dof) for value in values):
        raise MocapError(
            f"{path}: bone {bone.name} needs {len(bone.dof)} numbers in every frame.",
            "Check that the .asf belongs to this .amc, and that the file is complete.",
        )
    return np.array(values)


def _amc_rows(path: Path) -> tuple[dict[str, str], list[dict[str, list[float]]]]:
    """Return the words that begin with a colon, in lower case, and the numbers of each bone by frame."""
    head: dict[str, str] = {}
    rows: list[dict[str, list[float]]] = []
    try:
        for line in read_text(path).splitlines():
            name, *values = line.split() or [""]
            if name.startswith(":"):
                head[name.strip(":").lower()] = " ".join(values)
            elif name.isdigit():
                rows.append({})
            elif rows and values:
                rows[-1][name] = [float(value) for value in values]
    except ValueError as error:
        raise MocapError(f"{path}: expected numbers in frame {len(rows)}: {error}.", "Correct that line.") from error
    return head, rows


def _asf(path: Path) -> _Skeleton:
    sections: dict[str, list[list[str]]] = {}
    current = ""
    for line in read_text(path).splitlines():
        words = line.split()
        if words and words[0].startswith(":"):
            current = words[0][1:]
            sections[current] = []
        elif words and not words[0].startswith("#"):
            sections.setdefault(current, []).append(words)
    try:
        scale = {words[0]: words[1] for words in sections["units"]}
        unit, angle = ASF_INCH / float(scale["length"]), scale.get("angle", "deg").lower()
        turn = np.degrees(1.0) if angle.startswith("rad") else 1.0
        root = _bone({"name": ["root"], **{words[0]: words[1:] for words in sections["root"]}}, unit, turn)
        bones = {bone.name: bone for bone in (root, *_asf_bones(sections["bonedata"], unit, turn))}
        return _Skeleton(_asf_tree(bones, sections["hierarchy"]), bones, unit, angle)
    except (KeyError, IndexError, ValueError) as error:
        raise MocapError(
            f"{path}: missing or broken part of this ASF skeleton: {error}.",
            "Correct it, or export the skeleton again.",
        ) from error


def _asf_bones(lines: list[list[str]], unit: float, turn: float) -> Iterator[_Bone]:
    fields: dict[str, list[str]] = {}
    for words in lines:
        if words[0] == "begin":
            fields = {}
        elif words[0] == "end":
            yield _bone(fields, unit, turn)
        else:
            fields[words[0]] = words[1:]


def _bone(fields: Mapping[str, list[str]], unit: float, turn: float) -> _Bone:
    """Read a bone, or the root, which has no direction. turn: degrees per unit of an angle."""
    (name,) = fields["name"]
    end = np.zeros(3)
    if name != "root":
        direction = np.array(fields["direction"], float)
        if not np.linalg.norm(direction) > 0:
            raise ValueError(f"bone {name} has the direction {' '.join(fields['direction'])}, which points nowhere")
        end = direction / np.linalg.norm(direction) * float(fields["length"][0]) * unit
    # The root names the order alone; a bone, three angles and their order, which is XYZ where it is missing.
    words = fields.get("axis", [])
    order = "".join(word for word in words if word.isalpha()) or "XYZ"
    angles = [float(word) for word in words if not word.isalpha()] or [0.0] * 3
    frame = euler(order[::-1].lower(), turn * np.array(angles[::-1]))
    dof = tuple(word.lower() for word in fields.get("order" if name == "root" else "dof", ()))
    if unknown := [word for word in dof if word not in _CHANNELS]:
        raise ValueError(f"bone {name} has the channel {unknown[0]}; known are {', '.join(sorted(_CHANNELS))}")
    return _Bone(name, end, frame, order.lower(), dof)


def _asf_tree(bones: Mapping[str, _Bone], hierarchy: list[list[str]]) -> Tree:
    joints, parents, offsets = ["root"], [-1], [np.zeros(3)]
    children = {words[0]: words[1:] for words in hierarchy if words[0] not in ("begin", "end")}

    def grow(name: str) -> None:
        # A bone begins where its parent ends. ASF directions and rotations at zero angles are in the world frame.
        index, start = joints.index(name), bones[name].end
        for child in children.get(name) or [f"{name}_end"]:
            joints.append(child)
            parents.append(index)
            offsets.append(start)
            if child in bones:
                grow(child)

    grow("root")
    return Tree(tuple(joints), tuple(parents), np.array(offsets))
