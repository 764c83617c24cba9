"""Reader of AMC motion on its ASF skeleton. Needs only numpy."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from humanclaw.body import Array
from humanclaw_train.mocap.source_motion import MocapError, SourceMotion, Tree, euler, read_text

ASF_INCH: Final = 0.0254
"""Metres in an inch. ASF lengths are inches divided by the file's own `length`."""


@dataclass(frozen=True)
class _Bone:
    name: str
    end: Array
    axis: Array
    dof: tuple[str, ...]


def skeleton_of(amc: Path) -> Path:
    """Return the ASF file beside an AMC file whose name is the longest prefix of the AMC's. Raises MocapError."""
    matches = [asf for asf in amc.parent.glob("*.asf") if amc.stem.startswith(asf.stem)]
    if not matches:
        raise MocapError(
            f"No .asf file beside {amc} has a name that {amc.stem} begins with.", "Put the subject's .asf file there."
        )
    return max(matches, key=lambda asf: len(asf.stem))


def load_amc(path: str | Path, skeleton: str | Path, licence: str = "", fps: float = 120.0) -> SourceMotion:
    """Read an AMC motion on its ASF skeleton, in metres.

    Joint `x` is where bone x begins; `x_end` is the tip of a last bone. fps: AMC files do not contain their rate; CMU
    and HDM05 use 120. Raises MocapError for broken files.
    """
    path, skeleton = Path(path), Path(skeleton)
    tree, bones, unit = _asf(skeleton)
    rows = _amc_rows(path)
    root = np.array([row["root"] for row in rows]) if all(len(row.get("root", ())) == 6 for row in rows) else None
    if root is None or not rows:
        raise MocapError(f"{path}: expected a root of six numbers in every frame.", "Check that the file is complete.")
    local = np.tile(np.eye(3), (len(rows), len(tree.joints), 1, 1))
    local[:, 0] = euler("zyx", root[:, [5, 4, 3]])
    for joint, name in enumerate(tree.joints):
        if name in bones and bones[name].dof:
            local[:, joint] = _bone_rotation(path, bones[name], rows)
    positions, rotations = tree.motion(root[:, :3] * unit, local)
    return SourceMotion(fps, tree.joints, tree.parents, positions, rotations, tree.rest(), str(path), licence)


def _bone_rotation(path: Path, bone: _Bone, rows: list[dict[str, list[float]]]) -> Array:
    values = [row.get(bone.name, []) for row in rows]
    if any(len(value) != len(bone.dof) for value in values):
        raise MocapError(
            f"{path}: bone {bone.name} needs {len(bone.dof)} numbers in every frame.",
            "Check that the .asf belongs to this .amc.",
        )
    angles = np.zeros((len(rows), 3))
    angles[:, ["xyz".index(name[1]) for name in bone.dof]] = values
    frame = euler("zyx", bone.axis[::-1])  # AMC angles are about the bone's own axes.
    return np.asarray(frame @ euler("zyx", angles[:, ::-1]) @ frame.T)


def _amc_rows(path: Path) -> list[dict[str, list[float]]]:
    rows: list[dict[str, list[float]]] = []
    try:
        for line in read_text(path).splitlines():
            name, *values = line.split() or [""]
            if name.isdigit():
                rows.append({})
            elif rows and values:
                rows[-1][name] = [float(value) for value in values]
    except ValueError as error:
        raise MocapError(f"{path}: expected numbers in frame {len(rows)}.") from error
    return rows


def _asf(path: Path) -> tuple[Tree, dict[str, _Bone], float]:
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
        unit = ASF_INCH / float(scale["length"])
        bones = {bone.name: bone for bone in _asf_bones(sections["bonedata"], unit)}
        return _asf_tree(bones, sections["hierarchy"]), bones, unit
    except (KeyError, IndexError, ValueError) as error:
        raise MocapError(
            f"{path}: missing or broken part of this ASF skeleton: {error}.", "Download the subject's .asf again."
        ) from error


def _asf_bones(lines: list[list[str]], unit: float) -> Iterator[_Bone]:
    fields: dict[str, list[str]] = {}
    for words in lines:
        if words[0] == "begin":
            fields = {}
        elif words[0] == "end":
            direction = np.array(fields["direction"], float)
            end = direction / np.linalg.norm(direction) * float(fields["length"][0]) * unit
            yield _Bone(fields["name"][0], end, np.array(fields["axis"][:3], float), tuple(fields.get("dof", ())))
        else:
            fields[words[0]] = words[1:]


def _asf_tree(bones: dict[str, _Bone], hierarchy: list[list[str]]) -> Tree:
    joints, parents, offsets = ["root"], [-1], [np.zeros(3)]
    children = {words[0]: words[1:] for words in hierarchy if words[0] not in ("begin", "end")}

    def grow(name: str) -> None:
        # A bone begins where its parent ends. ASF directions and rotations at zero angles are in the world frame.
        index, start = joints.index(name), bones[name].end if name in bones else np.zeros(3)
        for child in children.get(name) or [f"{name}_end"]:
            joints.append(child)
            parents.append(index)
            offsets.append(start)
            if child in bones:
                grow(child)

    grow("root")
    return Tree(tuple(joints), tuple(parents), np.array(offsets))
