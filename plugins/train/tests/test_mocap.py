"""Tests of motion capture readers. Every expected number is computed by hand from the file's few lines."""

import re

import numpy as np
import pytest

from humanclaw.body import JOINTS, matrix_from_vector, vector_from_matrix
from humanclaw_train.mocap.readers import Reading, load
from humanclaw_train.mocap.retarget import retarget
from humanclaw_train.mocap.source_motion import MocapError

BVH = """HIERARCHY
ROOT Hips
{
  OFFSET 9 9 9
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Knee
  {
    OFFSET 0 -4 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 -4 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.0083333
1 2 3 0 0 0 0 0 0
1 2 3 90 0 0 0 90 0
"""

ASF = """:version 1.10
:units
  mass 1.0
  length 0.5
  angle deg
:root
   order TX TY TZ RX RY RZ
:bonedata
  begin
     id 1
     name hip
     direction 1 0 0
     length 10
     axis 0 0 90 XYZ
    dof rx
    limits (-160.0 20.0)
  end
:hierarchy
  begin
    root hip
  end
"""

AMC = """#!OML
:FULLY-SPECIFIED
:DEGREES
1
root 1 2 3 0 0 0
hip 0
2
root 1 2 3 0 0 90
hip 90
"""


def written(folder, name, text):
    (folder / name).write_text(text)
    return folder / name


def test_a_bvh_file_gives_positions_in_the_order_of_its_channels(tmp_path):
    motion = load(written(tmp_path, "a.bvh", BVH))
    assert motion.joints == ("Hips", "Knee", "Knee_end")
    assert motion.fps == 120.0
    # At rest the leg hangs down from the hips, whose position channels replace their offset.
    np.testing.assert_allclose(motion.positions[0], [[1, 2, 3], [1, -2, 3], [1, -6, 3]], atol=1e-9)
    # A quarter turn about Z lays the thigh along +X; the knee's quarter turn about its X then points the shin to -Z.
    np.testing.assert_allclose(motion.positions[1], [[1, 2, 3], [5, 2, 3], [5, 2, -1]], atol=1e-9)


def test_a_bone_of_an_amc_turns_about_its_own_axes(tmp_path):
    written(tmp_path, "07.asf", ASF)
    motion = load(written(tmp_path, "07_01.amc", AMC))
    inch = 0.0254 / 0.5
    start = np.array([1, 2, 3]) * inch
    assert motion.joints == ("root", "hip", "hip_end")
    np.testing.assert_allclose(motion.positions[0, 2], start + [10 * inch, 0, 0], atol=1e-9)
    # The bone's X axis is the world's Y (axis 0 0 90): its quarter turn moves +X to -Z, which the root's turn about Z
    # does not change.
    np.testing.assert_allclose(motion.positions[1, 2], start + [0, 0, -10 * inch], atol=1e-9)


def test_an_amass_motion_is_turned_from_z_up_to_y_up(tmp_path):
    poses = np.zeros((3, 156))
    poses[:, 0] = np.pi / 2  # Standing, Z up.
    np.savez(tmp_path / "a.npz", poses=poses, trans=np.tile([0.3, -0.2, 0.9], (3, 1)), mocap_framerate=60)
    motion = load(tmp_path / "a.npz")
    np.testing.assert_allclose(motion.positions[0, 0], [0.3, 0.9, 0.2], atol=1e-9)
    head, ankle = motion.joints.index("head"), motion.joints.index("left_ankle")
    assert motion.positions[0, head, 1] > 1.3
    assert motion.positions[0, ankle, 1] < 0.1
    assert motion.fps == 60.0


def test_a_humanoid3d_walk_goes_forward_with_its_left_at_plus_x(humanoid3d):
    motion = load(humanoid3d)
    left, right, pelvis = (motion.joints.index(name) for name in ("left_hip", "right_hip", "root"))
    assert motion.fps == 30.0
    assert np.all(motion.positions[:, left, 0] > motion.positions[:, right, 0])
    assert motion.positions[-1, pelvis, 2] - motion.positions[0, pelvis, 2] > 0.8
    assert -0.05 < motion.positions[..., 1].min() < 0.1


def test_the_reference_pose_can_be_a_frame_of_the_motion(tmp_path):
    motion = load(written(tmp_path, "a.bvh", BVH)).with_reference_frame(1)
    np.testing.assert_allclose(motion.rest.positions[2], [5, 2, -1], atol=1e-9)
    np.testing.assert_allclose(motion.rest.rotations, motion.rotations[1])


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.bvh", BVH.replace("Frames: 2", "Frames: 3"), "27 numbers; the file has 18"),
        ("a.bvh", BVH.replace("}", ""), "HIERARCHY"),
        ("a.bvh", "hello", "HIERARCHY"),
        ("a.amc", AMC, "No .asf"),
        ("a.txt", '{"Frames": [[1, 2, 3]]}', r"44 numbers; got shape \(1, 3\)"),
        ("a.txt", "hello", "Frames"),
        ("a.mp4", "hello", "suffix"),
    ],
)
def test_a_broken_file_is_refused_with_what_was_expected(tmp_path, name, text, words):
    with pytest.raises(MocapError, match=words):
        load(written(tmp_path, name, text))


# -- files as other programs write them --------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("skeleton", "motion", "joint", "inches"),
    [
        pytest.param(
            {"angle deg": "angle Radians", "axis 0 0 90": "axis 0 0 1.5707963267949"},
            {" 90": " 1.5707963267949", ":DEGREES\n": ""}, 2, (1, 2, 3 - 10), id="radians",
        ),
        # The bone's X axis is the world's Y, and the root's quarter turn about Z moves +Y to -X.
        pytest.param(
            {"dof rx": "dof tx rx"}, {"hip 90": "hip 2 90", "hip 0": "hip 0 0"}, 1, (1 - 2, 2, 3), id="a bone moves"
        ),
        pytest.param(
            {"order TX TY TZ RX RY RZ": "order RZ RY RX TX TY TZ"}, {"1 2 3 0 0 90": "90 0 0 1 2 3"}, 2, (1, 2, 3 - 10),
            id="the root's own order",
        ),
    ],
)  # fmt: skip
def test_an_asf_may_be_written_otherwise(tmp_path, skeleton, motion, joint, inches):
    for name, text, changes in (("07.asf", ASF, skeleton), ("07_01.amc", AMC, motion)):
        for old, new in changes.items():
            text = text.replace(old, new)
        written(tmp_path, name, text)
    position = load(tmp_path / "07_01.amc").positions[1, joint]
    np.testing.assert_allclose(position, np.array(inches) * 0.0254 / 0.5, atol=1e-9)


def test_the_skeleton_of_another_subject_is_not_taken(tmp_path):
    written(tmp_path, "1.asf", ASF)
    assert len(load(written(tmp_path, "1_01.amc", AMC))) == 2
    with pytest.raises(MocapError, match=r"No \.asf"):
        load(written(tmp_path, "10_01.amc", AMC))


def test_an_amc_may_say_its_rate(tmp_path):
    written(tmp_path, "07.asf", ASF)
    for word in (":SAMPLES-PER-SECOND 60", ":FPS 60", ":frame-rate: 60"):
        said = load(written(tmp_path, "07_02.amc", AMC.replace(":DEGREES", f"{word}\n:DEGREES")))
        assert (said.fps, said.note) == (60, "")
    assert load(written(tmp_path, "07_03.amc", AMC), Reading(fps=100)).fps == 100
    silent = load(tmp_path / "07_03.amc")
    assert silent.fps == 120
    assert "120 frames a second assumed: --fps" in silent.note


def test_an_asked_rate_stands_for_one_that_is_missing_or_wrong(tmp_path):
    for said in ("0", "1", "0,0083", "8.3333"):
        path = written(tmp_path, "a.bvh", BVH.replace("0.0083333", said))
        assert load(path, Reading(fps=50)).fps == 50
    assert load(written(tmp_path, "a.bvh", BVH.replace("0.0083333", "0,0083333"))).fps == 120
    standing = {"poses": np.tile([np.pi / 2] + [0] * 65, (9, 1)), "trans": np.tile([0, 0, 0.9], (9, 1))}
    for more in ({}, {"mocap_framerate": 0}, {"mocap_framerate": [30, 30]}):
        np.savez(tmp_path / "a.npz", **standing, **more)
        assert load(tmp_path / "a.npz", Reading(fps=50)).fps == 50
        with pytest.raises(MocapError, match=r"framerate.*"):
            load(tmp_path / "a.npz")
    for name in ("fps", "frame_rate"):
        np.savez(tmp_path / "a.npz", **standing, **{name: 60})
        assert load(tmp_path / "a.npz").fps == 60


def test_a_bvh_may_be_in_capitals_or_not_and_in_utf_16(tmp_path):
    plain = load(written(tmp_path, "a.bvh", BVH))
    for change, encoding in ((str.upper, "utf-8"), (str.lower, "utf-16")):
        words = change(BVH).replace(change("Frame Time: "), "Frame Time:")
        (tmp_path / "b.bvh").write_text(words, encoding=encoding)
        motion = load(tmp_path / "b.bvh")
        np.testing.assert_allclose(motion.positions, plain.positions, atol=1e-9)


JOINT_WORDS = re.compile(r"(?:ROOT|JOINT) (\S+)")
STANDING = {"Hips": (0, 0.9, 0), "LeftUpLeg": (0.1, 0.9, 0), "LeftLeg": (0.1, 0.5, 0), "LeftFoot": (0.1, 0.1, 0),
            "RightUpLeg": (-0.1, 0.9, 0), "RightLeg": (-0.1, 0.5, 0), "RightFoot": (-0.1, 0.1, 0),
            "Spine": (0, 1.2, 0), "LeftArm": (0.2, 1.4, 0), "LeftForeArm": (0.2, 1.1, 0), "LeftHand": (0.2, 0.9, 0),
            "RightArm": (-0.2, 1.4, 0), "RightForeArm": (-0.2, 1.1, 0), "RightHand": (-0.2, 0.9, 0),
            "Neck": (0, 1.5, 0), "Head": (0, 1.6, 0.05)}  # fmt: skip
"""Joints of a person who stands and faces +Z: x, y, z in metres."""
BELOW = {"LeftUpLeg": "Hips", "RightUpLeg": "Hips", "Spine": "Hips", "LeftArm": "Spine", "RightArm": "Spine",
         "Neck": "Spine", "Head": "Neck"} | {
    f"{side}{low}": f"{side}{high}" for side in ("Left", "Right")
    for low, high in (("Leg", "UpLeg"), ("Foot", "Leg"), ("ForeArm", "Arm"), ("Hand", "ForeArm"))
}  # fmt: skip


def standing_bvh(prefix="", turn=None, hips=None):
    """Write one second of standing, with names of Mixamo, LAFAN and others.

    turn: (3, 3) to other axes. hips: their position and angles, ZXY, in place of those of standing.
    """
    place = {name: np.asarray(xyz) @ (np.eye(3) if turn is None else turn).T for name, xyz in STANDING.items()}

    def write(name, indent):
        offset = place[name] - place[BELOW[name]] if name in BELOW else np.zeros(3)
        kind, channels = ("JOINT", "") if name in BELOW else ("ROOT", "6 Xposition Yposition Zposition")
        lines = [f"{kind} {prefix}{name}", "{", "OFFSET " + " ".join(map(str, offset))]
        lines.append(f"CHANNELS {channels or 3} Zrotation Xrotation Yrotation")
        for child in (child for child, parent in BELOW.items() if parent == name):
            lines += write(child, indent + 1)
        return [*lines, "}"] if any(parent == name for parent in BELOW.values()) else [
            *lines, "End Site", "{", "OFFSET 0 0 0", "}", "}"]  # fmt: skip

    row = " ".join(map(str, hips or (*place["Hips"], 0, 0, 0))) + " 0" * (3 * len(STANDING) - 3)
    return "\n".join(["HIERARCHY", *write("Hips", 0), "MOTION", "Frames: 30", "Frame Time: 0.033333", *[row] * 30, ""])


Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
X_UP = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])


@pytest.mark.parametrize("turn", [None, Z_UP, X_UP], ids=["y up", "z up", "x up"])
@pytest.mark.parametrize("prefix", ["", "mixamorig:", "Character1_", "Bip01 "])
def test_the_up_axis_of_a_bvh_is_found_from_head_and_feet(tmp_path, prefix, turn):
    motion = retarget(load(written(tmp_path, "a.bvh", standing_bvh(prefix, turn))))
    head, foot = (motion.joints()[:, JOINTS.index(name)] for name in ("head", "left_ankle"))
    np.testing.assert_allclose((head - foot)[:, 1], (head - foot)[0, 1])
    assert (head - foot)[0, 1] > 1.2


UNITY = {"UpLeg": "UpperLeg", "Leg": "LowerLeg", "Arm": "UpperArm", "ForeArm": "LowerArm"}


@pytest.mark.parametrize(
    ("names", "written_as"),
    [
        pytest.param(UNITY, "{0}{1}", id="Unity"),
        pytest.param(UNITY, "{1}_{0[0]}", id="Bandai Namco"),
        pytest.param({"UpLeg": "Thigh", "Leg": "Shin"}, "{0}{1}", id="Rokoko"),
        pytest.param({"UpLeg": "Thigh", "Leg": "Shin", "Arm": "Shldr", "Hips": "hip"}, "{0[0]}{1}", id="DAZ"),
    ],
)
def test_joints_have_the_names_that_a_program_gives(tmp_path, names, written_as):
    def renamed(word):
        name = names.get(word[2], word[2])
        return written_as.format(word[1], name) if word[1] else name

    text = re.sub(r"(?<=ROOT |OINT )(Left|Right|)(\w+)", renamed, standing_bvh())
    motion = retarget(load(written(tmp_path, "a.bvh", text)))
    assert motion.joints()[0, JOINTS.index("head"), 1] > 1.3


def test_zero_angles_that_are_no_pose_give_way_to_a_frame(tmp_path):
    """A skeleton whose bones all lie along X at zero angles, as LAFAN's: the legs hang by a turn of the hips."""
    text = standing_bvh()
    for side in ("Left", "Right"):
        text = text.replace(f"JOINT {side}Leg\n{{\nOFFSET 0.0 -0.4 0.0", f"JOINT {side}Leg\n{{\nOFFSET 0.4 0.0 0.0")
        text = text.replace(f"JOINT {side}Foot\n{{\nOFFSET 0.0 -0.4 0.0", f"JOINT {side}Foot\n{{\nOFFSET 0.4 0.0 0.0")
    hips = [position for position, word in enumerate(JOINT_WORDS.findall(text)) if word.endswith("UpLeg")]
    row = text.splitlines()[-1].split()
    for joint in hips:
        row[3 + 3 * joint] = "-90"
    lines = text.splitlines()[:-30] + [" ".join(row)] * 30
    motion = retarget(load(written(tmp_path, "a.bvh", "\n".join(lines))))
    knee, ankle = (motion.joints()[0, JOINTS.index(f"left_{name}")] for name in ("knee", "ankle"))
    np.testing.assert_allclose((knee - ankle) / np.linalg.norm(knee - ankle), [0, 1, 0], atol=0.05)
    thigh = motion.rotations[0, JOINTS.index("left_hip")]
    np.testing.assert_allclose(thigh, 0, atol=0.05)


def test_an_amass_file_that_is_y_up_already_is_not_laid_on_its_back(tmp_path):
    np.savez(tmp_path / "a.npz", poses=np.zeros((9, 156)), trans=np.tile([0.3, 0.9, 0.2], (9, 1)), mocap_framerate=60)
    motion = load(tmp_path / "a.npz")
    np.testing.assert_allclose(motion.positions[0, 0], [0.3, 0.9, 0.2], atol=1e-9)
    assert motion.positions[0, motion.joints.index("head"), 1] > 1.3


def test_an_amass_file_in_centimetres_is_refused(tmp_path):
    np.savez(tmp_path / "a.npz", poses=np.zeros((9, 156)), trans=np.tile([30, 90, 20], (9, 1)), mocap_framerate=60)
    with pytest.raises(MocapError, match=r"trans in metres; it begins 97 from 0\. Divide it by 100"):
        load(tmp_path / "a.npz")


def test_a_body_that_lies_keeps_the_up_axis_of_its_format(tmp_path):
    """Z up, on its back at a height of 10 cm: along Y it could stand, were the floor not .8 m below 0."""
    np.savez(tmp_path / "a.npz", poses=np.zeros((9, 156)), trans=np.tile([0, 0.1, 0.1], (9, 1)), mocap_framerate=60)
    lying = load(tmp_path / "a.npz")
    assert np.ptp(lying.positions[0, :, 1]) < 0.4
    assert np.ptp(load(tmp_path / "a.npz", Reading(up="y")).positions[0, :, 1]) > 1.4


@pytest.mark.parametrize("turn", [np.eye(3), Z_UP], ids=["y up", "z up"])
def test_a_body_that_does_not_stand_has_its_floor_below(tmp_path, turn):
    """It lies on its back and gets up: its lowest joint stays within cm of 0, and moves .9 m along the other axis."""
    rise = np.repeat([0.0, 1.0], 30)
    trans, poses = np.stack([0 * rise, 0.1 + 0.8 * rise, 0.2 * rise], -1), np.zeros((60, 156))
    for frame, angle in enumerate((rise - 1) * np.pi / 2):
        poses[frame, :3] = vector_from_matrix(turn @ matrix_from_vector(np.array([angle, 0.0, 0.0])))
    np.savez(tmp_path / "a.npz", poses=poses, trans=trans @ turn.T, mocap_framerate=30)
    np.testing.assert_allclose(load(tmp_path / "a.npz").positions[:, 0], trans, atol=1e-9)


def test_a_crawl_with_y_up_is_not_climbing_with_z_up(tmp_path):
    """It travels 4 m along Z on hands and knees, at a height that any body has that climbs a wall."""
    poses, far = np.zeros((60, 156)), np.linspace(-2, 2, 60)
    poses[:, 0] = np.pi / 2
    np.savez(tmp_path / "a.npz", poses=poses, trans=np.stack([0 * far, 0 * far + 0.1, far], -1), mocap_framerate=30)
    with pytest.raises(MocapError, match="--up z or --up y"):
        load(tmp_path / "a.npz")


@pytest.mark.parametrize(
    "hips",
    [
        pytest.param((0, 0.6, 0, 0, -90, 0), id="on a bed"),
        pytest.param((0, 0.1, -0.85, 0, -90, 0), id="on the floor, its feet by chance at 0"),
        pytest.param((0, -0.8, 1, 0, -90, 0), id="on a floor that is not at 0"),
        pytest.param((0, 1.6, 0, 180, 0, 0), id="on its head"),
    ],
)
def test_a_body_that_may_lie_or_stand_wants_its_up_axis(tmp_path, hips):
    path = written(tmp_path, "a.bvh", standing_bvh(hips=hips))
    with pytest.raises(MocapError, match=r"may lie or stand.*--up y"):
        load(path)
    np.testing.assert_allclose(load(path, Reading(up="y")).positions[0, 0], hips[:3], atol=1e-9)


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("a.bvh", ("Frame Time: 0.0083333", "Frame Time: 0"), "Frame Time.*0"),
        ("a.bvh", ("Frame Time: 0.0083333", "Frame Time: 8.3333"), "seconds.*8.3333"),
        ("a.bvh", ("Xposition", "Xscale"), "channel xscale"),
        ("a.bvh", ("MOTION", "ROOT Other\n{\nOFFSET 0 0 0\n}\nMOTION"), "one ROOT; got Hips, Other"),
        ("a.bvh", ("90 0 0 0 90 0", "nan 0 0 0 90 0"), "not finite"),
        ("07.asf", ("direction 1 0 0", "direction 0 0 0"), "hip.*direction"),
        ("07.asf", ("dof rx", "dof rq"), "hip.*rq"),
        ("07.asf", ("dof rx", "dof l"), "hip.*l"),
        ("07_01.amc", ("hip 90", ""), "bone hip needs 1 numbers"),
    ],
)
def test_what_a_file_says_wrong_is_named(tmp_path, name, change, words):
    for file, text in {"a.bvh": BVH, "07.asf": ASF, "07_01.amc": AMC}.items():
        written(tmp_path, file, text.replace(*change) if file == name else text)
    with pytest.raises(MocapError, match=words):
        load(tmp_path / ("a.bvh" if name == "a.bvh" else "07_01.amc"))


def test_a_joint_of_the_table_that_no_skeleton_has_is_named(tmp_path):
    path = written(tmp_path, "a.bvh", standing_bvh())
    with pytest.raises(MocapError, match="no joint for head"):
        retarget(load(path, Reading(joints=(("head", "Kopf"),))))


def test_a_table_of_joints_fits_any_skeleton(tmp_path):
    text = standing_bvh().replace("LeftUpLeg", "Bein_L").replace("Hips", "Becken")
    with pytest.raises(MocapError, match=r"no joint for pelvis, left_hip\. It has Becken, Bein_L"):
        retarget(load(written(tmp_path, "a.bvh", text)))
    names = (("pelvis", "Becken"), ("pelvis", "Hueft"), ("left_hip", "Thigh1"), ("left_hip", "Bein_L"))
    motion = retarget(load(tmp_path / "a.bvh", Reading(joints=names)))
    assert motion.joints()[0, JOINTS.index("head"), 1] > 1.3
