"""What the package is held to; plugins/bench/tests/test_hands_split.py plays it in an episode."""

from humanclaw.testing import check_skill
from humanclaw_skill_answer import answer


def test_the_skill_keeps_the_contract():
    check_skill(answer, engines=())
