"""What every skill package is held to."""

from pathlib import Path

import pytest

import humanclaw_skill_squat
from humanclaw.testing import check_skill

FOLDER = Path(humanclaw_skill_squat.__file__).parent


@pytest.mark.parametrize("name", ["squat"])
def test_the_skill_keeps_the_contract(name):
    check_skill(FOLDER / name)
