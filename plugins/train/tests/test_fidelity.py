"""Tests of the fidelity table: achieved over commanded motion, generated, in half-physics and by the median clip."""

import json
from dataclasses import replace

import numpy as np
import pytest
from declared import STROLL, declaration, declare
from tiny_motion import write_adapter

from humanclaw import CheckpointError, PluginError
from humanclaw.body import STANDING_HEIGHT, Motion, Pose2D, rest_pose
from humanclaw.motion import AdapterConfig, DiTGenerator, MotionProfile, Solver, load_base
from humanclaw.skills import HIPS, floor_for, floor_scene
from humanclaw_train.data.chunks import Chunks
from humanclaw_train.eval.fidelity import FidelityReport, achieved, baseline, measured, rows_table
from humanclaw_train.eval.rollouts import Command, Rollouts
from humanclaw_train.eval.simulated import Actor, roll_simulated


@pytest.fixture(scope="module")
def still(tmp_path_factory, still_base):
    """A generator that holds the last pose, and an adapter of step_back that changes nothing."""
    folder = tmp_path_factory.mktemp("still")
    base = still_base(folder / "base.safetensors")
    config = AdapterConfig("step_back", "mlp", ("z",), (0.25,), (0.2,))
    path = write_adapter(folder / "step_back" / "adapter.safetensors", base, config, scale=0.0)
    declare(path.parent)
    return DiTGenerator(base, MotionProfile(Solver("midpoint", 2))), path


def test_a_body_that_does_nothing_achieves_nothing(still):
    generator, path = still
    (row,) = measured(generator, [Command.of("step_back", path)], rollouts=4).rows
    assert row.generated.mean == pytest.approx(0, abs=1e-3)
    assert row.generated.error == pytest.approx(25, abs=8)
    assert row.generated.chunks == 12
    assert "| step_back | 0.000 ± 0.000 | - |" in rows_table([row]).replace("-0.000", "0.000")


def test_commands_stay_in_the_range_of_the_data_and_away_from_nothing(still):
    command = Command.of("step_back", still[1])
    values = command.draw(500, np.random.default_rng(0))
    assert values.min() >= 0.25 * (0.25 + 0.9 * 0.2) - 1e-9
    assert values.max() <= 0.25 + 0.9 * 0.2


def _gliding(distances: np.ndarray) -> Chunks:
    """Return chunks that glide backwards evenly."""
    rest = rest_pose(20)
    share = np.clip(np.arange(20) - 4, 0, None) / 15
    root = rest.root + share[:, None] * np.outer(distances, [0, 0, -1.0])[:, None]
    turns = np.repeat(rest.rotations[None], len(distances), 0)
    return Chunks.of(declaration("step_back").parameters, root, turns, "made", real=False)


def _rolled(chunks: Chunks, *asked: float) -> Rollouts:
    root, turns = chunks.root.astype(float), chunks.rotations.astype(float)
    return Rollouts(root, turns, np.array(asked)[:, None], np.ones(len(asked), bool))


def test_half_of_what_was_asked_is_a_ratio_of_a_half(still):
    ratio = achieved(Command.of("step_back", still[1]), _rolled(_gliding(np.array([0.1, 0.2])), 0.2, 0.4))
    assert (ratio.mean, ratio.std, ratio.after_other) == pytest.approx((0.5, 0, 0.5), abs=1e-5)
    assert ratio.error == pytest.approx(15, abs=1e-3)
    assert (ratio.slope, ratio.r2) == pytest.approx((0.5, 1.0), abs=1e-4)
    assert ratio.constant == pytest.approx(10)  # The best constant for 20 and 40 cm.


def test_a_constant_has_a_ratio_near_one_and_no_slope(still):
    ratio = achieved(Command.of("step_back", still[1]), _rolled(_gliding(np.full(3, 0.3)), 0.25, 0.3, 0.35))
    assert ratio.mean == pytest.approx(1.02, abs=0.01)
    assert ratio.slope == pytest.approx(0, abs=1e-5)
    assert ratio.error == pytest.approx(ratio.constant, abs=1e-4)


def test_the_baseline_plays_the_median_clip_whatever_is_asked(still, tmp_path):
    _gliding(np.array([0.1, 0.2, 0.4])).save(tmp_path / "step_back.npz")
    command = replace(Command.of("step_back", still[1]), low=np.array([0.2]), high=np.array([0.4]))
    ratio = baseline([tmp_path], command, count=4000)
    # The mean of 0.2 / c for c uniform in 0.2 to 0.4 is 0.2 ln 2 / 0.2.
    assert ratio.mean == pytest.approx(np.log(2), abs=0.01)
    assert baseline([tmp_path], replace(command, declaration=declaration("walk"))) is None


def test_the_baseline_knows_left_from_right(tmp_path):
    rest = rest_pose(20)
    root = rest.root[None] + np.outer(np.clip(np.arange(20) - 4, 0, None) / 15, [0.3, 0, 0])[None]
    Chunks.of(declaration("side_step").parameters, root, rest.rotations[None], "made", real=True).save(
        tmp_path / "side_step.npz"
    )
    command = Command(
        declaration("side_step"), tmp_path / "adapter.safetensors", ("x",), np.array([-0.3]), np.array([-0.299])
    )
    assert baseline([tmp_path], command).mean == pytest.approx(1, abs=0.01)


def test_a_ninth_skill_shows_real_figures_whatever_its_parameters(still, tmp_path):
    """Commanded: 20 cm ahead, no turn. Achieved: 30 cm and 0.1 rad. Errors: 10 cm and 5.73 degrees."""
    folder = tmp_path / "stroll"
    declare(folder, STROLL)
    base = load_base(still[1].parents[1] / "base.safetensors")
    config = AdapterConfig("stroll", "mlp", ("ahead", "veer"), (0.3, 0.0), (0.2, 0.35))
    command = Command.of("stroll", write_adapter(folder / "adapter.safetensors", base, config, scale=0.0))
    rest, share = rest_pose(20), np.clip(np.arange(20) - 4, 0, None) / 15
    rotations = rest.rotations.copy()
    rotations[:, 0, 1] = 0.1 * share
    moved = rest.root + share[:, None] * [0, 0, 0.3]
    ratio = achieved(command, Rollouts(moved[None], rotations[None], np.array([[0.2, 0.0]]), np.ones(1, bool)))
    assert ratio.mean == pytest.approx(1.5)
    assert ratio.error == pytest.approx((10 + np.degrees(0.1)) / 2)


def test_an_adapter_and_a_schema_that_differ_are_refused(still, tmp_path):
    folder = tmp_path / "stroll"
    declare(folder, STROLL)
    (folder / "adapter.safetensors").write_bytes(still[1].read_bytes())
    with pytest.raises(PluginError, match=r"trained on \(z\), and its schema.json declares \(veer, ahead\)"):
        Command.of("stroll", folder / "adapter.safetensors")


def test_the_figures_of_the_paper_lie_beside_the_skill(still):
    (row,) = measured(still[0], [Command.of("step_back", still[1])], rollouts=2).rows
    assert (row.paper, row.paper_baseline) == (None, None)
    (row,) = measured(still[0], [Command.of("step_back", _with_notes(still[1]))], rollouts=2).rows
    assert "| 0.986 ± 0.056 | 2.072 ± 1.067 |" in rows_table([row])


def _with_notes(adapter):
    (adapter.parent / "card.toml").write_text("[paper]\nratio = [0.986, 0.056]\nbaseline = [2.072, 1.067]\n")
    return adapter


# -- simulated ---------------------------------------------------------------------------------------------------------
@pytest.fixture
def simulator(plugins):
    made = plugins.make("simulators", "mujoco", profile="default")
    yield made
    made.close()


def _backwards(metres: float):
    """A generator whose body glides backwards by `metres` a chunk, whatever the command."""

    class Gliding:
        def start(self):
            return rest_pose(5)

        def generate(self, history, adapter, values, key):
            frame = Pose2D.of_history(history)
            rest = rest_pose(15)
            back = np.outer(np.arange(1, 16) / 15, [0, 0, -metres])
            return frame.to_world(Motion(rest.root + back, rest.rotations))

    return Gliding()


def test_what_the_body_glides_on_a_flat_floor_is_what_it_achieves(simulator, still):
    command = Command.of("step_back", still[1])
    command = replace(command, low=np.array([0.3]), high=np.array([0.3]))
    rolled = roll_simulated(Actor(_backwards(0.15), simulator), command, [], rollouts=1, seed=0)
    ratio = achieved(command, rolled)
    assert ratio.chunks == 3
    # Friction of the soles takes some of it.
    assert 0.45 < ratio.mean <= 0.5


def test_a_seat_is_as_high_as_the_hips_that_sit_on_it():
    scene = floor_scene(floor_for(declaration("sit_in_place"), {"h": 0.5}))
    _, high = scene.aabb(2)
    assert high[1] == pytest.approx(0.5 - HIPS)
    assert high[2] < -0.11  # Behind the hips of a body that stands before it.


@pytest.mark.parametrize(("skill", "sign"), [("climb_upstairs", 1), ("walk_downstairs", -1)])
def test_a_flight_has_treads_of_the_commanded_height_and_depth(skill, sign):
    scene = floor_scene(floor_for(declaration(skill), {"h": 0.17, "d": 0.28}, 3))
    boxes = [scene.aabb(obj.id) for obj in scene.of_category("stairs")]
    boxes = boxes[:3]
    assert [high[1] for _, high in boxes] == pytest.approx([sign * 0.17 * k for k in (1, 2, 3)], abs=1e-6)
    assert [high[2] - low[2] for low, high in boxes] == pytest.approx([0.28] * 3, abs=1e-6)
    assert [high[2] for _, high in boxes[:-1]] == pytest.approx([low[2] for low, _ in boxes[1:]], abs=1e-6)


def test_a_body_keeps_the_pose_of_its_history_in_the_next_scene(simulator, still):
    actor = Actor(_backwards(0.2), simulator)
    actor.stand(floor_scene())
    actor.act(Command.of("step_back", still[1]), np.array([0.2]), (0,))
    assert actor.simulated.root[-1, 2] == pytest.approx(-0.2, abs=0.02)
    actor.move_to(floor_scene(floor_for(declaration("sit_in_place"), {"h": 0.5})))
    assert actor.simulated.root[-1] == pytest.approx([0, STANDING_HEIGHT, 0], abs=0.02)


def test_without_motion_nothing_is_simulated(simulator, still):
    (row,) = measured(still[0], [Command.of("step_back", still[1])], rollouts=1, simulator=simulator).rows
    assert row.simulated.mean == pytest.approx(0, abs=0.02)


# -- the command line -------------------------------------------------------------------------------------------------
def test_the_command_line_prints_one_row_a_skill_and_saves_it(humanclaw, still, capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    folder = still[1].parent.parent
    file = tmp_path / "fidelity.json"
    arguments = ["fidelity", "--adapters", folder, "--base", folder / "base.safetensors", "--rollouts", "2"]
    assert humanclaw(*arguments, "--save", file) == 0
    printed = capsys.readouterr().out
    assert "ms a chunk" in printed
    report = FidelityReport.load(file)
    assert report.base == still[0].digest
    assert rows_table(report.rows) in printed
    assert humanclaw(*arguments, "--json") == 0
    assert [row["skill"] for row in json.loads(capsys.readouterr().out)["rows"]] == ["step_back"]
    assert humanclaw(*arguments, "--skills", "fly") == 2


def test_a_file_that_is_no_report_is_refused_with_a_remedy(tmp_path):
    file = tmp_path / "fidelity.json"
    file.write_text(json.dumps({"rows": [1]}))
    with pytest.raises(CheckpointError, match="holds no fidelity report"):
        FidelityReport.load(file)


def test_an_adapter_of_a_run_is_declared_by_the_installed_skill(plugins, still, tmp_path):
    run = tmp_path / "runs" / "step_back" / "adapter.safetensors"
    run.parent.mkdir(parents=True)
    run.write_bytes(still[1].read_bytes())
    (row,) = measured(still[0], [Command.of("step_back", run, plugins)], rollouts=2).rows
    assert row.skill == "step_back"
