"""Tests of the page in a real browser: arrow keys, buttons and form, and no serious accessibility fault.

Run them with `make pages`.
"""

import queue

import numpy as np
import pytest
from browser import barriers, browsing, looks, opened, slow

from humanclaw import Call, Plugins
from humanclaw_human.commands import forms, keys, read
from humanclaw_human.window import Controls, PageServer, PageState

pytestmark = slow
PICTURE = np.full((64, 64, 3), 90, np.uint8)


@pytest.fixture
def decisions():
    return queue.Queue()


@pytest.fixture
def window(decisions):
    skills = Plugins.discover().skills
    window = PageServer(
        0,
        decisions.put,
        lambda call: read(call, skills),
        Controls(keys(skills), forms(skills)),
    )
    yield window
    window.close()


@looks
def test_keys_buttons_and_the_form_are_calls_until_the_replay(window, decisions, tmp_path, size, scheme):
    with browsing() as browser:
        tab, errors = opened(browser, window.address, size, scheme)

        def shown(step):
            window.show(PICTURE, PageState(step, 9, "Find a couch.", "You walked.", (("stop()", "no"),)))
            tab.wait_for_function(f"document.getElementById('step').textContent === 'Step {step} of 9'")

        shown(0)
        tab.keyboard.press("ArrowUp")
        assert decisions.get(timeout=5).calls == (Call("walk", {"x_cm": 0, "z_cm": 40, "yaw_deg": 0}),)
        shown(1)
        tab.fill("#seen", "a couch")
        tab.get_by_role("button", name="sit down", exact=True).wait_for()  # And not "ssit down", with its key.
        tab.locator("#keys button", has_text="turn left").first.click()
        assert decisions.get(timeout=5).visible_state == "a couch"
        shown(2)
        tab.get_by_text("Call any skill").click()
        tab.select_option("#skill", "sit_in_place")
        tab.fill("#parameters input", "50")
        tab.get_by_text("Call it").click()
        assert decisions.get(timeout=5).calls == (Call("sit_in_place", {"h_cm": 50}),)
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


def test_two_pages_of_one_episode_make_one_call_at_a_time(window, decisions):
    with browsing() as browser:
        page, other = (opened(browser, window.address)[0] for _ in range(2))
        for step in (0, 1):
            window.show(PICTURE, PageState(step, 9, "Find a couch."))
            for tab in (page, other):
                tab.wait_for_function(f"document.getElementById('step').textContent === 'Step {step} of 9'")
            page.keyboard.press("S")  # As with Caps Lock.
            assert decisions.get(timeout=5).calls[0].skill == "sit_in_place"
            other.keyboard.press("ArrowUp")
            other.wait_for_function("document.getElementById('hint').textContent === 'The body still moves.'")
        assert decisions.empty()
