import hashlib
import os
import subprocess
import sys

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits
from tiny_motion import write_adapter

from humanclaw.body import Motion, Pose2D, encode, rest_pose
from humanclaw.errors import CheckpointError, HumanclawError
from humanclaw.motion import AdapterConfig, DiTGenerator, MotionProfile, Solver
from humanclaw.motion.runtime import reread

AHEAD = {"x": 0.0, "z": 0.4, "yaw": 0.0}
TURNING = {"x": 0.0, "z": 0.1, "yaw": 0.3}


@pytest.fixture(scope="module")
def generator(base):
    return DiTGenerator(base, MotionProfile(Solver("midpoint", 2)))


def _same(motion: Motion, other: Motion, tolerance: float = 0.0) -> bool:
    near = (np.abs(motion.root - other.root).max(), np.abs(motion.rotations - other.rotations).max())
    return max(near) <= tolerance


def test_five_frames_are_continued_by_fifteen(generator, walk_file):
    future = generator.generate(generator.start(), walk_file, AHEAD, (0,))
    assert len(generator.start()) == 5
    assert future.root.shape == (15, 3)
    assert future.rotations.shape == (15, 24, 3)


def test_the_same_key_gives_the_same_motion_bit_for_bit(generator, walk_file, swaying):
    first, again, other = (generator.generate(swaying, walk_file, AHEAD, key) for key in ((1, 2), (1, 2), (1, 3)))
    assert _same(first, again)
    assert not _same(first, other)


def test_an_untrained_adapter_moves_as_the_base_does_bit_for_bit(generator, untrained_file, swaying):
    alone, adapted = (
        generator.generate(swaying, path, values, (4,)) for path, values in ((None, {}), (untrained_file, AHEAD))
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
    histories, values, keys = [swaying, generator.start()], [AHEAD, TURNING], [(1,), (2,)]
    together = generator.generate_batch(histories, walk_file, values, keys)
    for index, motion in enumerate(together):
        assert _same(motion, generator.generate(histories[index], walk_file, values[index], keys[index]), 1e-4)


def test_generating_leaves_numpys_threads_and_randomness_alone(generator, walk_file, swaying):
    state = np.random.get_state()[1].copy()
    with threadpool_limits(2, user_api="blas"):
        before = threadpool_info()
        generator.generate(swaying, walk_file, AHEAD, (1,))
        assert threadpool_info() == before
    assert np.array_equal(np.random.get_state()[1], state)


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_the_motion_is_the_same_with_any_number_of_threads(generator, walk_file, swaying, threads):
    once = generator.generate(swaying, walk_file, AHEAD, (1,))
    with threadpool_limits(threads, user_api="blas"):
        assert _same(generator.generate(swaying, walk_file, AHEAD, (1,)), once)


@pytest.mark.integration
def test_another_process_generates_the_same_bits(generator, base_file, walk_file):
    here = generator.generate(generator.start(), walk_file, AHEAD, (1,)).rotations.tobytes()
    script = (
        "import hashlib, sys; from pathlib import Path; from humanclaw.motion.checkpoint import load_base;"
        "from humanclaw.motion import DiTGenerator, MotionProfile, Solver;"
        "generator = DiTGenerator(load_base(Path(sys.argv[1])), MotionProfile(Solver('midpoint', 2)));"
        f"motion = generator.generate(generator.start(), Path(sys.argv[2]), {AHEAD}, (1,));"
        "print(hashlib.sha256(motion.rotations.tobytes()).hexdigest())"
    )
    there = subprocess.run(
        [sys.executable, "-c", script, str(base_file), str(walk_file)], capture_output=True, text=True, check=True
    )
    assert there.stdout.strip() == hashlib.sha256(here).hexdigest()


def test_an_adapter_that_was_trained_again_is_read_again(base, generator, swaying, tmp_path):
    path = tmp_path / "adapter.safetensors"
    write_adapter(path, base, AdapterConfig("stop", "token"), seed=3)
    before = generator.generate(swaying, path, {}, (1,))
    write_adapter(path, base, AdapterConfig("stop", "token"), seed=4)
    os.utime(path, ns=(1, 1))
    assert not _same(before, generator.generate(swaying, path, {}, (1,)))


def test_other_names_than_the_headers_are_refused(generator, walk_file):
    with pytest.raises(CheckpointError, match=r"walk takes x, z, yaw; it got h"):
        generator.generate(generator.start(), walk_file, {"h": 0.4}, (0,))


def test_a_missing_adapter_is_an_error_with_its_remedy(generator, tmp_path):
    with pytest.raises(CheckpointError, match="humanclaw train adapter"):
        generator.generate(generator.start(), tmp_path / "walk" / "adapter.safetensors", AHEAD, (0,))


def test_a_history_of_another_length_is_refused(generator, walk_file):
    with pytest.raises(ValueError, match="5 frames; got 4"):
        generator.generate(generator.start()[1:], walk_file, AHEAD, (0,))


def test_an_unknown_profile_names_the_known_ones():
    with pytest.raises(HumanclawError, match="default, paper"):
        DiTGenerator.load(profile="fast")


def test_files_are_read_again_when_they_change(tmp_path):
    read: list[str] = []
    files = [tmp_path / str(number) for number in range(6)]
    for file in files:
        file.write_text("")
    kept = reread(lambda path: read.append(path.name))
    for file in (files[0], files[0], *files[1:5], files[0], files[5], files[0], files[1]):
        kept(file)
    assert read == [*"012345", "1"], "the one that was used longest ago is read again"
    os.utime(files[0], ns=(0, 0))
    kept(files[0])
    assert read[-1] == "0"


def test_the_velocity_of_the_first_frame_is_that_of_the_second():
    """The last 72 numbers of a state: 24 joints that all glide ahead by 1 cm a frame."""
    gliding = Motion(rest_pose(3).root + np.outer(np.arange(3), [0.0, 0.0, 0.01]), rest_pose(3).rotations)
    assert encode(gliding)[:, -72:] == pytest.approx(np.tile([0.0, 0.0, 0.01], (3, 24)))
