"""Tests of a skill of your own, from a folder of motion to a model card, with artificial squats and a small prior."""

import json

import numpy as np
import pytest

from humanclaw import HumanclawError, Motion
from humanclaw.body import HISTORY, JOINT_INDEX, forward_kinematics, rest_pose, support_height
from humanclaw.motion import load_base, read_header, shipped_base
from humanclaw.skills import MEASURES, Measure
from humanclaw_train import cards
from humanclaw_train.data import custom_skill
from humanclaw_train.data.chunks import Chunks
from humanclaw_train.data.retimed import _QUIET, retimed
from humanclaw_train.eval import fidelity
from humanclaw_train.synthesis.commands import Trained

SCHEMA = {
    "description": "Crouch.",
    "x-role": "posture",
    "type": "object",
    "properties": {
        "h_cm": {"type": "integer", "minimum": 60, "maximum": 85, "x-measure": "hips.height", "description": "Height."}
    },
    "required": ["h_cm"],
    "additionalProperties": False,
}


def squat(seconds: float = 2.0, depth: float = 1.0) -> Motion:
    """Squat down and up once: thighs forward, shins back, level soles on the floor."""
    still = rest_pose(int(30 * seconds))
    bend = depth * np.sin(np.pi * np.linspace(0, 1, len(still))) ** 2
    for side in ("left", "right"):
        for joint, share in (("hip", -1), ("knee", 2), ("ankle", -1)):
            still.rotations[:, JOINT_INDEX[f"{side}_{joint}"], 0] = share * bend
    low = support_height(still.joints())
    ankles = still.joints()[:, JOINT_INDEX["left_ankle"], 2]
    return Motion(still.root - np.stack([0 * low, low, ankles - ankles[0]], 1), still.rotations)


def record(folder, motion: Motion, name: str = "motion.npz") -> None:
    folder.mkdir(parents=True, exist_ok=True)
    np.savez(folder / name, simulated_root=motion.root, simulated_rotations=motion.rotations)


def amass(folder, motion: Motion) -> None:
    """Write the same motion as a capture: Z up, 60 Hz."""
    folder.mkdir(parents=True, exist_ok=True)
    twice = np.repeat(np.arange(len(motion)), 2)
    poses = motion.rotations[twice].reshape(len(twice), -1).copy()
    poses[:, :3] = [np.pi / 2, 0, 0]
    root = motion.root[twice][:, [0, 2, 1]] * [1, -1, 1]
    np.savez(folder / "squat.npz", poses=poses, trans=root, mocap_framerate=60.0)


@pytest.fixture
def skill(tmp_path):
    folder = tmp_path / "crouch"
    folder.mkdir()
    (folder / "schema.json").write_text(json.dumps(SCHEMA))
    return folder


@pytest.fixture
def make(humanclaw, tmp_path):
    """A function that makes the chunks of a skill from a folder of clips."""

    def run(skill, clips, *more: str) -> Chunks:
        out = tmp_path / "chunks"
        assert humanclaw("data", "chunks", "--skill", skill, "--clips", clips, "--out", out, *more) == 0
        return Chunks.load(out / "crouch.npz")

    return run


def test_a_parameter_may_command_a_measure_of_a_plugin(tmp_path):
    bend = Measure("knees.bend", "rad", "Bend of a knee.", 1, lambda p, r: r[:, -1, JOINT_INDEX["left_knee"], 0])
    part = {"type": "integer", "minimum": 10, "maximum": 120, "x-measure": "knees.bend", "description": "Bend."}
    folder = tmp_path / "curtsy"
    folder.mkdir()
    (folder / "schema.json").write_text(
        json.dumps(SCHEMA | {"properties": {"bend_deg": part}, "required": ["bend_deg"]})
    )
    record(tmp_path / "clips", squat())
    given = (tmp_path / "clips", tmp_path, 0.0, 0)
    with pytest.raises(HumanclawError, match=r"knees\.bend"):
        custom_skill.saved(Trained.read(folder), *given)
    chunks, _ = custom_skill.saved(Trained.read(folder, {**MEASURES, "knees.bend": bend}), *given)
    assert np.allclose(chunks.params[:, 0], chunks.rotations[:, -1, JOINT_INDEX["left_knee"], 0], atol=1e-4)


def test_a_window_is_measured_by_what_the_schema_declares(make, skill, tmp_path):
    record(tmp_path / "clips", squat())
    chunks = make(skill, tmp_path / "clips", "--seconds", "0")
    assert chunks.names.tolist() == ["h"]
    assert np.allclose(chunks.params[:, 0], chunks.root[:, -1, 1], atol=1e-6)


def test_what_is_far_outside_the_bounds_is_no_example_of_the_skill(make, skill, tmp_path):
    record(tmp_path / "clips", squat(depth=1.4))
    assert squat(depth=1.4).root[:, 1].min() < 0.45
    heights = make(skill, tmp_path / "clips", "--seconds", "100").params[:, 0]
    assert heights.min() > 0.6 - 0.15 * 0.25 - 1e-6
    assert heights.max() < 0.85 + 0.15 * 0.25 + 1e-6


def test_bounds_that_no_clip_reaches_are_reported_before_training(make, skill, tmp_path, capsys):
    record(tmp_path / "clips", squat(depth=0.8))
    np.savez(tmp_path / "clips" / "prices.npz", prices=np.ones(3))
    make(skill, tmp_path / "clips", "--seconds", "0")
    report = capsys.readouterr().err
    assert "warning: h_cm may be 60 to 85, and the chunks show 7" in report
    assert "prices.npz is no AMASS motion" in report


def test_a_posture_is_taken_from_any_height_to_any_other(make, skill, tmp_path):
    amass(tmp_path / "clips", squat())
    chunks = make(skill, tmp_path / "clips", "--seconds", "100")
    retimed = chunks[~chunks.real]
    rises = retimed.root[:, -1, 1] - retimed.root[:, HISTORY - 1, 1]
    assert (rises < -0.1).sum() > 10
    assert (rises > 0.1).sum() > 10
    toes = forward_kinematics(retimed.root, retimed.rotations)[0][:, :, JOINT_INDEX["left_foot"]]
    assert np.ptp(toes[..., [0, 2]], axis=1).max() < 0.01


def test_a_posture_is_taken_from_standing_to_any_height(make, skill, tmp_path):
    amass(tmp_path / "clips", squat())
    chunks = make(skill, tmp_path / "clips", "--seconds", "200")
    standing = load_base(shipped_base()).start_rotations[-1]
    begun = np.abs(chunks.rotations[:, :HISTORY] - standing).max((1, 2, 3)) < 1e-4
    assert begun.mean() > 0.05
    assert np.ptp(chunks.params[begun]) > 0.8 * np.ptp(chunks.params)


def test_chunks_of_captured_motion_are_real_and_no_others(make, skill, tmp_path):
    amass(tmp_path / "studio", squat())
    chunks = make(skill, tmp_path / "studio", "--seconds", "40")
    real = set(chunks.source[chunks.real].tolist())
    assert real == {"studio: squat"}
    assert custom_skill.RETIMED in set(chunks.source[~chunks.real].tolist())


def test_what_a_body_did_in_an_episode_is_not_real(make, skill, tmp_path):
    record(tmp_path / "run" / "one", squat())
    assert not make(skill, tmp_path / "run", "--seconds", "0").real.any()


def test_a_recipe_narrows_down_what_shows_the_skill(make, skill, tmp_path):
    recipe = 'from humanclaw.skills import Recipe\nRECIPE = Recipe(name="crouch", windows=lambda w: w.up < -0.05)\n'
    (skill / "recipe.py").write_text(recipe)
    record(tmp_path / "clips", squat())
    chunks = make(skill, tmp_path / "clips")
    assert ((chunks.root[:, -1, 1] - chunks.root[:, HISTORY - 1, 1]) < -0.05).all()
    assert custom_skill.RETIMED not in chunks.source


def test_clips_that_do_not_show_the_skill_are_refused(humanclaw, skill, tmp_path, capsys):
    record(tmp_path / "clips", rest_pose(60))
    assert humanclaw("data", "chunks", "--skill", skill, "--clips", tmp_path / "clips") == 2
    assert "None of the 1 clips shows crouch" in capsys.readouterr().err


def test_a_recipe_that_is_none_is_refused(skill):
    (skill / "recipe.py").write_text("RECIPES = []\n")
    with pytest.raises(HumanclawError, match="no RECIPE"):
        Trained.read(skill)


def test_from_motion_to_a_card_by_the_folder_alone(humanclaw, make, skill, tmp_path, still_base, capsys):
    pytest.importorskip("torch")
    from humanclaw_train import train

    base = tmp_path / "base.safetensors"
    still_base(base)
    amass(tmp_path / "studio", squat())
    make(skill, tmp_path / "studio", "--seconds", "40", "--base", str(base))
    given = ["--data", str(tmp_path / "chunks"), "--out", str(tmp_path / "run"), "--base", str(base)]
    more = ["--steps", "3", "--batch", "8", "--licence", "studio: CC0", "--device", "cpu"]
    assert train.main(["adapter", "--skill", str(skill), *given, *more]) == 0
    assert "step       3  fidelity " in capsys.readouterr().out
    assert read_header(skill / "adapter.safetensors")["adapter"]["skill"] == "crouch"
    assert humanclaw("fidelity", "--skill", skill, "--base", base, "--rollouts", "4") == 0
    (row,) = fidelity.FidelityReport.load(skill / fidelity.REPORT).rows
    assert row.generated.chunks == 12
    assert np.isfinite(row.generated.mean)
    assert humanclaw("cards", "--skill", skill, "--base", base) == 0
    card = " ".join((skill / cards.CARD).read_text().split())
    assert f"* generated: {row.generated.mean:.3f}" in card
    assert "* studio: CC0; " in card
    assert "Its poses are the clips'" in card
    assert "sitting" not in card
    assert "nan" not in card


def test_training_asks_for_a_skill_and_no_more_than_one(skill, capsys):
    pytest.importorskip("torch")
    from humanclaw_train import train

    assert train.main(["adapter"]) == 2
    assert train.main(["adapter", "crouch", "--skill", str(skill)]) == 2
    assert capsys.readouterr().err.count("Expected one skill to train.") == 2


def test_the_error_for_a_skill_without_adapter_says_how_to_train_one(humanclaw, skill, capsys):
    assert humanclaw("fidelity", "--skill", skill) == 2
    assert f"humanclaw train adapter --skill {skill}" in capsys.readouterr().err


def test_a_clip_whose_hips_hardly_move_is_retimed_as_a_whole():
    """The hips drift by 1.5 times the distance that counts as rest: no frame is away from both ends."""
    clip = rest_pose(60)
    root = clip.root + np.linspace(0, 1.5 * _QUIET, 60)[:, None] * [1.0, 0.0, 0.0]
    made = retimed(Motion(root, clip.rotations), rest_pose(5), 4, np.random.default_rng(0))
    assert len(made) == 65
    assert np.isfinite(made.rotations).all()


def test_the_image_of_a_one_sided_skill_is_measured_anew(tmp_path):
    """An arm goes up and comes down; in its mirror image it is the other one, and this one hangs."""
    hand = JOINT_INDEX["right_hand"]
    height = Measure("hand.height", "m", "Of it.", None, lambda p, r: forward_kinematics(p, r)[0][:, -1, hand, 1])
    part = {"type": "integer", "minimum": 100, "maximum": 170, "x-measure": "hand.height", "description": "Height."}
    folder = tmp_path / "reach_up"
    folder.mkdir()
    (folder / "schema.json").write_text(json.dumps(SCHEMA | {"properties": {"h_cm": part}, "x-role": "gesture"}))
    rule = "lambda w: w.joints[:, -1, 23, 1] > w.joints[:, -1, 22, 1] + 0.1"
    assert (JOINT_INDEX["left_hand"], hand) == (22, 23)
    (folder / "recipe.py").write_text(
        f"from humanclaw.skills import Recipe\nRECIPE = Recipe('reach_up', windows={rule}, retimed=True)\n"
    )
    motion = rest_pose(90)
    raised = 2.2 * np.sin(np.pi * np.linspace(0, 1, 90)) ** 2
    motion.rotations[:, JOINT_INDEX["right_shoulder"], 2] -= raised
    record(tmp_path / "clips", motion)
    (tmp_path / "clips/LICENCE.txt").write_text("Mine: CC BY-SA 3.0\n")
    skill = Trained.read(folder, {**MEASURES, "hand.height": height})
    chunks, _ = custom_skill.saved(skill, tmp_path / "clips", tmp_path, 60.0, 0)
    hands = forward_kinematics(chunks.root.astype(float), chunks.rotations.astype(float))[0][:, -1, :, 1]
    assert len(chunks) > 20
    assert np.allclose(chunks.params[:, 0], hands[:, hand], atol=1e-4)
    assert (hands[:, hand] > hands[:, 22] + 0.1).all()
    assert hands[chunks.source == "retimed", hand].max() > 1.3
    assert chunks.licences.tolist() == ["Mine: CC BY-SA 3.0"]
