"""The report of a small recorded run, read as a browser's parser would."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from made import record_episode

from humanclaw.bench.report import Table, in_words, stages, write_report
from humanclaw.errors import RecordError, SceneError
from humanclaw.records import RecordedEpisode
from humanclaw.scene import Scene

VOID = {"meta", "img", "br", "link", "input", "hr"}


class Page(HTMLParser):
    """Tags, attributes and text of a page; raises if its tags are not nested properly."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text, self._open = "", []
        self.feed(html)
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not self._open or self._open[-1] != "style":
            self.text += " ".join(data.split()) + " " if data.strip() else ""

    def all(self, name: str) -> list[dict[str, str | None]]:
        return [attrs for tag, attrs in self.tags if tag == name]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Scene]:
    folder = tmp_path_factory.mktemp("run")
    scene = record_episode(folder / "one")
    record_episode(folder / "two", instruction="<script>alert(1)</script> find a couch", name="couch-1")
    return folder, scene


@pytest.fixture(scope="module")
def page(run: tuple[Path, Scene]) -> Page:
    path = write_report(
        run[0], None, lambda name: run[1], tables=[Table("Rates", ("", "NavSR"), (("oracle", "100 %"),))]
    )
    assert path == run[0] / "report.html"
    return Page(path.read_text("utf-8"))


def test_the_page_needs_nothing_from_outside(page: Page) -> None:
    links = [attrs.get(key) or "" for _, attrs in page.tags for key in ("src", "href") if key in attrs]
    assert links
    assert all(link.startswith(("data:image/jpeg;base64,", "#")) for link in links)
    assert not page.all("script")
    assert not page.all("link")


def test_an_instruction_is_text_and_never_markup(page: Page) -> None:
    assert "<script>alert(1)</script> find a couch" in page.text


def test_every_picture_is_described_and_every_link_leads_somewhere(page: Page) -> None:
    assert all(image.get("alt") for image in page.all("img"))
    assert all(svg.get("aria-label") or svg.get("aria-hidden") for svg in page.all("svg"))
    ids = [attrs["id"] for _, attrs in page.tags if "id" in attrs]
    assert len(ids) == len(set(ids))
    assert {(a.get("href") or "")[1:] for a in page.all("a") + page.all("use")} <= set(ids)


def test_each_step_tells_its_call_its_reason_and_the_verdict(page: Page, run: tuple[Path, Scene]) -> None:
    episode = RecordedEpisode(run[0] / "one")
    for step in episode.steps:
        assert step.attempts[0].reasoning in page.text
        assert step.attempts[0].visible_state in page.text
    assert "sit_in_place(h_cm=52)" in page.text
    assert "too far" in page.text


def test_the_outcome_is_told_in_words(run: tuple[Path, Scene]) -> None:
    episode = RecordedEpisode(run[0] / "one")
    reached = stages(episode)
    assert {stage.name: stage.met for stage in reached} == {
        "in view": True,
        "reached": True,
        "sat": True,
        "stopped": True,
    }
    words = in_words(episode, reached)
    assert words.startswith("The body had the couch in view, ended within reach of it, sat on it and stopped")


def test_the_path_on_the_map_begins_and_ends_where_the_body_did(page: Page, run: tuple[Path, Scene]) -> None:
    lines = [line["points"] or "" for line in page.all("polyline")]
    steps = RecordedEpisode(run[0] / "one").steps
    half = lines[: len(lines) // 2]
    assert half[0].split()[0] == "100,100"
    end = steps[-1].end
    assert [float(v) for v in half[-1].split()[-1].split(",")] == pytest.approx([100 * end[0], 100 * end[2]], abs=1)
    colours = [line["stroke"] for line in page.all("polyline")]
    assert len(set(colours[: len(half)])) == len(half)


def test_contacts_name_the_thing_and_the_part_of_the_body(page: Page) -> None:
    assert re.search(r"couch 20 left ankle 18.20", page.text)


def test_a_scene_that_cannot_be_loaded_leaves_a_note(run: tuple[Path, Scene], tmp_path: Path) -> None:
    def fail(name: str) -> Scene:
        raise SceneError(f"there is no scene {name}.")

    page = Page(write_report(run[0], tmp_path / "out.html", fail).read_text("utf-8"))
    assert "The house is not drawn: there is no scene test:rooms." in page.text
    assert page.all("polyline")
    assert not page.all("symbol")


def test_a_table_of_metrics_is_shown(page: Page) -> None:
    assert "Rates NavSR oracle 100 %" in page.text


def test_a_film_beside_the_record_is_part_of_the_page(tmp_path: Path) -> None:
    scene = record_episode(tmp_path / "one")
    (tmp_path / "one" / "film.mp4").write_bytes(b"\0" * 9)
    page = Page(write_report(tmp_path, None, lambda name: scene).read_text("utf-8"))
    assert [video["src"] for video in page.all("video")] == ["data:video/mp4;base64,AAAAAAAAAAAA"]


def test_a_large_film_is_linked(tmp_path: Path) -> None:
    scene = record_episode(tmp_path / "run" / "one")
    (tmp_path / "run" / "one" / "film.gif").write_bytes(b"\0" * 4_000_001)
    page = Page(write_report(tmp_path / "run", tmp_path / "page.html", lambda name: scene).read_text("utf-8"))
    assert "run/one/film.gif" in [link.get("href") for link in page.all("a")]


def test_an_interrupted_episode_is_reported_from_its_steps(tmp_path: Path) -> None:
    scene = record_episode(tmp_path / "one")
    (tmp_path / "one" / "motion.npz").unlink()
    page = Page(write_report(tmp_path, None, lambda name: scene).read_text("utf-8"))
    assert len(page.all("polyline")) > 10


def test_a_folder_without_records_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="no episode record"):
        write_report(tmp_path, None, lambda name: record_episode(tmp_path / "x"))
