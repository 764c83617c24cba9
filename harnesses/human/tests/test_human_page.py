"""Tests of the page in a real browser: arrow keys, buttons and form, and no serious accessibility fault.

Run them with `make pages`.
"""

import queue

import numpy as np
import pytest
from browser import barriers, browsing, looks, opened, slow

from humanclaw import Plugins
from humanclaw_human.commands import forms, in_words, keys, parse
from humanclaw_human.window import Controls, PageServer, PageState

pytestmark = slow
PICTURE = np.full((64, 64, 3), 90, np.uint8)


@pytest.fixture
def lines():
    return queue.Queue()


@pytest.fixture
def window(lines):
    skills = Plugins.discover().skills
    window = PageServer(
        0,
        lines.put,
        lambda line: parse(line, skills),
        Controls(keys(skills), in_words(keys(skills), skills), forms(skills)),
    )
    yield window
    window.close()


@looks
def test_keys_buttons_and_the_form_are_calls_until_the_replay(window, lines, tmp_path, size, scheme):
    with browsing() as browser:
        tab, errors = opened(browser, window.address, size, scheme)

        def shown(step):
            window.show(PICTURE, PageState(step, 9, "Find a couch.", "You walked.", (("stop()", "no"),)))
            tab.wait_for_function(f"document.getElementById('step').textContent === 'Step {step} of 9'")

        shown(0)
        tab.keyboard.press("ArrowUp")
        assert lines.get(timeout=5) == "walk 0 40 0"
        shown(1)
        tab.fill("#seen", "a couch")
        tab.get_by_role("button", name="sit down", exact=True).wait_for()  # And not "ssit down", with its key.
        tab.locator("#keys button", has_text="turn left").first.click()
        assert lines.get(timeout=5).endswith("# a couch")
        shown(2)
        tab.get_by_text("Any call").click()
        tab.select_option("#skill", "sit_in_place")
        tab.fill("#parameters input", "50")
        tab.get_by_text("Call it").click()
        assert lines.get(timeout=5) == "sit_in_place 50"
        assert not barriers(tab)
        assert not errors
        window.end("stopped after 3 steps.", tmp_path / "report.html")
        tab.wait_for_function("document.getElementById('step').textContent === 'The episode has ended.'")
        tab.keyboard.press("ArrowUp")
        assert tab.text_content("#step") == "The episode has ended."
        assert tab.text_content("#feedback") == "stopped after 3 steps."
        assert tab.locator("#keys").is_hidden()
        (tmp_path / "report.html").write_text("<title>The replay</title>")
        tab.locator("#hint a").wait_for()
        window.close()
        with tab.context.expect_page() as leading:
            tab.click("#hint a")
        assert leading.value.title() == "The replay", "also when the server has ended"


def test_two_pages_of_one_episode_make_one_call_at_a_time(window, lines):
    with browsing() as browser:
        one, other = (opened(browser, window.address)[0] for _ in range(2))
        for step in (0, 1):
            window.show(PICTURE, PageState(step, 9, "Find a couch."))
            for tab in (one, other):
                tab.wait_for_function(f"document.getElementById('step').textContent === 'Step {step} of 9'")
            one.keyboard.press("S")  # As with Caps Lock.
            assert lines.get(timeout=5).startswith("sit_in_place")
            other.keyboard.press("ArrowUp")
            other.wait_for_function("document.getElementById('hint').textContent === 'The body still moves.'")
        assert lines.empty()
