"""Tests of the pages in a real browser: no errors, replay, filters, and no serious accessibility fault.

Run them with `make pages`.
"""

from __future__ import annotations

import copy
import shutil
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import PHONE, barriers, browsing, looks, opened, slow
from made import broken_off, picture, record_episode

from humanclaw import RecordedEpisode, load_run
from humanclaw.body import skin
from humanclaw_report.report import write_report
from humanclaw_report.run_page import Collected, run_page
from humanclaw_report.watch import Watcher, server

pytestmark = slow


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return a page of one episode, and a page of two runs of two episodes, of which one differs."""
    folder = tmp_path_factory.mktemp("pages")
    scene = record_episode(folder / "one" / "couch-0")
    for run in ("a", "b"):
        for name in ("couch-0", "couch-1"):
            record_episode(folder / run / name, name=name)

    def contribute(runs: Any, page: Any) -> None:
        for run in runs:
            page.episode(run, "couch-0", success=True, tier="easy")
            page.episode(run, "couch-1", success=run.name == "a", cause="" if run.name == "a" else "nav: too far")

    return {
        "episode": write_report(folder / "one", None, lambda name: scene),
        "runs": write_report(
            [folder / "a", folder / "b"], folder / "pair.html", lambda name: scene, contribute=contribute
        ),
    }


@dataclass
class Watched:
    """A watched run in progress."""

    folder: Path
    address: str


@pytest.fixture
def watched(tmp_path: Path) -> Iterator[Watched]:
    """Serve a run with two episodes in progress, and one that has ended."""
    for number in range(3):
        scene = record_episode(tmp_path / "run" / f"couch-{number}", name=f"couch-{number}")
    for number in (0, 1):
        broken_off(tmp_path / "run" / f"couch-{number}")
    serving = server(Watcher(tmp_path / "run", lambda name: scene))
    threading.Thread(target=serving.serve_forever, daemon=True).start()
    yield Watched(tmp_path / "run", f"http://127.0.0.1:{serving.server_address[1]}/")
    serving.shutdown()
    serving.server_close()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with browsing() as started:
        yield started


def test_the_replay_moves_and_view_words_and_map_go_with_it(browser: Any, pages: dict[str, Path]) -> None:
    tab, errors = opened(browser, pages["episode"])
    assert tab.evaluate("document.documentElement.dataset.ready") == "3d"
    before, marker = tab.locator("#stage").screenshot(), tab.locator(".now").first.get_attribute("transform")
    tab.keyboard.press("]")
    tab.keyboard.press("]")
    assert tab.locator("#step-now").inner_text().startswith("Step 2 of")
    assert tab.locator("#stage").screenshot() != before
    assert tab.locator(".now").first.get_attribute("transform") != marker
    tab.wait_for_url("**#step=2")
    assert not errors


def test_the_page_and_python_pose_the_same_skin(browser: Any, pages: dict[str, Path]) -> None:
    tab, errors = opened(browser, pages["episode"])
    posed = tab.evaluate("""async () => {
        const replay = JSON.parse(document.getElementById("replay").textContent);
        const motion = await unpack(replay.motion);
        const looks = new Skin(await unpack(window.humanclawSkin));
        const figure = new Figure(replay.body, looks, new THREE.MeshBasicMaterial());
        figure.pose(motion.simulated_root, motion.simulated_turns, 20);
        figure.root.updateMatrixWorld(true);
        const at = figure.mesh.geometry.getAttribute("position");
        const place = (_, k) => figure.mesh.boneTransform(k, new THREE.Vector3().fromBufferAttribute(at, k)).toArray();
        return Array.from({ length: at.count }, place);
    }""")
    motion = load_run(pages["episode"].parent)[0].motion()
    expected, _ = skin().posed(motion.root[40], motion.rotations[40])
    assert np.array(posed) == pytest.approx(expected, abs=2e-3)
    assert not errors


def test_playing_advances_and_a_link_leads_to_a_moment(browser: Any, pages: dict[str, Path]) -> None:
    tab, errors = opened(browser, pages["episode"])
    tab.click("#play")
    tab.wait_for_function("Number(document.getElementById('time').value) > 2")
    tab.click("#play")
    tab.evaluate("location.hash = '#step=5'")
    tab.wait_for_function("document.getElementById('step-now').textContent.startsWith('Step 5')")
    assert tab.locator("#calls li[aria-current]").count() == 1
    tab.select_option("#view", "ego")
    tab.check("#ghost")
    assert not errors


def test_the_keys_of_time_work_whatever_was_clicked_before(browser: Any, pages: dict[str, Path]) -> None:
    tab, errors = opened(browser, pages["episode"])
    for clicked in ("#play", "#play", "#ghost", "#calls a >> nth=2"):
        tab.click(clicked)
    tab.wait_for_function("document.getElementById('step-now').textContent.startsWith('Step 2')")
    before = float(tab.input_value("#time"))
    tab.keyboard.press("ArrowRight")
    assert float(tab.input_value("#time")) == pytest.approx(before + 3)
    tab.select_option("#view", "free")
    tab.focus("#view")
    tab.keyboard.press("ArrowRight")
    assert float(tab.input_value("#time")) == pytest.approx(before + 3), "a list keeps its own keys"
    assert not errors


def test_the_address_leads_to_the_moment_at_which_it_was_paused(browser: Any, pages: dict[str, Path]) -> None:
    tab, _ = opened(browser, pages["episode"])
    tab.click("#play")
    tab.wait_for_function("Number(document.getElementById('time').value) > 10")
    tab.click("#play")
    tab.wait_for_url("**#t=*")
    clock = tab.inner_text("#clock")
    again, _ = opened(browser, tab.url)
    assert again.inner_text("#clock") == clock


def test_words_without_an_end_keep_to_their_place(browser: Any, tmp_path: Path) -> None:
    scene = record_episode(tmp_path / "one")
    broken_off(tmp_path / "one", outcome="stopped")
    steps = tmp_path / "one" / "steps.jsonl"
    said = [f'"reasoning":"{text}' for text in ("x" * 100_000, "word " * 20_000)]
    lines = [
        line.replace('"reasoning":"', text) for line, text in zip(steps.read_text().splitlines(), said, strict=False)
    ]
    steps.write_text("\n".join([*lines, ""]))
    page = write_report(
        tmp_path,
        None,
        lambda name: scene,
        contribute=lambda runs, page: page.episode(
            next(iter(runs)), "couch-0", success=False, cause="find: target in view but not seen", step=1
        ),
    )
    tab, errors = opened(browser, page, PHONE)
    assert tab.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    for number in range(len(said)):
        tab.evaluate(f"location.hash = '#step={number}'")
        tab.wait_for_function(f"document.getElementById('step-now').textContent.startsWith('Step {number}')")
        assert tab.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
        assert tab.locator("#words-now").bounding_box()["height"] < 400
    assert not errors


def test_the_list_of_episodes_is_filtered_and_sorted(browser: Any, pages: dict[str, Path]) -> None:
    tab, errors = opened(browser, pages["runs"])
    shown = tab.locator("#list > li:visible")
    assert shown.count() == 2
    tab.check("input[name=changed]")
    assert shown.count() == 1
    assert tab.locator("#count").inner_text() == "1 of 2 episodes"
    tab.click("button[type=reset]")
    tab.wait_for_function("document.getElementById('count').value.startsWith('2')")
    tab.fill("#text", "nothing like it")
    assert shown.count() == 0
    tab.fill("#text", "")
    assert shown.first.locator("strong").inner_text() == "couch-1", "changed results come first"
    tab.select_option("#sort", "word")
    assert [card.locator("strong").inner_text() for card in shown.all()] == ["couch-0", "couch-1"]
    assert not errors


def test_an_episode_is_opened_from_the_list(browser: Any, pages: dict[str, Path]) -> None:
    tab, errors = opened(browser, pages["runs"])
    tab.locator("#list a").first.click()
    tab.wait_for_function("document.documentElement.dataset.ready == '3d'")
    assert not errors


@pytest.mark.parametrize("name", ["episode", "runs", "watched"])
@looks
def test_a_page_fits_and_has_no_serious_barrier(
    browser: Any, pages: dict[str, Path], watched: Watched, name: str, size: dict[str, int], scheme: str
) -> None:
    tab, errors = opened(browser, watched.address if name == "watched" else pages[name], size, scheme)
    assert not barriers(tab)
    assert not errors


def test_a_run_of_the_whole_benchmark_opens_within_two_seconds(browser: Any, tmp_path: Path) -> None:
    record_episode(tmp_path / "one")
    episode = RecordedEpisode(tmp_path / "one")
    episodes = [_renamed(episode, f"house-{k // 30}-couch-{k}") for k in range(1218)]
    html = run_page({tmp_path: episodes}, Collected(), tmp_path / "report.html", lambda e: e.folder / "page.html", {})
    (tmp_path / "report.html").write_text(html, "utf-8")
    tab, errors = opened(browser, tmp_path / "report.html", measured=True)
    spent = {metric["name"]: metric["value"] for metric in tab.measuring.send("Performance.getMetrics")["metrics"]}
    assert 0 < spent["TaskDuration"] < 2, "seconds of processor time: a machine that others keep busy has no wall clock"
    listed = tab.locator("#list > li")
    assert tab.locator("#count").inner_text() == "1218 of 1218 episodes"
    assert listed.count() == 50, "the others are laid out when they are scrolled to"
    tab.locator("footer").scroll_into_view_if_needed()
    tab.wait_for_function("document.querySelectorAll('#list > li').length > 50")
    tab.fill("#text", "couch-1217")
    assert [card.locator("strong").inner_text() for card in listed.all()] == ["house-40-couch-1217"]
    assert not errors


def test_a_run_under_way_is_seen_as_it_grows_by_all_who_watch(browser: Any, watched: Watched) -> None:
    tabs = [opened(browser, watched.address) for _ in range(2)]
    frames = watched.folder / "couch-0" / "frames"
    (frames / "0099.jpg").write_bytes(picture(7))
    steps = watched.folder / "couch-0" / "steps.jsonl"
    *_, line, _ = steps.read_bytes().split(b"\n")[:-1]
    count = len(steps.read_bytes().splitlines())
    with steps.open("ab") as file:
        file.write(line.replace(b'"step":%d' % (count - 2), b'"step":%d' % count) + b"\n")
    for tab, errors in tabs:
        tab.locator("tbody tr", has_text=str(count + 1)).wait_for()
        card = tab.locator("[data-episode=couch-0]")
        tab.wait_for_function(f"document.querySelector('.said').textContent.startsWith('Step {count},')")
        assert card.locator("img").evaluate("image => image.naturalWidth") == 256
        assert tab.locator("#lede").inner_text() == "1 ended, 2 in progress."
        assert tab.locator("#now").inner_text() == "Now"
        assert not errors


def test_an_episode_that_has_ended_says_how(browser: Any, watched: Watched) -> None:
    for number in (0, 1):
        broken_off(watched.folder / f"couch-{number}", outcome="out_of_steps")
    tab, errors = opened(browser, watched.address)
    tab.locator(".said", has_text="Then it ended: out of steps, goal reached.").wait_for()
    assert tab.locator("tbody td", has_text="out of steps").count() == 2
    assert not errors


def test_a_run_that_is_deleted_while_watched_leaves_an_empty_page(browser: Any, watched: Watched) -> None:
    tab, _ = opened(browser, watched.address)
    shutil.rmtree(watched.folder)
    tab.wait_for_function("document.getElementById('lede').textContent === 'No episode has begun.'")
    assert tab.locator("tbody tr").count() == 0


def _renamed(episode: RecordedEpisode, name: str) -> RecordedEpisode:
    other = copy.copy(episode)
    other.record = episode.record.model_copy(
        update={"spec": episode.record.spec.model_copy(update={"id": name}), "outcome": "stopped"}
    )
    return other
