"""What every skill package is held to."""

from pathlib import Path

import pytest

import humanclaw_skill_climb
from humanclaw.testing import check_skill


@pytest.mark.parametrize("name", ["climb_upstairs", "walk_downstairs"])
def test_the_skill_keeps_the_contract(name):
    check_skill(Path(humanclaw_skill_climb.__file__).parent / name)
