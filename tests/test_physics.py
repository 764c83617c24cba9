"""Physics checks and the world's speed: their own arithmetic, and the commands that print them."""

import numpy as np
import pytest
from click.testing import CliRunner
from engines import BULLET, DEFAULT
from hosting import plugin

from humanclaw import Backends, default_simulator
from humanclaw.body import FPS, JOINTS
from humanclaw.cli import build
from humanclaw.cli.physics import physics
from humanclaw.errors import PluginError
from humanclaw.laws.body import table
from humanclaw.laws.fixture import Finding
from humanclaw.plugins import Plugins
from humanclaw.records import RecordedEpisode
from humanclaw.testing.speed import resident
from humanclaw.world import SceneBuilder, find_profile
from humanclaw.world.half_physics.articulated_object import articulated_objects
from humanclaw.world.half_physics.kernels import approach


def test_the_papers_profile_runs_at_120_hertz_with_stiffness_one():
    paper = find_profile("paper")
    assert paper.substeps * FPS == 120
    assert {paper.stiffness_of(joint) for joint in JOINTS} == {1.0}


@pytest.mark.parametrize(("ahead", "full", "way"), [(0.06, True, 0.06), (0.03, False, 0.03), (0.06, False, 0.1)])
def test_a_link_in_the_box_of_a_leaning_board_may_meet_it_anywhere(ahead, full, way):
    """A link of 10 cm moves `ahead` towards a box 5 cm away, and 8 cm along it: 10 cm in all with 6 cm."""
    now, moved = np.array([[0.0, 0.0, 0.0], [0.1, 0.1, 0.1]]), np.array([ahead, 0.0, 0.08])
    boxes = np.stack([*now, now[0], now[1] + moved, moved])[:, None]
    corners = np.array([[0.15, -1.0, -1.0]]), np.array([[1.0, 1.0, 1.0]])
    assert approach(boxes, *corners, np.array([full]), 0.03) == pytest.approx(way)


def test_a_finding_outside_its_bounds_does_not_hold_in_the_table():
    wrong = Finding("falling", "acceleration", 12.0, "m/s2", 9.6, 10.0)
    assert not wrong.holds
    assert table([wrong]).splitlines()[-1] == "| falling | acceleration | 12 m/s2 | ≥ 9.6, ≤ 10 | **no** |"


@pytest.mark.parametrize("simulator", [BULLET, "mujoco"])
def test_the_command_prints_the_table_and_nothing_else(simulator):
    done = CliRunner().invoke(physics, ["--simulator", simulator, "free-space"])
    assert done.exit_code == 0
    assert done.stdout.startswith("| check | measure | found | bound | holds |")
    assert len(done.stdout.splitlines()) == 5


def test_the_memory_of_the_process_is_open_where_it_is_not_told(tmp_path):
    (tmp_path / "statm").write_text("1000 256 64 1 0 900 0\n")
    assert resident(tmp_path / "statm") == 1.0
    assert np.isnan(resident(tmp_path / "elsewhere"))


def test_a_door_that_hangs_still_is_worked_out_once():
    builder = SceneBuilder()
    door = builder.door()
    (leaf,) = articulated_objects(builder.scene()).values()
    still = leaf.motion(0.0, 0.0)
    assert leaf.motion(0.0, 0.0) is still
    turning = leaf.motion(-np.pi / 2, -2.0)
    # The leaf hangs at x -0.45, z 0.8, and its middle is 0.45 m from there: at a right angle it has come round to +Z.
    assert leaf.obj.id == door
    np.testing.assert_allclose(turning.position[[0, 2]], [-0.45, 1.25], atol=1e-6)
    np.testing.assert_allclose(turning.velocity, [-0.9, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(leaf.motion(0.0, 0.0).position, still.position)
    with pytest.raises(ValueError, match="read-only"):
        still.position[0] = 1.0


def _offering(*names):
    plugins = Plugins()

    plugins.add(plugin(simulators=[(name, lambda: None) for name in names]), "offers")
    return plugins


@pytest.mark.parametrize(
    ("installed", "chosen"), [(("mujoco", "bullet"), "bullet"), (("mine", "mujoco"), "mujoco"), (("mine",), "mine")]
)
def test_bullet_moves_the_world_where_it_is_installed_or_mujoco(installed, chosen):
    assert Backends().chosen(_offering(*installed)).simulator == chosen


def test_a_named_simulator_is_taken_and_none_at_all_is_told():
    assert Backends("mine").chosen(_offering("bullet")).simulator == "mine"
    with pytest.raises(PluginError, match="no simulator"):
        default_simulator(_offering())


@pytest.mark.parametrize(("asked", "recorded"), [([], DEFAULT), (["--simulator", "mujoco"], "mujoco")])
def test_the_record_names_the_simulator_that_was_chosen(asked, recorded, tmp_path):
    arguments = ["run", "--agent", "still", "--max-steps", "1", "--film", "none", "--out", str(tmp_path), *asked]
    done = CliRunner().invoke(build(Plugins.discover), arguments)
    assert done.exit_code == 0, done.output
    (path,) = tmp_path.glob("*/episode.json")
    assert RecordedEpisode(path.parent).record.settings["body"]["simulator"] == recorded
    assert RecordedEpisode(path.parent).record.settings["body"]["generator"] == "dit"
