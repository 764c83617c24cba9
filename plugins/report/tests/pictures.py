"""Make the pictures of pages in the documentation again: `make pictures`. Needs Chromium and playwright.

python pictures.py RUN OTHER_RUN FOLDER [CHECKED]

With CHECKED, a folder of pictures, fail if one of them no longer looks like the page.
"""

from __future__ import annotations

import io
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
from browser import browsing
from PIL import Image, ImageOps

from humanclaw import load_run

SIZES: Final = {"1400": ({"width": 1400, "height": 1000}, "light"), "390-dark": ({"width": 390, "height": 844}, "dark")}
ALIKE: Final = 10.0
"""Most mean difference of two pictures of 32 by 24, of 255. Measured: the same run 0 to 7, a page without content 13 or
more, another house 21 or more."""
SHOWN: Final = "bed", "couch", "toilet", "tv"
"""Targets of the replays that docs/index.md shows; of the chair, the body hides too much."""
ROOM: Final = {"toilet": (0.02, 0.08, 0.65, 0.71)}
"""Part of a replay's picture that shows the room, as shares from the left and the top; outside it is sky."""
FONTS: Final = ":root, body { --serif: 'DejaVu Serif'; --sans: 'DejaVu Sans'; font-family: 'DejaVu Sans'; }"
"""Style of every picture: other fonts break lines elsewhere, and everything below moves."""


def make(run: Path, other: Path, out: Path) -> None:
    """Write pictures of the pages of the other run, of both runs, and of the run's last episode, of the end of those
    of its episodes that are SHOWN, and of a leaderboard of both runs."""
    pair = out / "pair.html"
    for arguments in ([run], [other], [run, other, "--out", pair]):
        _do("report", *arguments)
    episodes = load_run(run)
    episode = episodes[-1]
    pages = {"run": other / "report.html", "pair": pair, "episode": episode.folder / "page.html"}
    with browsing() as browser:
        for name, page in pages.items():
            for suffix, (viewport, scheme) in SIZES.items():
                picture = _seen(browser, page, viewport, scheme, step=len(episode.steps) // 2)
                picture.save(out / f"{name}-{suffix}.jpg", quality=82)
        for recorded in (item for item in episodes if item.record.spec.target_category in SHOWN):
            page, last = recorded.folder / "page.html", len(recorded.steps) - 1
            picture = _seen(browser, page, {"width": 1000, "height": 1200}, "light", last, part="#stage")
            target = recorded.record.spec.target_category
            size, shares = np.array([*picture.size] * 2), np.array(ROOM.get(target, (0.0, 0.0, 1.0, 1.0)))
            picture = picture.crop(tuple((size * shares).astype(int).tolist()))
            picture = ImageOps.contain(picture, (480, 480))
            picture.save(out / f"replay-{target}.jpg", quality=82)
        for name, picture in {"human": _person(browser), "leaderboard": _board(browser, run, other)}.items():
            picture.save(out / f"{name}-1400.jpg", quality=82)
    pair.unlink()


def _do(*arguments: object) -> None:
    subprocess.run([sys.executable, "-m", "humanclaw", *map(str, arguments)], check=True)


def _board(browser: Any, *runs: Path) -> Image.Image:
    """Return a picture of a leaderboard of runs, of which one episode each is played again."""
    with TemporaryDirectory() as folder:
        sent, site = Path(folder, "sent"), Path(folder, "site")
        for run in runs:
            shutil.copytree(run, sent / run.name)
            _do("bench", "submit", sent / run.name, "--who", "HumanCLAW")
        _do("bench", "leaderboard", sent, "--pages", site, "--replay", 1, "--by", "HumanCLAW")
        tab = browser.new_page(viewport={"width": 1400, "height": 640})
        tab.goto((site / "index.html").as_uri())
        return _taken(tab)


def _person(browser: Any) -> Image.Image:
    """Return a picture of the page of a person who decides, after two steps."""
    with TemporaryDirectory() as folder:
        words = ["run", "--agent", "human", "--instruction", "find a couch and sit on it", "--option", "browser=false"]
        playing = subprocess.Popen(
            [sys.executable, "-m", "humanclaw", *words, "--film", "none", "--out", f"{folder}/run"],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert playing.stdout
        link = next(line for line in playing.stdout if "Open the view: " in line).split(": ", 1)[1].strip()
        tab = browser.new_page(viewport={"width": 1400, "height": 900})
        tab.goto(Path(link).as_uri())
        for step, key in enumerate(("ArrowUp", "ArrowUp", "End")):
            tab.wait_for_function(f"document.getElementById('step').textContent.startsWith('Step {step} of')")
            tab.wait_for_timeout(1000)  # The half second that led here is shown first.
            if key == "End":
                picture = _taken(tab)
            tab.keyboard.press(key)
        playing.communicate()
    return picture


def _taken(seen: Any) -> Image.Image:
    getattr(seen, "page", seen).add_style_tag(content=FONTS)
    return Image.open(io.BytesIO(seen.screenshot())).convert("RGB")


def differing(made: Path, kept: Path) -> list[str]:
    """Return the names of the pictures in `made` that look otherwise in `kept`, or are not there."""
    return [path.name for path in sorted(made.glob("*.jpg")) if _difference(path, kept / path.name) > ALIKE]


def _difference(path: Path, other: Path) -> float:
    """Return the mean difference of two pictures, of 255, once they are so small that words are grey lines."""
    if not other.exists():
        return 255.0
    small = [np.asarray(Image.open(file).convert("RGB").resize((32, 24)), float) for file in (path, other)]
    return float(np.abs(small[0] - small[1]).mean())


def _seen(
    browser: Any, page: Path, viewport: dict[str, int], scheme: str, step: int, part: str = "html"
) -> Image.Image:
    """Return a picture of a page, or a part, as it stands in a window; an episode is shown at a step."""
    tab = browser.new_page(viewport=viewport, color_scheme=scheme)
    tab.goto(f"{page.resolve().as_uri()}#step={step}")
    tab.wait_for_function("document.documentElement.dataset.ready")
    tab.wait_for_timeout(1000)  # Pictures below the first screen load late.
    picture = _taken(tab if part == "html" else tab.locator(part))
    tab.close()
    return picture


if __name__ == "__main__":
    run, other, out, *checked = map(Path, sys.argv[1:])
    out.mkdir(exist_ok=True)
    make(run, other, out)
    if names := [name for kept in checked for name in differing(out, kept)]:
        sys.exit(f"These pictures no longer look like the pages: {', '.join(names)}. Run `make pictures`.")
