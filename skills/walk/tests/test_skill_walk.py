"""What every skill package is held to."""

from pathlib import Path

import pytest

import humanclaw_skill_walk
from humanclaw import Skill
from humanclaw.testing import check_skill

FOLDER = Path(humanclaw_skill_walk.__file__).parent


@pytest.mark.parametrize("name", ["walk"])
def test_the_skill_keeps_the_contract(name):
    if not Skill.from_folder(FOLDER / name).trained:
        pytest.skip("its adapter is still to be trained")
    check_skill(FOLDER / name)
