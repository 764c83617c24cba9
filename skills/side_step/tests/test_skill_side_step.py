"""What every skill package is held to."""

from pathlib import Path

import humanclaw_skill_side_step
from humanclaw.testing import check_skill


def test_the_skill_keeps_the_contract():
    check_skill(Path(humanclaw_skill_side_step.__file__).parent / "side_step")
