"""What every skill is held to, and what this one does."""

import numpy as np

from humanclaw import Plugins
from humanclaw.pose import rest_pose
from humanclaw.testing import check_skill
from humanclaw_example import example_call


def test_the_skill_keeps_the_contract():
    check_skill(example_call)


def test_the_body_moves_and_ends_as_it_began():
    played = example_call.plan(example_call.check({"times": 2})).over(rest_pose())
    assert len(played) == 60
    assert np.abs(played.rotations[15] - rest_pose().rotations[0]).max() > 0.5
    assert np.allclose(played.rotations[-1], rest_pose().rotations[0])


def test_it_is_found_once_it_is_installed():
    assert Plugins.discover().skill("example_call").trained
