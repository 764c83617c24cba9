from collections import Counter

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from torch.utils._python_dispatch import TorchDispatchMode

from humanclaw.body import Motion, encode, support_height
from humanclaw_train.model import kinematics


def _motions(count: int = 3) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(0)
    return random.normal(size=(count, 20, 3)), random.normal(size=(count, 20, 24, 3)) * 0.5


def test_states_of_a_batch_are_those_that_numpy_computes_one_by_one():
    root, rotations = _motions()
    states = kinematics.encode(torch.from_numpy(root).float(), torch.from_numpy(rotations).float())
    expected = [encode(Motion(*pair)) for pair in zip(root, rotations, strict=True)]
    np.testing.assert_allclose(states.numpy(), expected, atol=1e-5)


def test_the_blocks_of_a_state_lie_where_decode_and_the_joints_say():
    root, rotations = _motions(1)
    motion = Motion(root[0], rotations[0])
    state = encode(motion)
    np.testing.assert_array_equal(state[:, kinematics.ROOT], motion.root)
    np.testing.assert_array_equal(state[:, kinematics.ROTATIONS].reshape(-1, 24, 3), motion.rotations)
    np.testing.assert_array_equal(state[:, kinematics.POSITIONS].reshape(-1, 24, 3), motion.joints())
    np.testing.assert_array_equal(state[1:, kinematics.VELOCITIES].reshape(-1, 24, 3), np.diff(motion.joints(), axis=0))


def test_the_lowest_sole_is_found():
    root, rotations = _motions()
    joints = kinematics.joints(torch.from_numpy(root), torch.from_numpy(rotations).double())
    height = kinematics.support_height(joints)
    np.testing.assert_allclose(height.numpy(), support_height(joints.numpy()), atol=1e-6)


def test_the_gradient_at_no_rotation_is_finite():
    rotations = torch.zeros(1, 24, 3, requires_grad=True)
    kinematics.joints(torch.zeros(1, 3), rotations).square().sum().backward()
    assert rotations.grad is not None
    assert torch.isfinite(rotations.grad).all()


class _Operations(TorchDispatchMode):
    """Counts operations by name."""

    def __init__(self) -> None:
        super().__init__()
        self.found = Counter()

    def __torch_dispatch__(self, function, types, args=(), kwargs=None):
        self.found[str(function)] += 1
        return function(*args, **(kwargs or {}))


def test_joints_are_computed_with_at_most_one_copy_to_the_device():
    # A list of numbers as an index becomes a tensor on the CPU (lift_fresh); a GPU copies it and waits.
    root, rotations = (torch.from_numpy(part).float() for part in _motions())
    with _Operations() as operations:
        kinematics.joints(root, rotations)
    assert operations.found["aten.bmm.default"] > 0
    assert operations.found["aten.lift_fresh.default"] <= 1
    assert operations.found["aten.index.Tensor"] == 0
