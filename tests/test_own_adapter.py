"""A skill with an adapter of its own, from a clip to a call. The training: -m evidence, and torch."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from humanclaw import Body, CheckpointError, Plugins
from humanclaw.body import JOINT_INDEX, forward_kinematics, rest_pose
from humanclaw.cli import build

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.fixture
def copied(tmp_path):
    """The example in a folder of its own, so that what is trained does not stay."""
    shutil.copy(EXAMPLES / "squat.py", tmp_path)
    shutil.copytree(EXAMPLES / "squat", tmp_path / "squat")
    return tmp_path


def test_a_skill_without_its_adapter_is_refused_with_the_remedy(copied, body):
    plugins = Plugins.discover([copied / "squat.py"])
    assert not plugins.skill("squat").trained
    assert "squat" not in plugins.disabled
    held, body.plugins = body.plugins, plugins
    try:
        assert "squat" not in [tool["function"]["name"] for tool in body.tools("openai")]
        with pytest.raises(CheckpointError, match="humanclaw train adapter"):
            body.call("squat", h_cm=60)
    finally:
        body.plugins = held


def _squats(path: Path) -> None:
    """A clip of somebody who squats: thighs, shins and feet turn, and the hips go down by what the legs lose."""
    frames = 900
    bend = 0.68 * (1 - np.cos(np.arange(frames) / 30 * np.pi)) * np.linspace(0.8, 1.0, frames)
    standing = rest_pose(1)
    root, rotations = np.repeat(standing.root, frames, 0), np.repeat(standing.rotations, frames, 0)
    for side in ("left", "right"):
        for joint, share in ((f"{side}_hip", -1.0), (f"{side}_knee", 2.0), (f"{side}_ankle", -1.0)):
            rotations[:, JOINT_INDEX[joint], 0] += share * bend
    foot = JOINT_INDEX["left_ankle"]
    heights = np.array([forward_kinematics(p, r)[0][foot, 1] for p, r in zip(root, rotations, strict=True)])
    root[:, 1] -= heights - heights[0]
    path.parent.mkdir()
    names = ("generated_root", "generated_rotations", "simulated_root", "simulated_rotations")
    np.savez(path, **dict(zip(names, (root, rotations, root, rotations), strict=True)))


@pytest.mark.evidence
def test_a_clip_becomes_an_adapter_and_the_adapter_a_call(copied, house, monkeypatch):
    _squats(copied / "clips" / "motion.npz")
    monkeypatch.chdir(copied)
    command = build(Plugins.discover)
    for line in ("data chunks --skill squat --clips clips --seconds 60", "train adapter --skill squat --steps 80"):
        done = CliRunner().invoke(command, line.split())
        assert done.exit_code == 0, f"{done.output} {done.exception!r}"
    plugins = Plugins.discover([copied / "squat.py"])
    assert plugins.skill("squat").trained
    with Body(house, plugins=plugins) as body:
        body.call("squat", h_cm=60)
        deep = body.last.chunks[0].commanded.root[-1, 1]
        body.reset(house)
        body.call("squat", h_cm=88)
        assert deep < body.last.chunks[0].commanded.root[-1, 1] - 0.05
