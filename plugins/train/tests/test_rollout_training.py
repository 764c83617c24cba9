"""Tests of rollout training: histories that the model itself leaves."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from humanclaw.body import rest_pose
from humanclaw_train import train
from humanclaw_train.data.rollout_training import OwnHistories, predecessors
from humanclaw_train.data.tensors import ChunkTensors
from humanclaw_train.model import kinematics
from humanclaw_train.train import seeded

STEP = 0.02
"""Metres a frame of gliding bodies."""


def gliding(count: int) -> ChunkTensors:
    """Chunks of a body that glides ahead. Each goes on from the one before, but the third, whose hands are up."""
    rest = rest_pose(20)
    root = np.repeat(rest.root[None], count, 0)
    root[:, :, 2] = STEP * (np.arange(20) - 4)
    rotations = np.repeat(rest.rotations[None], count, 0)
    rotations[2:3, :, 16] = 0.0
    tensors = (torch.tensor(part, dtype=torch.float32) for part in (root, rotations, np.full((count, 1), 15 * STEP)))
    return ChunkTensors("stroll", *tensors, {}, ("z",), ("hips.forward",))


def sinking(history, values, noise):
    """A model that glides as commanded, and sinks by 3 cm in a chunk."""
    assert torch.allclose(values, torch.tensor(15 * STEP))
    frames = torch.arange(1, 16)[None, :, None]
    root = history[:, -1:, :3] + frames * (values[:, None] / 15 * torch.tensor([0.0, 0, 1]))
    root = root - 0.03 * frames / 15 * torch.tensor([0.0, 1, 0])
    rotations = history[:, -1:, kinematics.ROTATIONS].expand(-1, 15, -1).reshape(len(root), 15, 24, 3)
    rotations = rotations.clone()
    rotations[:, :, 15, 0] += 0.1 * frames[..., 0] / 15
    return kinematics.encode(root, rotations)


def met(chunks: ChunkTensors, depth: int, seed: int = 0):
    chosen = torch.arange(len(chunks))
    own = OwnHistories(chunks, predecessors(chunks), depth, sinking)
    return own(chosen, chunks.root, chunks.rotations, seeded(torch.device("cpu"), seed))


def test_a_chunk_is_found_whose_end_is_the_history_of_another():
    assert predecessors(gliding(5)).tolist() == [-1, 0, -1, -1, 3]


def test_the_history_is_the_models_and_the_future_returns_from_it():
    chunks = gliding(2)
    nods = []
    for seed in range(8):
        root, rotations = met(chunks, 1, seed)
        assert torch.equal(rotations[0], chunks.rotations[0])
        nods.append(float(rotations[1, 4, 15, 0]))
        if nods[-1]:
            path = rotations[1, :, 15, 0]
            assert path.diff().abs().max() < 0.03
            torch.testing.assert_close(rotations[1, 15:], chunks.rotations[1, 15:], atol=0.002, rtol=0)
            torch.testing.assert_close(root[1, -1], chunks.root[1, -1], atol=0.002, rtol=0)
    # Half of the batch, by chance.
    assert sorted(set(np.round(nods, 3))) == [0.0, 0.1]


def test_errors_add_up_over_the_chunks_of_a_rollout():
    chunks = gliding(8)
    errors = {round(float(met(chunks, 3, seed)[1][7, 4, 15, 0]), 2) for seed in range(30)}
    assert errors == {0.0, 0.1, 0.2, 0.3}


def test_an_adapter_trains_on_rollouts_and_its_header_says_so(tmp_path):
    from gliding import save_chunks
    from tiny_motion import write_base

    from humanclaw.motion import read_header

    write_base(tmp_path / "base.safetensors")
    distance = np.linspace(0.05, 0.4, 8)
    save_chunks(tmp_path / "stroll.npz", -distance, distance[:, None])
    arguments = ["adapter", "stroll", "--data", str(tmp_path), "--base", str(tmp_path / "base.safetensors")]
    more = ["--out", str(tmp_path / "out"), "--steps", "2", "--batch", "4", "--device", "cpu", "--rollout", "3"]
    assert train.main(arguments + more) == 0
    assert read_header(tmp_path / "out" / "adapter.safetensors")["card"]["recipe"]["rollout"] == 3
