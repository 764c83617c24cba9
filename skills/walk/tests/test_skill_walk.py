"""What every skill package is held to."""

from pathlib import Path

import humanclaw_skill_walk
from humanclaw.testing import check_skill


def test_the_skill_keeps_the_contract():
    check_skill(Path(humanclaw_skill_walk.__file__).parent / "walk")
