"""Readers of motion capture: ASF/AMC, BVH, AMASS npz and the humanoid3d text format of DeepMimic.

Each gives a SourceMotion: world positions and orientations of the source's own joints, Y up, with the reference pose
that says what the orientations are measured from. What the joints mean to our body is the business of retarget.py.
Needs numpy alone.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from humanclaw import HumanclawError
from humanclaw.body import JOINTS, OFFSETS, PARENTS, Array, matrix_from_quaternion, matrix_from_vector

ASF_INCH: Final = 0.0254
"""ASF lengths are inches divided by the file's own `length`."""

_AXES: Final = {axis: np.eye(3)["xyz".index(axis)] for axis in "xyz"}


class MocapError(HumanclawError):
    """A mocap file that is missing, broken or of a kind that no reader knows."""


@dataclass(frozen=True)
class Rest:
    """The reference pose that orientations are measured from: positions (J, 3), rotations (J, 3, 3), world frame."""

    positions: Array
    rotations: Array


@dataclass(frozen=True)
class SourceMotion:
    """Captured motion on the source's own skeleton, Y up, in the file's units times the reader's `unit` (metres if that
    is right).

    positions: (T, J, 3) world; rotations: (T, J, 3, 3) world; parents: (J,), -1 at the root, always before their
    children.
    """

    fps: float
    joints: tuple[str, ...]
    parents: tuple[int, ...]
    positions: Array
    rotations: Array
    rest: Rest
    source: str = ""
    licence: str = ""

    def __post_init__(self) -> None:
        frames, count = len(self.positions), len(self.joints)
        if frames == 0 or not self.fps > 0:
            raise MocapError(
                f"{self.source or 'this motion'} holds {frames} frames at {self.fps} fps.", "Is it complete?"
            )
        if self.positions.shape != (frames, count, 3) or self.rotations.shape != (frames, count, 3, 3):
            raise MocapError(
                f"{count} joints need positions (T, {count}, 3) and rotations (T, {count}, 3, 3); "
                f"got {self.positions.shape} and {self.rotations.shape}."
            )
        if not (np.isfinite(self.positions).all() and np.isfinite(self.rotations).all()):
            raise MocapError(
                f"{self.source or 'this motion'} holds numbers that are not finite.", "Cut those frames out."
            )

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, frames: slice) -> SourceMotion:
        return replace(self, positions=self.positions[frames], rotations=self.rotations[frames])

    def with_reference_frame(self, frame: int) -> SourceMotion:
        """Return the same motion, measured from the pose of one of its frames: for files whose zero angles are no
        natural pose."""
        return replace(self, rest=Rest(self.positions[frame], self.rotations[frame]))


@dataclass(frozen=True)
class _Tree:
    """A skeleton at zero angles: offset of each joint in its parent's frame."""

    joints: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: Array

    def motion(self, root: Array, local: Array, offsets: Array | None = None) -> tuple[Array, Array]:
        """Root positions (T, 3) and local rotations (T, J, 3, 3) to world positions and rotations."""
        shifts = np.broadcast_to(self.offsets, (*root.shape[:1], *self.offsets.shape)) if offsets is None else offsets
        positions, rotations = np.empty((*local.shape[:2], 3)), np.empty(local.shape)
        for joint, parent in enumerate(self.parents):
            if parent < 0:
                positions[:, joint], rotations[:, joint] = root, local[:, joint]
                continue
            positions[:, joint] = positions[:, parent] + (rotations[:, parent] @ shifts[:, joint, :, None])[..., 0]
            rotations[:, joint] = rotations[:, parent] @ local[:, joint]
        return positions, rotations

    def rest(self) -> Rest:
        identity = np.tile(np.eye(3), (1, len(self.joints), 1, 1))
        positions, rotations = self.motion(np.zeros((1, 3)), identity)
        return Rest(positions[0], rotations[0])


def load(path: str | Path, licence: str = "", unit: float = 1.0) -> SourceMotion:
    """Read one mocap file by its suffix: .bvh, .amc (with its .asf beside it), .npz (AMASS) or .txt (humanoid3d)."""
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".bvh":
        return load_bvh(path, licence, unit)
    if suffix == ".amc":
        return load_amc(path, skeleton_of(path), licence)
    if suffix == ".npz":
        return load_amass(path, licence)
    if suffix == ".txt":
        return load_humanoid3d(path, licence)
    raise MocapError(
        f"{path} has no suffix that a mocap reader knows.", "Give a .bvh, .amc, .npz (AMASS) or .txt (humanoid3d) file."
    )


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise MocapError(f"{path} cannot be read: {error.strerror}.", "Check the path.") from error


def _euler(order: Sequence[str], degrees: Array) -> Array:
    """Angles (..., n) about the named axes, multiplied from left to right, to (..., 3, 3)."""
    matrix = np.broadcast_to(np.eye(3), (*degrees.shape[:-1], 3, 3))
    for index, axis in enumerate(order):
        matrix = matrix @ matrix_from_vector(np.radians(degrees[..., index, None]) * _AXES[axis])
    return np.asarray(matrix)


# -- BVH ---------------------------------------------------------------------------------------------------------------
def load_bvh(path: str | Path, licence: str = "", unit: float = 1.0) -> SourceMotion:
    """Read a BVH file. A position channel replaces its joint's offset; an end site becomes the joint `<parent>_end`."""
    path = Path(path)
    head, _, tail = _read(path).partition("MOTION")
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
            local[:, joint] = _euler([names[column][0].lower() for column in turns], block[:, turns])
    positions, rotations = tree.motion(offsets[:, 0], local, offsets)
    rest = tree.rest()
    rest = replace(rest, positions=rest.positions * unit)
    return SourceMotion(fps, tree.joints, tree.parents, positions * unit, rotations, rest, str(path), licence)


def _bvh_tree(path: Path, words: list[str]) -> tuple[_Tree, list[tuple[str, ...]]]:
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
        raise MocapError(f"{path}: the HIERARCHY of this BVH file is broken.", "Export it again.") from error
    if not joints or len(offsets) != len(joints) or stack:
        raise MocapError(f"{path}: expected a BVH HIERARCHY with one OFFSET a joint.", "Is this a complete BVH file?")
    return _Tree(tuple(joints), tuple(parents), np.array(offsets)), channels


def _bvh_frames(path: Path, words: list[str], width: int) -> tuple[float, Array]:
    try:
        frames, seconds = int(words[1]), float(words[4])
        values = np.array(words[5:], float)
    except (IndexError, ValueError) as error:
        raise MocapError(f"{path}: expected `Frames: N`, `Frame Time: seconds` and numbers after MOTION.") from error
    if len(values) != frames * width:
        raise MocapError(
            f"{path}: {frames} frames of {width} channels need {frames * width} numbers; the file holds {len(values)}.",
            "The file is cut short or padded; fetch it again.",
        )
    # Frame times are written with six or seven digits, so the rate is only meant to be whole.
    return float(round(1.0 / seconds, 1)), values.reshape(frames, width)


# -- ASF / AMC ---------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class _Bone:
    name: str
    end: Array
    axis: Array
    dof: tuple[str, ...]


def skeleton_of(amc: Path) -> Path:
    """Return the ASF file beside an AMC: the one whose name is the longest prefix of it."""
    matches = [asf for asf in amc.parent.glob("*.asf") if amc.stem.startswith(asf.stem)]
    if not matches:
        raise MocapError(
            f"No .asf beside {amc} has a name that {amc.stem} begins with.", "Put the subject's .asf there."
        )
    return max(matches, key=lambda asf: len(asf.stem))


def load_amc(path: str | Path, skeleton: str | Path, licence: str = "", fps: float = 120.0) -> SourceMotion:
    """Read an AMC motion on its ASF skeleton, in metres. AMC files do not tell their rate; 120 is that of CMU and
    HDM05.

    Joint `x` is where bone x begins; `x_end` is the tip of a last bone.
    """
    path, skeleton = Path(path), Path(skeleton)
    tree, bones, unit = _asf(skeleton)
    rows = _amc_rows(path)
    root = np.array([row["root"] for row in rows]) if all(len(row.get("root", ())) == 6 for row in rows) else None
    if root is None or not rows:
        raise MocapError(
            f"{path}: expected frames that each have a root of six numbers.", "Is this a complete AMC file?"
        )
    local = np.tile(np.eye(3), (len(rows), len(tree.joints), 1, 1))
    local[:, 0] = _euler("zyx", root[:, [5, 4, 3]])
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
            "Does the .asf belong to this .amc?",
        )
    angles = np.zeros((len(rows), 3))
    angles[:, ["xyz".index(name[1]) for name in bone.dof]] = values
    frame = _euler("zyx", bone.axis[::-1])
    return np.asarray(frame @ _euler("zyx", angles[:, ::-1]) @ frame.T)


def _amc_rows(path: Path) -> list[dict[str, list[float]]]:
    rows: list[dict[str, list[float]]] = []
    try:
        for line in _read(path).splitlines():
            name, *values = line.split() or [""]
            if name.isdigit():
                rows.append({})
            elif rows and values:
                rows[-1][name] = [float(value) for value in values]
    except ValueError as error:
        raise MocapError(f"{path}: a line of frame {len(rows)} holds something that is no number.") from error
    return rows


def _asf(path: Path) -> tuple[_Tree, dict[str, _Bone], float]:
    sections: dict[str, list[list[str]]] = {}
    current = ""
    for line in _read(path).splitlines():
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
            f"{path}: this ASF skeleton lacks or breaks {error}.", "Fetch the subject's .asf again."
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


def _asf_tree(bones: dict[str, _Bone], hierarchy: list[list[str]]) -> _Tree:
    joints, parents, offsets = ["root"], [-1], [np.zeros(3)]
    children = {words[0]: words[1:] for words in hierarchy if words[0] not in ("begin", "end")}

    def grow(name: str) -> None:
        # A bone begins where its parent ends; ASF directions are in the world frame, and so is every zero-angle
        # rotation.
        index, start = joints.index(name), bones[name].end if name in bones else np.zeros(3)
        for child in children.get(name) or [f"{name}_end"]:
            joints.append(child)
            parents.append(index)
            offsets.append(start)
            if child in bones:
                grow(child)

    grow("root")
    return _Tree(tuple(joints), tuple(parents), np.array(offsets))


# -- AMASS -------------------------------------------------------------------------------------------------------------
def load_amass(path: str | Path, licence: str = "") -> SourceMotion:
    """Read an AMASS npz (`poses`, `trans`, `mocap_framerate`), which is Z up.

    Bones take our own lengths, because those of a subject come from SMPL files that this package does not have.
    """
    path = Path(path)
    try:
        with np.load(path, allow_pickle=False) as data:
            poses, trans = np.asarray(data["poses"], float), np.asarray(data["trans"], float)
            rate = data["mocap_framerate"] if "mocap_framerate" in data else data["mocap_frame_rate"]
            fps = float(rate)
    except (OSError, KeyError, ValueError) as error:
        raise MocapError(
            f"{path} is no AMASS motion: {error}.", "It needs poses, trans and mocap_framerate."
        ) from error
    if poses.ndim != 2 or poses.shape[1] < 66 or trans.shape != (len(poses), 3):
        raise MocapError(
            f"{path}: expected poses (T, 66 or more) and trans (T, 3); got {poses.shape} and {trans.shape}."
        )
    local = np.tile(np.eye(3), (len(poses), len(JOINTS), 1, 1))
    local[:, :22] = matrix_from_vector(poses[:, :66].reshape(-1, 22, 3))
    upright = matrix_from_vector(np.array([-np.pi / 2, 0.0, 0.0]))  # Z up to Y up
    local[:, 0] = upright @ local[:, 0]
    tree = _Tree(JOINTS, PARENTS, OFFSETS)
    positions, rotations = tree.motion(trans @ upright.T, local)
    return SourceMotion(fps, JOINTS, PARENTS, positions, rotations, tree.rest(), str(path), licence)


# -- humanoid3d --------------------------------------------------------------------------------------------------------
_HUMANOID3D: Final = (
    ("root", -1, (0.0, 0.0, 0.0)), ("chest", 0, (0.0, 0.236151, 0.0)), ("neck", 1, (0.0, 0.223894, 0.0)),
    ("right_hip", 0, (0.0, 0.0, 0.084887)), ("right_knee", 3, (0.0, -0.421546, 0.0)),
    ("right_ankle", 4, (0.0, -0.40987, 0.0)), ("right_shoulder", 1, (-0.02405, 0.2435, 0.18311)),
    ("right_elbow", 6, (0.0, -0.274788, 0.0)),
    ("left_hip", 0, (0.0, 0.0, -0.084887)), ("left_knee", 8, (0.0, -0.421546, 0.0)),
    ("left_ankle", 9, (0.0, -0.40987, 0.0)), ("left_shoulder", 1, (-0.02405, 0.2435, -0.18311)),
    ("left_elbow", 11, (0.0, -0.274788, 0.0)),
    ("right_toe", 5, (0.13, -0.055, 0.0)), ("left_toe", 10, (0.13, -0.055, 0.0)),
    ("right_wrist", 7, (0.0, -0.258947, 0.0)), ("left_wrist", 12, (0.0, -0.258947, 0.0)),
)  # fmt: skip
_HUMANOID3D_HINGES: Final = ("right_knee", "right_elbow", "left_knee", "left_elbow")


def load_humanoid3d(path: str | Path, licence: str = "") -> SourceMotion:
    """Read a DeepMimic humanoid3d text file: JSON rows of 44 numbers (seconds, root, then quaternions w, x, y, z and
    hinges)."""
    path = Path(path)
    try:
        rows = np.array(json.loads(_read(path))["Frames"], float)
    except (ValueError, KeyError, TypeError) as error:
        raise MocapError(
            f"{path}: expected JSON with `Frames`, rows of 44 numbers.", "Is this a humanoid3d file?"
        ) from error
    if rows.ndim != 2 or rows.shape[1] != 44:
        raise MocapError(f"{path}: expected `Frames` as rows of 44 numbers; got shape {rows.shape}.")
    tree = _Tree(
        tuple(name for name, _, _ in _HUMANOID3D),
        tuple(parent for _, parent, _ in _HUMANOID3D),
        np.array([offset for _, _, offset in _HUMANOID3D]),
    )
    local = np.tile(np.eye(3), (len(rows), len(tree.joints), 1, 1))
    column = 4
    for joint, name in enumerate(tree.joints[:13]):
        if name in _HUMANOID3D_HINGES:
            local[:, joint] = matrix_from_vector(rows[:, column, None] * _AXES["z"])
            column += 1
        else:
            local[:, joint] = matrix_from_quaternion(rows[:, [column + 1, column + 2, column + 3, column]])
            column += 4
    # The format faces +X with its right at +Z; a turn about the vertical gives +Z forward and +X left.
    turn = matrix_from_vector(np.array([0.0, -np.pi / 2, 0.0]))
    positions, rotations = tree.motion(rows[:, 1:4], local)
    rest = tree.rest()
    return SourceMotion(
        float(round(1.0 / float(np.median(rows[:-1, 0])), 1)), tree.joints, tree.parents, positions @ turn.T,
        turn @ rotations,
        Rest(rest.positions @ turn.T, turn @ rest.rotations), str(path), licence,
    )  # fmt: skip
