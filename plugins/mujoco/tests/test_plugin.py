"""Behaviour that only MuJoCo has."""

import subprocess
import sys
from dataclasses import replace

import mujoco as mj
import numpy as np
import pytest

from humanclaw.testing import reset_times
from humanclaw.world import PROFILES, Pose, SceneBuilder
from humanclaw_mujoco.model import build
from humanclaw_mujoco.world import MujocoWorld, mujoco


@pytest.mark.integration
def test_nothing_is_printed_so_that_protocols_may_use_stdout():
    code = "import humanclaw_mujoco.world"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("", "")


def test_a_scene_that_is_loaded_again_is_not_compiled_again():
    builder = SceneBuilder()
    builder.floor()
    for number in range(60):
        hull = np.random.default_rng(number).uniform(0, 0.1, (40, 3)).astype(np.float32)
        builder.solid(f"rock {number}", [hull], (0.15 * number, 0, 3))
    times, _ = reset_times(mujoco(), builder.scene(), 5)
    assert min(times[1:]) < times[0]


def test_what_mujoco_warns_of_is_logged_and_leaves_no_file(tmp_path, monkeypatch, caplog):
    """Check that MuJoCo writes no MUJOCO_LOG.TXT into the working directory, as it does by default."""
    monkeypatch.chdir(tmp_path)
    mujoco()
    model = mj.MjModel.from_xml_string(
        "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>"
    )
    data = mj.MjData(model)
    data.qvel[0] = np.nan
    mj.mj_step(model, data)
    assert "QVEL" in caplog.text
    assert list(tmp_path.iterdir()) == []


def test_no_contact_makes_an_object_faster_than_fifty_metres_a_second():
    """A small object that a foot crushes against a wall gained speed without end, until its place was no number."""
    builder = SceneBuilder()
    builder.floor()
    cup = builder.box("cup", (0.1, 0.1, 0.1), (3, 0, 0), movable=True, mass=0.4)
    scene, profile = builder.scene(), PROFILES["default"]
    pose = Pose(np.array([0.0, 0.95, 0.0]), np.tile([0.0, 0.0, 0.0, 1.0], (24, 1)))
    world = MujocoWorld(build(scene, profile), scene, profile).stood(0, pose)
    thrown = world.motion(cup)
    world.set_motion(cup, replace(thrown, velocity=np.array([0.0, 0.0, 1e5]), spin=np.array([1e9, 0.0, 0.0])))
    world.step(1 / 120)
    after = world.motion(cup)
    assert 49 < after.velocity[2] <= 50
    assert np.linalg.norm(after.spin) <= 50 * np.sqrt(3)


def test_a_body_that_slides_over_a_floor_is_not_lifted_off_it():
    """MuJoCo parts what slides at friction times its speed: feet that leaf lifted a walking body by a centimetre."""
    builder = SceneBuilder()
    builder.floor()
    scene, profile = builder.scene(), PROFILES["default"]
    pose = Pose(np.array([0.0, 0.966, 0.0]), np.tile([0.0, 0.0, 0.0, 1.0], (24, 1)))
    world = MujocoWorld(build(scene, profile), scene, profile).stood(0, pose)
    world.drive(np.array([0.0, -0.2, 4.0]), np.zeros(3))
    world.step(1 / 120)
    assert world.velocity()[0][1] < 0.1
