"""Make the pictures of pages in the documentation again: `make pictures`. Needs Chromium and playwright.

python pictures.py RUN OTHER_RUN FOLDER
"""

from __future__ import annotations

import io
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any, Final

from PIL import Image

from humanclaw import load_run

SIZES: Final = {"1400": ({"width": 1400, "height": 1000}, "light"), "390-dark": ({"width": 390, "height": 844}, "dark")}
BROWSER: Final = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


def make(run: Path, other: Path, out: Path) -> None:
    """Write pictures of the pages of a run, of both runs, and of the run's last episode."""
    from playwright.sync_api import sync_playwright

    pair = out / "pair.html"
    for arguments in ([run], [run, other, "--out", pair]):
        subprocess.run([sys.executable, "-m", "humanclaw", "report", *map(str, arguments)], check=True)
    episode = load_run(run)[-1]
    pages = {"run": run / "report.html", "pair": pair, "episode": episode.folder / "page.html"}
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=BROWSER)
        for name, page in pages.items():
            for suffix, (viewport, scheme) in SIZES.items():
                picture = _seen(browser, page, viewport, scheme, step=len(episode.steps) // 2)
                picture.save(out / f"{name}-{suffix}.jpg", quality=82)
        browser.close()
    pair.unlink()


def _seen(browser: Any, page: Path, viewport: dict[str, int], scheme: str, step: int) -> Image.Image:
    """Return a picture of a page as it stands in a window; an episode is shown at a step."""
    tab = browser.new_page(viewport=viewport, color_scheme=scheme)
    tab.goto(f"{page.resolve().as_uri()}#step={step}")
    tab.wait_for_function("document.documentElement.dataset.ready")
    tab.wait_for_timeout(1000)  # Pictures below the first screen load late.
    picture = Image.open(io.BytesIO(tab.screenshot())).convert("RGB")
    tab.close()
    return picture


if __name__ == "__main__":
    make(*map(Path, sys.argv[1:]))
