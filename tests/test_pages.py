"""The site in a browser: no serious barrier, and its search finds the pages. `make pages`."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
from browser import barriers, browsing, looks, opened, slow

pytestmark = slow
ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with browsing() as started:
        yield started


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Build the site and serve it: its search works over HTTP alone."""
    home = tmp_path_factory.mktemp("site")
    # Beside the versions, as mike writes it.
    (home / "versions.json").write_text('[{"version": "dev", "title": "dev", "aliases": []}]')
    folder = home / "dev"
    subprocess.run([sys.executable, "-m", "mkdocs", "build", "--quiet", "--site-dir", folder], cwd=ROOT, check=True)
    serving = ThreadingHTTPServer(("127.0.0.1", 0), partial(SimpleHTTPRequestHandler, directory=home))
    threading.Thread(target=serving.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{serving.server_port}/dev/"
    serving.shutdown()


@looks
@pytest.mark.parametrize("page", ["", "tutorial/", "results/benchmark/"])
def test_a_page_of_the_site_has_no_serious_barrier(
    browser: Any, site: str, page: str, size: dict[str, int], scheme: str
) -> None:
    tab, errors = opened(browser, site + page, size, scheme, ready="document.readyState == 'complete'")
    assert not barriers(tab)
    assert not errors


@pytest.mark.parametrize(
    ("words", "page"), [("crouch", "hands/"), ("GeoNavSR", "benchmark/"), ("humanclaw_chunk", "hooks/")]
)
def test_the_search_of_the_site_leads_to_a_page(browser: Any, site: str, words: str, page: str) -> None:
    tab, errors = opened(browser, site, ready="document.readyState == 'complete'")
    tab.keyboard.press("/")
    tab.keyboard.type(words)
    tab.locator(f".md-search-result a[href*='{page}']").first.wait_for()
    assert not errors
