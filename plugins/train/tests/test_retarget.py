"""Tests from a captured walk to our body, clips and chunks, against the source and numbers computed by hand."""

import tarfile
from dataclasses import replace

import numpy as np
import pytest
from amass_tree import trained_skills, write_clip
from declared import declaration

from humanclaw import Keyframes, Motion
from humanclaw.body import (
    FPS,
    JOINT_INDEX,
    JOINTS,
    SOLE,
    TOE_SOLE,
    Pose2D,
    matrix_from_vector,
    mirrored,
    rest_pose,
    vector_from_matrix,
)
from humanclaw.skills import outcomes
from humanclaw_train.data.chunks import Chunks, canonical, cut
from humanclaw_train.data.curate import IDLE_SHARE, build_real, travel
from humanclaw_train.mocap.clips import Clip, Folder
from humanclaw_train.mocap.readers import load
from humanclaw_train.mocap.retarget import leg_length, resample, retarget
from humanclaw_train.mocap.source_motion import MocapError, SourceMotion

LEG = 0.405 + 0.415
WALK = declaration("walk").parameters


@pytest.fixture(scope="module")
def source(humanoid3d):
    return load(humanoid3d)


@pytest.fixture(scope="module")
def walk(source):
    return retarget(source)


def joint(motion, name):
    return motion.joints()[:, JOINT_INDEX[name]]


def of_source(source, name):
    return source.positions[:, source.joints.index(name)]


def degrees_between(a, b):
    cos = np.sum(a * b, -1) / np.linalg.norm(a, axis=-1) / np.linalg.norm(b, axis=-1)
    return np.degrees(np.arccos(np.clip(cos, -1, 1)))


# -- retargeting -------------------------------------------------------------------------------------------------------
def test_the_body_travels_as_far_as_its_legs_are_long(source, walk):
    travelled = of_source(source, "root")[-1] - of_source(source, "root")[0]
    scale = LEG / leg_length(source)
    assert leg_length(source) == pytest.approx(0.421546 + 0.40987, abs=1e-6)
    np.testing.assert_allclose(walk.root[-1, [0, 2]] - walk.root[0, [0, 2]], travelled[[0, 2]] * scale, atol=0.02)


def test_every_limb_points_where_the_source_points(source, walk):
    for side in ("left", "right"):
        for near, far, most in (
            ("hip", "knee", 10),
            ("knee", "ankle", 10),
            ("shoulder", "elbow", 1),
            ("elbow", "wrist", 1),
        ):
            ours = joint(walk, f"{side}_{far}") - joint(walk, f"{side}_{near}")
            theirs = of_source(source, f"{side}_{far}") - of_source(source, f"{side}_{near}")
            assert np.percentile(degrees_between(ours, theirs), 95) < most, (side, near)


def test_knees_bend_backwards_only_and_elbows_forwards_only(walk):
    for side, sign in (("left", -1), ("right", 1)):
        knee, elbow = (walk.rotations[:, JOINT_INDEX[f"{side}_{name}"]] for name in ("knee", "elbow"))
        assert knee[:, 0].min() > 0
        assert np.abs(knee[:, 1:]).max() < 0.1  # A hinge: neither twist nor sideways bend.
        assert (sign * elbow[:, 1]).min() > 0


def test_standing_feet_stay_where_they_are_flat_on_the_floor(source, walk):
    for side in ("left", "right"):
        slow = np.linalg.norm(np.gradient(of_source(source, f"{side}_toe"), axis=0), axis=-1) * FPS < 0.15
        toe, ankle = joint(walk, f"{side}_foot")[slow], joint(walk, f"{side}_ankle")[slow]
        flat = np.abs(toe[:, 1] - TOE_SOLE) < 0.005
        assert slow.sum() > 8
        assert flat.mean() > 0.9
        assert np.abs(np.diff(toe[flat], axis=0)).max() * FPS < 0.25
        assert np.median(np.abs(ankle[flat, 1] - SOLE)) < 0.01


def test_no_sole_is_under_the_floor(walk):
    soles = np.concatenate([joint(walk, f"{side}_ankle")[:, 1] - SOLE for side in ("left", "right")])
    toes = np.concatenate([joint(walk, f"{side}_foot")[:, 1] - TOE_SOLE for side in ("left", "right")])
    assert min(soles.min(), toes.min()) > -0.005


def test_the_hips_face_the_way_that_is_walked(walk):
    forward = walk.root[-1] - walk.root[0]
    assert np.abs(np.median(walk.yaw()) - np.arctan2(forward[0], forward[2])) < np.radians(10)


def test_a_motion_on_our_own_skeleton_comes_back_as_it_went(walk, tmp_path):
    z_up = matrix_from_vector(np.array([np.pi / 2, 0, 0]))
    poses = np.zeros((len(walk), 156))
    poses[:, :66] = walk.rotations[:, :22].reshape(len(walk), 66)
    poses[:, :3] = vector_from_matrix(z_up @ matrix_from_vector(walk.rotations[:, 0]))
    np.savez(tmp_path / "a.npz", poses=poses, trans=walk.root @ z_up.T, mocap_framerate=30)
    again = retarget(load(tmp_path / "a.npz"))
    difference = np.linalg.norm(again.joints() - walk.joints(), axis=-1)[:, :22]
    assert np.median(difference) < 0.01
    assert np.percentile(difference, 95) < 0.03


def test_resampling_keeps_the_time_and_the_path(source):
    fast = resample(source, 120)
    assert fast.fps == 120.0
    assert len(fast) == 4 * (len(source) - 1) + 1
    np.testing.assert_allclose(fast.positions[::4], source.positions, atol=1e-9)
    assert len(retarget(fast)) == len(source)


def test_a_skeleton_that_no_naming_fits_is_refused_with_what_it_lacks(source):
    strange = replace(source, joints=tuple(f"bone{index}" for index in range(len(source.joints))))
    with pytest.raises(MocapError, match="no joint for pelvis"):
        retarget(strange)


def test_the_floor_lies_under_the_feet_however_high_the_capture(source, walk):
    rest = replace(source.rest, positions=source.rest.positions + [0, 5, 0])
    high = replace(source, positions=source.positions + [3, 5, -2], rest=rest)
    np.testing.assert_allclose(retarget(high).root, walk.root, atol=1e-6)


# -- skeletons whose frames say other than their joints ----------------------------------------------------------------
def turned_at_rest(source, names, axis, degrees):
    """Turn the frames of joints in the reference pose; their positions stay."""
    indices, rotations = [source.joints.index(name) for name in names], source.rest.rotations.copy()
    rotations[indices] @= matrix_from_vector(np.radians(degrees) * np.array(axis))
    return replace(source, rest=replace(source.rest, rotations=rotations))


@pytest.mark.parametrize("degrees", [30, 90])
def test_hips_lie_where_the_legs_begin_however_their_frame_rolls(source, walk, degrees):
    """Inverse kinematics may roll the pelvis about the forward axis, which is the source's X, and turn the joints
    below back: against its reference pose the motion is rolled."""
    rolled = retarget(turned_at_rest(source, ["root"], (1, 0, 0), degrees))
    across = [joint(motion, "left_hip") - joint(motion, "right_hip") for motion in (rolled, walk)]
    assert degrees_between(*across).max() < 1
    assert np.abs(rolled.joints() - walk.joints())[:, JOINT_INDEX["left_knee"]].max() < 0.02


@pytest.mark.parametrize("degrees", [20, 180])
def test_knees_bend_as_captured_whatever_the_zero_pose_says(source, walk, degrees):
    """A reference pose that is a frame of the motion twists the legs; one with mirrored bones turns them half round."""
    other = turned_at_rest(source, ["left_hip", "left_knee"], (0, 1, 0), degrees)
    np.testing.assert_allclose(joint(retarget(other), "left_knee"), joint(walk, "left_knee"), atol=0.03)


def test_straight_legs_face_ahead_whatever_the_zero_pose_says(source):
    rest = source.rest
    still = replace(source, positions=rest.positions[None].repeat(9, 0), rotations=rest.rotations[None].repeat(9, 0))
    other = turned_at_rest(still, ["left_hip", "left_knee"], (0, 1, 0), 180)
    np.testing.assert_allclose(retarget(other).rotations, retarget(still).rotations, atol=0.05)


def test_a_body_with_left_and_right_exchanged_is_refused(source):
    names = tuple({"l": "right", "r": "left"}[n[0]] + n[n.index("_") :] if "_" in n else n for n in source.joints)
    with pytest.raises(MocapError, match="left and right were exchanged"):
        retarget(replace(source, joints=names))


def travelling(source, unit):
    return replace(
        source,
        positions=source.positions + (unit - 1) * (source.positions[:, :1] - source.positions[:1, :1]) * [1, 0, 1],
    )


@pytest.mark.parametrize(
    ("unit", "slides", "remedy"),
    [
        (0.01, "99%", "in the unit of the bones"),
        (0.4, "60%", r"Divide the root's positions by 0\.398"),
        (1.5, "-50%", r"Divide the root's positions by 1\.5"),
        (10, "-90.%", "Divide the root's positions by 10"),
        (0.0, "100%", "off a treadmill"),
    ],
)
def test_a_root_in_another_unit_than_the_bones_is_refused(source, unit, slides, remedy):
    """A foot that stands moves by one step less than the root: by unit - 1 of it, and so far as planting leaves it."""
    with pytest.raises(MocapError, match=f"slide by {slides}.*another unit.*{remedy}"):
        retarget(travelling(source, unit))


def test_a_walk_between_long_stands_tells_the_unit_too(source):
    """The walk twice, with as many frames of standing before and after them."""
    count = len(source)
    frames = np.concatenate([np.zeros(count, int), *[np.arange(count)] * 2, np.full(count, count - 1)])
    travel = (source.positions[-1, 0] - source.positions[0, 0]) * [1, 0, 1]
    positions = source.positions[frames] + (np.arange(4 * count) >= 2 * count)[:, None, None] * travel
    longer = replace(source, positions=positions, rotations=source.rotations[frames])
    assert len(retarget(longer)) == len(frames)
    with pytest.raises(MocapError, match=r"slide by 9.%.*another unit"):
        retarget(travelling(longer, 0.1))


@pytest.mark.parametrize("name", ["dance_b", "backflip", "roll", "crawl"])
def test_feet_that_slide_where_nobody_walks_tell_no_unit(humanoid3d, name):
    """The feet of a dance to and fro slide by 57 % of its steps."""
    path = humanoid3d.with_name(f"humanoid3d_{name}.txt")
    assert len(retarget(load(path))) > 30


@pytest.mark.parametrize("unit", [0.7, 1.2])
def test_feet_may_slide_as_much_as_captured_ones_do(source, unit):
    assert len(retarget(travelling(source, unit))) == len(source)


@pytest.mark.parametrize(("unit", "share"), [(0.01, "-99%"), (0.3937, "-6.%"), (2.54, "1[56].%"), (1.0, "")])
def test_a_squat_with_a_root_in_another_unit_is_refused(tmp_path, unit, share):
    """Hips that go down by 30 cm while the root goes down by unit times that."""
    down = Keyframes((0.0, 1.0, 2.0), {}, root=((0.0, 0.0, 0.0), (0.0, -0.3, 0.0), (0.0, 0.0, 0.0)))
    squat = down.over(rest_pose(5))
    heights = squat.root[:, 1] - squat.root[0, 1]
    write_clip(tmp_path / "squat.npz", Motion(squat.root + (unit - 1) * heights[:, None] * [0, 1, 0], squat.rotations))
    if not share:
        assert len(retarget(load(tmp_path / "squat.npz"))) == len(squat)
        return
    with pytest.raises(MocapError, match=f"move by {share} of that.*another unit"):
        retarget(load(tmp_path / "squat.npz"))


def test_a_body_that_sways_in_another_unit_is_refused(tmp_path):
    """Hips that move by 5 cm in a second, or 5 m: too still to walk, so that no step tells the unit."""
    still = rest_pose(30)
    for unit in (1, 100):
        sways = Motion(still.root + np.linspace(0, 0.05 * unit, 30)[:, None] * [1, 0, 0], still.rotations)
        write_clip(tmp_path / f"{unit}.npz", sways)
    assert len(retarget(load(tmp_path / "1.npz"))) == 30
    with pytest.raises(MocapError, match=r"move by more than 5\.\d m/s.*another unit.*by 100"):
        retarget(load(tmp_path / "100.npz"))


# -- clips -------------------------------------------------------------------------------------------------------------
def pack(folder, humanoid3d, notes):
    with tarfile.open(folder / "some.tar.xz", "w:xz") as tar:
        tar.add(humanoid3d, "some/walk.txt")
    header = "file,source,licence,subject,frames,fps,description,skill_tags,notes\n"
    (folder / "clips.csv").write_text(f"{header}some.tar.xz!some/walk.txt,Some,MIT,1,39,30.0,walk,base walk,{notes}\n")
    return folder


def test_a_pack_gives_its_clips_with_their_spans(tmp_path, humanoid3d, walk):
    (clip,) = Folder.read(pack(tmp_path, humanoid3d, "frames walk 0-20 25-99; stop 3-3; . a remark with 5-6")).clips
    assert (clip.name, clip.source, clip.licence, clip.real) == ("walk", "Some", "MIT", True)
    assert clip.spans == {"walk": ((0, 20), (25, 38)), "stop": (), "base": ((0, 38),)}
    np.testing.assert_allclose(clip.motion.root, walk.root)


def test_a_row_that_cannot_be_read_ends_no_others_reading(tmp_path, humanoid3d, walk):
    """The table begins with the mark that Excel writes; a row may end early."""
    table = pack(tmp_path, humanoid3d, "") / "clips.csv"
    head, good = table.read_text().splitlines()
    rows = [head, good, good.replace("walk.txt", "lost.txt"), good + "frames walk 0_20", "clip.bvh"]
    table.write_text("\n".join(rows), encoding="utf-8-sig")
    (tmp_path / "clip.bvh").write_text("hello")
    folder = Folder.read(tmp_path)
    assert [clip.name for clip in folder.clips] == ["walk"]
    reasons = "; ".join(folder.left_out.values())
    assert folder.left_out.keys() == {"some.tar.xz!some/lost.txt", "some.tar.xz!some/walk.txt", "clip.bvh"}
    for words in ("No such file", "expected notes such as", "HIERARCHY"):
        assert words in reasons


def test_a_mirrored_walk_exchanges_left_and_right(walk):
    seen = Motion(*mirrored(walk.root, walk.rotations))
    for name in JOINTS:
        other = name.replace("left", "?").replace("right", "left").replace("?", "right")
        np.testing.assert_allclose(joint(seen, name), joint(walk, other) * [-1, 1, 1], atol=1e-9)
    np.testing.assert_allclose(mirrored(seen.root, seen.rotations)[1], walk.rotations)


# -- chunks ------------------------------------------------------------------------------------------------------------
def test_cut_chunks_lie_in_the_canonical_frame_of_their_history(walk):
    root, rotations = cut(walk, np.array([0, 7]))
    for index, start in enumerate((0, 7)):
        window = walk[start : start + 20]
        expected = Pose2D.of_history(window[:5]).to_local(window)
        np.testing.assert_allclose(root[index], expected.root, atol=1e-9)
        np.testing.assert_allclose(rotations[index], expected.rotations, atol=1e-9)
    np.testing.assert_allclose(canonical(root, rotations)[0], root, atol=1e-9)


def test_chunks_come_back_from_their_file(walk, tmp_path):
    chunks = Chunks.of(WALK, *cut(walk, np.arange(0, 15, 5)), "Some: walk", real=True)
    chunks.save(tmp_path / "deep" / "walk.npz")
    again = Chunks.load(tmp_path / "deep" / "walk.npz")
    np.testing.assert_array_equal(again.rotations, chunks.rotations)
    np.testing.assert_array_equal(again.params, chunks.params)
    assert again.source.tolist() == ["Some: walk"] * 3
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["walk.npz"]


def test_a_file_that_holds_no_chunks_is_refused(tmp_path):
    np.savez(tmp_path / "walk.npz", root=np.zeros((1, 20, 3)))
    with pytest.raises(MocapError, match="holds no chunks"):
        Chunks.load(tmp_path / "walk.npz")
    Chunks.of(WALK, np.zeros((0, 20, 3)), np.zeros((0, 20, 24, 3)), "Some: walk", real=True).save(tmp_path / "none.npz")
    with pytest.raises(MocapError, match="empty table"):
        Chunks.load(tmp_path / "none.npz")
    (tmp_path / "walk.npz").write_bytes((tmp_path / "walk.npz").read_bytes()[:-40])
    with pytest.raises(MocapError, match="holds no chunks"):
        Chunks.load(tmp_path / "walk.npz")


def test_mirrored_chunks_realise_the_mirrored_parameters(walk):
    chunks = Chunks.of(WALK, *cut(walk, np.arange(0, 15, 5)), "Some: walk", real=True).mirrored()
    np.testing.assert_allclose(outcomes(WALK, chunks.root, chunks.rotations), chunks.params, atol=1e-4)
    assert not chunks.real.any()


# -- curation ----------------------------------------------------------------------------------------------------------
def looped(walk, times):
    """Repeat the walk; each round continues where the last one stopped."""
    step = walk.root[-1] - walk.root[0]
    rounds = [Motion(walk.root + step * [1, 0, 1] * index, walk.rotations) for index in range(times)]
    motion = rounds[0]
    for following in rounds[1:]:
        motion = motion.then(following)
    return motion


def test_a_walk_becomes_walk_chunks_with_its_speed(walk):
    clip = Clip("walk", walk, {"walk": ((0, 38),), "base": ((0, 38),)}, "Some", "MIT")
    chunks = build_real([clip], list(trained_skills().values()))
    speed = np.linalg.norm((walk.root[-1] - walk.root[0])[[0, 2]]) / (walk.seconds - 1 / FPS)
    assert set(chunks) == {"walk", "base"}
    assert chunks["walk"].params[:, 1].mean() == pytest.approx(speed / 2, rel=0.1)
    assert set(chunks["walk"].source) == {"Some: walk"}


def test_only_what_a_span_covers_is_taken(walk):
    clip = Clip("walk", walk, {"base": ((0, 38),)}, "Some", "MIT")
    assert set(build_real([clip], list(trained_skills().values()))) == {"base"}


def test_standing_still_is_stop_and_fills_at_most_its_share(walk):
    still = Motion(np.tile(walk.root[:1], (2000, 1)), np.tile(rest_pose().rotations, (2000, 1, 1)))
    still = replace(still, root=rest_pose(2000).root)
    idling = Clip("idle", still, {"stop": ((0, 1999),), "base": ((0, 1999),)}, "Some", "MIT")
    walking = Clip("walk", looped(walk, 3), {"base": ((0, 116),)}, "Some", "MIT")
    chunks = build_real([idling, walking], list(trained_skills().values()))
    base = chunks["base"]
    share = travel(base.root.astype(float), base.rotations.astype(float)).idle.mean()
    assert len(chunks["stop"]) > 600
    assert 0.5 * IDLE_SHARE < share <= IDLE_SHARE


def test_a_glitch_of_one_frame_drops_the_chunks_that_hold_it(walk):
    rotations = walk.rotations.copy()
    rotations[30, JOINT_INDEX["left_hip"], 0] += 0.8
    clip = Clip("walk", walk, {"base": ((0, 38),)}, "Some", "MIT")
    broken = replace(clip, motion=Motion(walk.root, rotations))
    # Windows begin at 0, 3 ... 18; those from 12 on contain frame 30.
    assert len(build_real([clip], list(trained_skills().values()))["base"]) == 7
    assert len(build_real([broken], list(trained_skills().values()))["base"]) == 4


def test_a_source_must_have_a_rotation_for_every_joint(source):
    with pytest.raises(MocapError, match="17 joints need positions"):
        SourceMotion(30, source.joints, source.parents, source.positions, source.rotations[:, :5], source.rest)
