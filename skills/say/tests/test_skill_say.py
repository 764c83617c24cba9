"""What the package is held to."""

import pytest

from humanclaw import CallError
from humanclaw.testing import check_skill
from humanclaw_skill_say import say


def test_the_skill_keeps_the_contract():
    check_skill(say, engines=())


@pytest.mark.parametrize("text", [" ", "\n\t\u2028"])
def test_a_blank_speech_is_refused(text):
    with pytest.raises(CallError, match="text is blank"):
        say.check({"text": text})


def test_a_speech_of_a_megabyte_is_refused():
    with pytest.raises(CallError, match="Call say with"):
        say.check({"text": "a" * (1 << 20)})
