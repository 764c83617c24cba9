import os

import numpy as np
import pytest
import torch

from humanclaw.errors import CheckpointError, HumanclawError
from humanclaw.motion.checkpoint import Card, save_adapter
from humanclaw.motion.control import Adapter, AdapterConfig
from humanclaw.motion.flow import Solver
from humanclaw.motion.generator import DiTGenerator
from humanclaw.pose import Motion, Pose2D

AHEAD = (0.0, 0.4, 0.0)


@pytest.fixture(scope="module")
def generator(base):
    return DiTGenerator(base, Solver("midpoint", 2))


def _same(one: Motion, other: Motion, tolerance: float = 0.0) -> bool:
    near = (np.abs(one.root - other.root).max(), np.abs(one.rotations - other.rotations).max())
    return max(near) <= tolerance


def test_five_frames_are_continued_by_fifteen(generator, walk_file):
    future = generator.generate(generator.start(), walk_file, AHEAD, (0,))
    assert len(generator.start()) == 5
    assert future.root.shape == (15, 3)
    assert future.rotations.shape == (15, 24, 3)


def test_the_same_key_gives_the_same_motion_bit_for_bit_and_another_key_another(generator, walk_file, swaying):
    first, again, other = (generator.generate(swaying, walk_file, AHEAD, key) for key in ((1, 2), (1, 2), (1, 3)))
    assert _same(first, again)
    assert not _same(first, other)


def test_an_untrained_adapter_moves_as_the_base_does_bit_for_bit(generator, untrained_file, swaying):
    alone, adapted = (
        generator.generate(swaying, path, values, (4,)) for path, values in ((None, ()), (untrained_file, AHEAD))
    )
    assert _same(alone, adapted)


def test_motion_does_not_depend_on_where_in_the_world_the_body_is(generator, walk_file, swaying):
    away = Pose2D(3.0, -7.0, 2.5, 1.5)
    here = generator.generate(swaying, walk_file, AHEAD, (1,))
    there = generator.generate(away.to_world(swaying), walk_file, AHEAD, (1,))
    back = away.to_local(there)
    assert np.abs(back.root - here.root).max() < 1e-4
    assert np.abs(back.joints() - here.joints()).max() < 1e-4


def test_many_bodies_at_once_move_as_each_would_alone(generator, walk_file, swaying):
    histories, values, keys = [swaying, generator.start()], [AHEAD, (0.1, 0.2, 0.3)], [(1,), (2,)]
    together = generator.generate_batch(histories, walk_file, values, keys)
    for index, motion in enumerate(together):
        assert _same(motion, generator.generate(histories[index], walk_file, values[index], keys[index]), 1e-4)


def test_parameters_change_the_motion(generator, walk_file, swaying):
    motions = [generator.generate(swaying, walk_file, values, (1,)) for values in (AHEAD, (0.0, 0.1, 0.3))]
    assert not _same(*motions)


def test_generating_touches_neither_torchs_threads_nor_its_random_numbers(generator, walk_file, swaying):
    threads, state = torch.get_num_threads(), torch.get_rng_state()
    generator.generate(swaying, walk_file, AHEAD, (1,))
    assert torch.get_num_threads() == threads
    assert torch.equal(torch.get_rng_state(), state)


def test_an_adapter_that_was_trained_again_is_read_again(base, generator, swaying, tmp_path):
    path = tmp_path / "adapter.safetensors"
    config = AdapterConfig("stop", "token")
    adapter = Adapter(base.model, config)
    save_adapter(path, adapter, base.digest, Card())
    before = generator.generate(swaying, path, (), (1,))
    with torch.no_grad():
        adapter.weights[0].weight.add_(0.1)
    save_adapter(path, adapter, base.digest, Card())
    os.utime(path, ns=(1, 1))
    assert not _same(before, generator.generate(swaying, path, (), (1,)))


def test_a_wrong_number_of_values_is_refused_with_the_names_that_are_expected(generator, walk_file):
    with pytest.raises(CheckpointError, match=r"walk takes 3 values \(x, z, yaw\); it got 1"):
        generator.generate(generator.start(), walk_file, (0.4,), (0,))


def test_a_missing_adapter_is_an_error_with_its_remedy(generator, tmp_path):
    with pytest.raises(CheckpointError, match="humanclaw train adapter"):
        generator.generate(generator.start(), tmp_path / "walk" / "adapter.safetensors", AHEAD, (0,))


def test_a_history_of_another_length_is_refused(generator, walk_file):
    with pytest.raises(ValueError, match="5 frames; got 4"):
        generator.generate(generator.start()[1:], walk_file, AHEAD, (0,))


def test_an_unknown_profile_names_the_known_ones():
    with pytest.raises(HumanclawError, match="default, paper"):
        DiTGenerator.shipped("fast")
