"""Tests of motion capture readers. Every expected number is computed by hand from the file's few lines."""

import numpy as np
import pytest

from humanclaw_train.mocap.readers import load
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


def test_a_bvh_file_gives_world_positions_in_the_order_of_its_channels(tmp_path):
    motion = load(written(tmp_path, "a.bvh", BVH))
    assert motion.joints == ("Hips", "Knee", "Knee_end")
    assert motion.fps == 120.0
    # At rest the leg hangs down from the hips, whose position channels replace their offset.
    np.testing.assert_allclose(motion.positions[0], [[1, 2, 3], [1, -2, 3], [1, -6, 3]], atol=1e-9)
    # A quarter turn about Z lays the thigh along +X; the knee's quarter turn about its X then points the shin to -Z.
    np.testing.assert_allclose(motion.positions[1], [[1, 2, 3], [5, 2, 3], [5, 2, -1]], atol=1e-9)


def test_a_unit_scales_every_position(tmp_path):
    motion = load(written(tmp_path, "a.bvh", BVH), unit=0.01)
    np.testing.assert_allclose(motion.positions[0, 1], [0.01, -0.02, 0.03], atol=1e-12)
    np.testing.assert_allclose(motion.rest.positions[2], [0, -0.08, 0], atol=1e-12)


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


def test_an_amc_that_lacks_a_bone_of_its_skeleton_is_refused(tmp_path):
    written(tmp_path, "07.asf", ASF)
    with pytest.raises(MocapError, match="bone hip needs 1 numbers"):
        load(written(tmp_path, "07_01.amc", AMC.replace("hip 90", "")))


def test_numbers_that_are_not_finite_are_refused(tmp_path):
    with pytest.raises(MocapError, match="not finite"):
        load(written(tmp_path, "a.bvh", BVH.replace("90 0 0 0 90 0", "nan 0 0 0 90 0")))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(MocapError, match=r"gone\.bvh cannot be read"):
        load(tmp_path / "gone.bvh")
