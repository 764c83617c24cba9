"""Pages in a real browser: `make pages`. They need playwright, and its Chromium or one on the path."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import product
from pathlib import Path
from typing import Any

import pytest

SOFTWARE = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PHONE, DESK = {"width": 390, "height": 844}, {"width": 1400, "height": 1000}
looks = pytest.mark.parametrize(("size", "scheme"), list(product((PHONE, DESK), ("light", "dark"))))
slow = pytest.mark.evidence


@contextmanager
def browsing() -> Iterator[Any]:
    """Start Chromium: the one on the path, or else playwright's."""
    path = next(filter(None, map(shutil.which, ("chromium", "google-chrome", "chrome"))), None)
    with pytest.importorskip("playwright.sync_api").sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=path, args=SOFTWARE)


def opened(
    browser: Any, page: Path | str, size: dict[str, int] = DESK, scheme: str = "light", measured: bool = False,
    ready: str = "document.documentElement.dataset.ready",
) -> tuple[Any, list[str]]:  # fmt: skip
    """Open a page; return it once it is ready, with a list of its errors. measured: count its main thread's time."""
    tab, errors = browser.new_page(viewport=size, color_scheme=scheme), []
    tab.on("pageerror", lambda error: errors.append(str(error)))
    tab.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    tab.set_default_timeout(120_000)
    if measured:
        tab.measuring = tab.context.new_cdp_session(tab)
        tab.measuring.send("Performance.enable", {"timeDomain": "threadTicks"})
    tab.goto(page if isinstance(page, str) else page.as_uri())
    tab.wait_for_function(ready)
    return tab, errors


def barriers(tab: Any) -> list[Any]:
    """Return the serious accessibility faults of a page, and what is wider than its window."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    violations = axe.run(tab).response["violations"]
    wide = tab.evaluate("document.documentElement.scrollWidth - innerWidth")
    return [
        (violation["id"], [node["html"][:90] for node in violation["nodes"][:3]])
        for violation in violations
        if violation["impact"] in ("serious", "critical")
    ] + [("wide", wide)] * (wide > 0)
