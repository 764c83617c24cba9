"""Tests of training data from a folder tree in AMASS's format, which a program writes (tests/support/amass_tree.py)."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from amass_tree import synthesize, trained_skills, write_amass, write_clip

from humanclaw import HumanclawError
from humanclaw.body import JOINT_INDEX, JOINTS, PARENTS, rest_pose
from humanclaw.motion import read_header
from humanclaw_train.data import build as building
from humanclaw_train.data.chunks import Chunks
from humanclaw_train.data.curate import build_real
from humanclaw_train.mocap import clips
from humanclaw_train.mocap.clips import Clip, Folder


@pytest.fixture(scope="module")
def tree(tmp_path_factory) -> Path:
    return write_amass(tmp_path_factory.mktemp("amass"))


@pytest.fixture
def build(humanclaw):
    return lambda source, out, *more: humanclaw("data", "build", source, "--out", out, *more)


def _report(folder: Path) -> list[dict[str, str]]:
    with (folder / "report.csv").open(encoding="utf-8") as lines:
        return list(csv.DictReader(lines))


def _walk(z: float = 0.55, calls: int = 6):
    return synthesize([(trained_skills()["walk"], {"z": z})] * calls, 0)


@pytest.mark.integration
def test_from_an_amass_tree_to_an_adapter(build, tree, tmp_path, capsys):
    pytest.importorskip("torch")
    from humanclaw_train import train

    chunks, base, skill = (tmp_path / name for name in ("chunks", "base", "walk"))
    assert build(tree, chunks, "--seconds", "8") == 0
    assert "trained on" in capsys.readouterr().out
    few = ["--data", str(chunks), "--steps", "3", "--batch", "8", "--device", "cpu"]
    assert train.main(["base", *few, "--out", str(base), "--size", "tiny"]) == 0
    assert train.main(["adapter", "walk", *few, "--out", str(skill), "--base", str(base / "base.safetensors")]) == 0
    card = read_header(skill / "adapter.safetensors")["card"]["data"]
    assert card["sources"].keys() == {"STUDIO", "composed"}
    assert card["real"] == Chunks.load(chunks / "walk.npz").real.sum()


def test_windows_of_unlabelled_clips_show_what_their_geometry_says(build, tree, tmp_path):
    assert build(tree, tmp_path, "--seconds", "0", "--hold-out", "STUDIO/02/*") == 0
    chunks = {name: Chunks.load(tmp_path / f"{name}.npz") for name in ("walk", "turn_in_place", "side_step", "base")}
    assert set(chunks["base"].source) == {
        f"STUDIO: STUDIO/0{who}/{what}_poses" for who in "01" for what in ("walk", "stroll")
    }
    # The synthesised subjects walk 55 cm a half second straight ahead, turn by 0.9 and step 30 cm to the left.
    assert np.median(chunks["walk"].params[:, 1]) == pytest.approx(0.55, abs=0.1)
    assert chunks["turn_in_place"].params.max() == pytest.approx(0.9, abs=0.1)
    assert chunks["side_step"].params.max() == pytest.approx(0.3, abs=0.05)
    assert not (tmp_path / "climb_upstairs.npz").exists()


def test_a_report_names_every_file_with_what_became_of_it(build, tree, tmp_path, capsys):
    assert build(tree, tmp_path, "--seconds", "0", "--hold-out", "*/02/*") == 0
    outcomes = {row["name"]: (row["outcome"], row["reason"]) for row in _report(tmp_path)}
    assert outcomes["STUDIO/00/walk_poses"] == ("trained on", "")
    assert outcomes["STUDIO/02/walk_poses"] == ("held out", "")
    outcome, reason = outcomes["STUDIO/01/shape.npz"]
    assert outcome == "left out"
    assert "no AMASS motion" in reason
    assert len(outcomes) == 9
    assert "none was asked for" in capsys.readouterr().out


def test_clips_are_left_out_for_a_reason(build, tmp_path):
    walk = _walk()
    lying = rest_pose(90)
    lying.rotations[:, 0, 0] = np.pi / 2
    write_clip(_in(tmp_path / "in" / "long.npz"), walk)
    write_clip(tmp_path / "in" / "short.npz", walk[:10])
    write_clip(tmp_path / "in" / "crawl.npz", _flipping(walk))
    (tmp_path / "in" / "cut_off.npz").write_bytes((tmp_path / "in" / "long.npz").read_bytes()[:5000])
    (tmp_path / "in" / "LICENSE.txt").write_text("All rights reserved.")
    at = {"trans": np.zeros((90, 3)), "mocap_framerate": 30}
    np.savez(tmp_path / "in" / "quaternions.npz", poses=np.zeros((90, 96)), **at)
    np.savez(tmp_path / "in" / "seconds.npz", poses=np.zeros((90, 156)), **at | {"mocap_framerate": 1 / 30})
    (tmp_path / "in" / "point.bvh").write_text(_point())
    assert build(tmp_path / "in", tmp_path / "out", "--seconds", "0", "--hold-out", "") == 0
    reasons = {row["name"]: row["reason"] for row in _report(tmp_path / "out")}
    assert reasons["long"] == ""
    assert reasons["short"] == "shorter than 0.67 s"
    assert reasons["crawl"] == "a joint that flips"
    assert "cannot be read" in reasons["cut_off.npz"]
    assert "expected JSON" in reasons["LICENSE.txt"]
    assert "expected poses (T, 66, 72, 156 or 165)" in reasons["quaternions.npz"]
    assert "expected frames a second as mocap_framerate; got 0.0333333" in reasons["seconds.npz"]
    assert "Head, pelvis and feet are in one place" in reasons["point.bvh"]


def test_a_file_that_nobody_foresaw_ends_no_others_reading(build, tmp_path, monkeypatch):
    for name in ("good", "odd"):
        write_clip(_in(tmp_path / "in" / name / "walk.npz"), _walk())

    def read(file, reading, load=clips.load):
        return 1 / 0 if "odd" in str(file) else load(file, reading)

    monkeypatch.setattr(clips, "load", read)
    assert build(tmp_path / "in", tmp_path / "out", "--seconds", "0", "--hold-out", "") == 0
    reasons = {row["name"]: row["reason"] for row in _report(tmp_path / "out")}
    assert reasons["odd/walk.npz"] == "cannot be read: ZeroDivisionError: division by zero"
    assert reasons["good/walk"] == ""


def _point() -> str:
    """A BVH whose positions, one for each joint, are all 0: no bone has a length."""

    def joint(index: int) -> str:
        children = "".join(joint(k) for k, parent in enumerate(PARENTS) if parent == index)
        channels = "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
        end = "End Site\n{\nOFFSET 0 1 0\n}\n"
        kind = "JOINT" if index else "ROOT"
        return f"{kind} {JOINTS[index]}\n{{\nOFFSET 0 1 0\n{channels}\n{children or end}}}\n"

    frame = " ".join(["0"] * 6 * len(JOINTS)) + "\n"
    return f"HIERARCHY\n{joint(0)}MOTION\nFrames: 30\nFrame Time: 0.033333\n{30 * frame}"


def _in(path: Path) -> Path:
    path.parent.mkdir(parents=True)
    return path


def _flipping(motion):
    rotations = motion.rotations.copy()
    rotations[::5, JOINT_INDEX["head"], 1] += 2.0
    return replace(motion, rotations=rotations)


def test_a_body_with_a_raised_hand_trains_the_prior_but_no_skill():
    walk = _walk()
    rotations = walk.rotations.copy()
    rotations[:, JOINT_INDEX["left_shoulder"], 2] = 1.5
    carrying = Clip("carry", replace(walk, rotations=rotations), None, "STUDIO", "")
    assert set(build_real([carrying], list(trained_skills().values()))) == {"base"}
    assert "walk" in build_real([replace(carrying, motion=walk)], list(trained_skills().values()))


def test_without_a_straight_walk_there_is_no_synthetic_motion(build, tmp_path, capsys):
    write_clip(
        _in(tmp_path / "in" / "turn.npz"),
        synthesize([(trained_skills()["turn_in_place"], {"yaw": 0.9})] * 4, 0),
    )
    assert build(tmp_path / "in", tmp_path / "out", "--seconds", "20") == 0
    assert "No synthetic motion: None of 1 clips shows a straight walk" in capsys.readouterr().out
    assert Chunks.load(tmp_path / "out" / "base.npz").real.all()


def test_clips_of_which_none_is_plausible_are_refused_with_the_report(build, tmp_path, capsys):
    write_clip(_in(tmp_path / "in" / "short.npz"), rest_pose(10))
    assert build(tmp_path / "in", tmp_path / "out") == 2
    report = capsys.readouterr().err
    assert "No clip of" in report
    assert "shorter than 0.67 s" in report
    assert not (tmp_path / "out").exists()


def test_a_folder_without_motion_is_refused(tmp_path):
    with pytest.raises(HumanclawError, match="holds no motion"):
        Folder.read(tmp_path)


def test_a_table_beside_the_files_labels_them(build, tmp_path):
    write_clip(_in(tmp_path / "in" / "a.npz"), _walk(calls=8))
    head = "file,source,licence,subject,frames,fps,description,skill_tags,notes"
    row = "a.npz,STUDIO,CC0,1,480,120,walk,base walk,frames walk 0-239. stops then"
    (tmp_path / "in" / "clips.csv").write_text(f"{head}\n{row}\n")
    assert build(tmp_path / "in", tmp_path / "out", "--seconds", "0") == 0
    chunks = {name: Chunks.load(tmp_path / "out" / f"{name}.npz") for name in ("walk", "base")}
    assert 0 < len(chunks["walk"]) < 0.6 * len(chunks["base"])


def test_a_table_without_a_column_is_refused(tmp_path):
    (tmp_path / "clips.csv").write_text("file,source,licence\n")
    with pytest.raises(HumanclawError, match="no column skill_tags, notes"):
        Folder.read(tmp_path)


def test_one_folder_in_twenty_is_held_out():
    motion = rest_pose(1)
    clips = [Clip(f"S/{who:02d}/{what}", motion, None, "S", "") for who in range(40) for what in "ab"]
    assert building.held_out(clips) == {"S/19/a", "S/19/b", "S/39/a", "S/39/b"}
    assert building.held_out(clips[:30]) == {"S/04/b", "S/14/b"}
    assert building.held_out(clips[:1]) == set()
    assert building.held_out(clips, ["S/0?/a"]) == {f"S/0{who}/a" for who in range(10)}


def test_the_statistics_are_json_on_request(build, tree, tmp_path, capsys):
    assert build(tree, tmp_path, "--seconds", "0", "--json") == 0
    rows = {row["skill"]: row for row in json.loads(capsys.readouterr().out)}
    assert rows["walk"]["real"] > 50
    assert len(rows["walk"]["5 / 50 / 95 %"]["z"]) == 3


def test_what_files_do_not_say_is_an_option(build, tmp_path, capsys):
    """A file of 120 frames a second that were 240 lasts half as long."""
    (tmp_path / "S").mkdir()
    write_clip(tmp_path / "S" / "a.npz", _walk())
    seconds = []
    for number, more in enumerate(([], ["--fps", "240"], ["--up", "z", "--joint", "head=head"])):
        assert build(tmp_path / "S", tmp_path / str(number), "--seconds", "0", *more) == 0
        seconds.append(float(_report(tmp_path / str(number))[0]["seconds"]))
    assert seconds[1] == pytest.approx(seconds[0] / 2, abs=0.05)
    assert seconds[2] == seconds[0]
    assert build(tmp_path / "S", tmp_path / "x", "--joint", "head") == 2
    assert build(tmp_path / "S", tmp_path / "x", "--joint", "kopf=head") == 2
    report = capsys.readouterr().err
    assert "expected OURS=THEIRS; got head" in report
    assert "got kopf=head. Ours are pelvis" in " ".join(report.split())
