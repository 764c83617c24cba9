"""Tests that episodes move the same with the model on torch as in numpy, within a tenth of a millimetre."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from tiny_motion import WALK, write_adapter, write_base

from humanclaw import Backends, Body
from humanclaw.motion import SIZES, DiTGenerator
from humanclaw.world import SceneBuilder
from humanclaw_train.model.generator import torch_generator

AHEAD = {"x": 0.05, "z": 0.4, "yaw": 0.1}


def _difference(motion, other) -> float:
    return max(np.abs(motion.root - other.root).max(), np.abs(motion.rotations - other.rotations).max())


@pytest.mark.parametrize("name", ["walk", "turn_in_place", "stop", "climb_upstairs"])
@pytest.mark.parametrize("profile", ["default", pytest.param("paper", marks=pytest.mark.integration)])
def test_shipped_skills_move_as_in_numpy(plugins, name, profile):
    skill = plugins.skill(name)
    values = {parameter.name: (parameter.low + parameter.high) / 2 for parameter in skill.parameters}
    motions = []
    for generator in (plugins.make("motion_generators", which, profile=profile) for which in ("dit", "torch")):
        motion = generator.start()
        for call in range(2):
            motion = motion.then(generator.generate(motion[len(motion) - 5 :], skill.adapter, values, (1, call)))
        motions.append(motion)
    assert _difference(*motions) < 1e-4


@pytest.mark.integration
@pytest.mark.parametrize("device", ["cpu", "cuda"])
def test_a_base_of_the_papers_size_moves_as_in_numpy(tmp_path, device):
    if device == "cuda" and not torch.cuda.is_available():
        pytest.skip("no GPU")
    path = tmp_path / "base.safetensors"
    base = write_base(path, SIZES["paper"], scale=0.02)
    adapter = write_adapter(tmp_path / "walk.safetensors", base, WALK, scale=0.02)
    reference, other = DiTGenerator.load(path, "paper"), torch_generator("paper", path, device)
    motions = [generator.generate(generator.start(), adapter, AHEAD, (7,)) for generator in (reference, other)]
    assert np.abs(motions[0].root - reference.start().root[-1]).max() > 0.01
    assert _difference(*motions) < 1e-4
    assert reference.digest == other.digest


def test_an_episode_on_torch_walks_where_one_in_numpy_walks(plugins):
    builder = SceneBuilder.on_floor()
    ends = []
    for name in ("dit", "torch"):
        with Body(builder.scene(), plugins=plugins, backends=Backends(generator=name)) as body:
            for _ in range(3):
                body.call("walk", z_cm=50)
            ends.append(body.history.root[-1])
    assert np.abs(ends[1] - ends[0]).max() < 1e-3
    assert ends[0][2] - builder.scene().start.z > 1.0
