"""The measures of motion fidelity, on motion whose numbers follow by hand."""

import numpy as np
import pytest
import torch

from humanclaw import pose
from humanclaw.motion.checkpoint import Card, Normaliser, load_base, save_adapter, save_base
from humanclaw.motion.control import Adapter, AdapterConfig
from humanclaw.motion.dit import DiT, ModelConfig
from humanclaw.motion.flow import Solver
from humanclaw.motion.generator import DiTGenerator
from humanclaw.training.chunks import Chunks
from humanclaw.training.fidelity import (
    Command,
    acceleration,
    fidelity,
    main,
    markdown,
    penetration,
    reference,
    root_jerk,
    skate,
)


def _sliding(metres_a_second: float, frames: int = 20) -> pose.Motion:
    rest = pose.rest_pose(frames)
    ahead = np.arange(frames) / 30 * metres_a_second
    return pose.Motion(rest.root + np.stack([0 * ahead, 0 * ahead, ahead], 1), rest.rotations)


def test_a_body_that_slides_skates_at_its_own_speed():
    assert skate(_sliding(0.6).joints()) == pytest.approx(60)
    assert skate(_sliding(0.0).joints()) == 0


def test_a_foot_in_the_air_does_not_skate():
    joints = _sliding(0.6).joints() + [0.0, 0.2, 0.0]
    assert np.isnan(skate(joints))


def test_penetration_is_the_depth_of_the_lowest_sole():
    joints = _sliding(0.0).joints()
    assert penetration(joints - [0.0, 0.03, 0.0]) == pytest.approx(3)
    assert penetration(joints + [0.0, 0.03, 0.0]) == 0


def test_a_jump_where_history_and_future_meet_is_seen_there_and_nowhere_else():
    joints = np.repeat(pose.rest_pose().joints(), 20, 0)
    joints[5:] += [0.0, 0.0, 0.01]
    seam, inside = acceleration(joints[None])
    assert seam == pytest.approx(0.01 * 30**2)
    assert inside == 0


def test_even_and_evenly_accelerated_motion_have_no_jerk_and_cubic_motion_has_its_own():
    seconds = np.arange(60) / 30
    rest = pose.rest_pose(60)

    def jerk(ahead: np.ndarray) -> float:
        return root_jerk(pose.Motion(rest.root + np.outer(ahead, [0, 0, 1.0]), rest.rotations))

    assert jerk(2 * seconds) == pytest.approx(0, abs=1e-9)
    assert jerk(seconds**2) == pytest.approx(0, abs=1e-9)
    assert jerk(seconds**3) == pytest.approx(6, rel=1e-6)


@pytest.fixture(scope="module")
def still(tmp_path_factory):
    """A generator that holds the last pose, and an adapter of step_back that changes nothing."""
    folder = tmp_path_factory.mktemp("still")
    rest = pose.rest_pose(5)
    state = torch.from_numpy(pose.encode(rest)[-1]).float()
    start = torch.from_numpy(rest.root).float(), torch.from_numpy(rest.rotations).float()
    model = DiT(ModelConfig(32, 1, 4, prediction="clean"))
    save_base(folder / "base.safetensors", model, Normaliser(state, torch.full((219,), 0.1)), start, Card())
    base = load_base(folder / "base.safetensors")
    path = folder / "step_back" / "adapter.safetensors"
    save_adapter(
        path, Adapter(base.model, AdapterConfig("step_back", "mlp", ("z",), (0.25,), (0.2,))), base.digest, Card()
    )
    return DiTGenerator(base, Solver("midpoint", 2)), path


def test_a_body_that_does_nothing_achieves_nothing(still):
    generator, path = still
    (row,) = fidelity(generator, {"step_back": path}, rollouts=4)
    assert row.ratio == pytest.approx(0, abs=1e-3)
    assert row.error == pytest.approx(25, abs=8)
    assert row.skate == pytest.approx(0, abs=0.1)
    assert "| step_back | 0.000 ± 0.000 | - |" in markdown([row]).replace("-0.000", "0.000")


def test_commands_stay_in_the_range_of_the_data_and_away_from_nothing(still):
    command = Command.of("step_back", still[1])
    values = command.draw(500, np.random.default_rng(0))
    assert values.min() >= 0.25 * (0.25 + 0.9 * 0.2) - 1e-9
    assert values.max() <= 0.25 + 0.9 * 0.2


def test_data_achieves_what_its_parameters_say():
    rest = pose.rest_pose(20)
    root = rest.root[None] + np.outer(np.clip(np.arange(20) - 4, 0, None) / 15, [0, 0, -0.3])[None]
    row = reference("step_back", Chunks.of("step_back", root, rest.rotations[None], "made", real=False))
    assert row.ratio == pytest.approx(1)
    assert row.error == pytest.approx(0, abs=1e-5)


def test_the_command_line_prints_one_row_a_skill(still, capsys):
    folder = still[1].parent.parent
    arguments = ["--adapters", str(folder), "--base", str(folder / "base.safetensors"), "--rollouts", "2"]
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    assert "| step_back |" in printed
    assert "ms a chunk" in printed
    assert main([*arguments, "--skills", "fly"]) == 2
