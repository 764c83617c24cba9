"""Tests of the page in a real browser: arrow keys, buttons and form, and no serious accessibility fault.

They are slow and need Chromium and playwright. Run them with HUMANCLAW_SLOW=1.
"""

import os
import queue
import shutil

import numpy as np
import pytest

from humanclaw import Plugins
from humanclaw_human.commands import forms, in_words, keys, parse
from humanclaw_human.window import Controls, Moment, Window

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "google-chrome", "chrome"))), None)
pytestmark = pytest.mark.skipif(
    not (os.environ.get("HUMANCLAW_SLOW") and CHROMIUM), reason="starts a browser: HUMANCLAW_SLOW=1, and Chromium"
)
PICTURE = np.full((64, 64, 3), 90, np.uint8)


@pytest.fixture
def lines():
    return queue.Queue()


@pytest.fixture
def window(lines):
    skills = Plugins.discover().skills
    window = Window(
        0,
        lines.put,
        lambda line: parse(line, skills),
        Controls(keys(skills), in_words(keys(skills), skills), forms(skills)),
    )
    yield window
    window.close()


@pytest.mark.parametrize(("width", "scheme"), [(390, "dark"), (1400, "light")])
def test_keys_buttons_and_the_form_are_calls_until_the_replay(window, lines, tmp_path, width, scheme):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    with pytest.importorskip("playwright.sync_api").sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        tab, errors = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme), []
        tab.on("pageerror", lambda error: errors.append(str(error)))

        def shown(step):
            window.show(PICTURE, Moment(step, 9, "Find a couch.", "You walked.", (("stop()", "no"),)))
            tab.wait_for_function(f"document.getElementById('step').textContent === 'Step {step} of 9'")

        tab.goto(window.address)
        shown(0)
        tab.keyboard.press("ArrowUp")
        assert lines.get(timeout=5) == "walk 0 40 0"
        shown(1)
        tab.fill("#seen", "a couch")
        tab.locator("#keys button", has_text="turn left").first.click()
        assert lines.get(timeout=5).endswith("# a couch")
        shown(2)
        tab.get_by_text("Any call").click()
        tab.select_option("#skill", "sit_in_place")
        tab.fill("#parameters input", "50")
        tab.get_by_text("Call it").click()
        assert lines.get(timeout=5) == "sit_in_place 50"
        assert tab.evaluate("document.documentElement.scrollWidth") <= width
        serious = [one["id"] for one in axe.run(tab).response["violations"] if one["impact"] in ("serious", "critical")]
        assert not serious
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
        with tab.context.expect_page() as opened:
            tab.click("#hint a")
        assert opened.value.title() == "The replay", "also when the server has ended"
        browser.close()
