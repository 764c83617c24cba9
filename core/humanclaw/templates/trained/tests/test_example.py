"""What every skill package is held to."""

from pathlib import Path

import pytest

import humanclaw_example
from humanclaw.testing import check_skill

FOLDER = Path(humanclaw_example.__file__).parent


@pytest.mark.parametrize("name", ["example_call"])
def test_the_skill_keeps_the_contract(name):
    check_skill(FOLDER / name)
