"""Tests of the report of a small recorded run, read with an HTML parser."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import unquote, urljoin, urlsplit

import numpy as np
import pytest
from made import broken_off, record_episode
from rooms import UPSTAIRS, asset, block, scene_object, two_rooms, two_storeys

import humanclaw_report
from humanclaw import RecordedEpisode, RecordError, Scene, SceneError, load_run
from humanclaw.body import HISTORY, REGIONS, SKINS, skin
from humanclaw.records import write_record
from humanclaw.world import person_id
from humanclaw_report.episode_summary import in_words, milestones, named, touches
from humanclaw_report.floor_plan import house_maps, path_maps, storeys_at
from humanclaw_report.replay import data_uri
from humanclaw_report.report import write_report
from humanclaw_report.scene_cache import KEPT, Drawn, Houses
from humanclaw_report.timeline_markers import marks

VOID = {"meta", "img", "br", "link", "input", "hr"}


class Page(HTMLParser):
    """Tags, attributes and text of a page. Parsing fails if the tags are not nested properly."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text, self._open = "", []
        self.scripts: list[str] = []
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
        if self._open and self._open[-1] == "script":
            self.scripts.append(data)
        elif not self._open or self._open[-1] != "style":
            self.text += " ".join(data.split()) + " " if data.strip() else ""

    @property
    def paths(self) -> list[dict[str, str | None]]:
        """The pieces of the walked path on the maps."""
        return [line for line in self.all("polyline") if line.get("class") == "path"]

    def all(self, name: str) -> list[dict[str, str | None]]:
        return [attrs for tag, attrs in self.tags if tag == name]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Scene]:
    """Record an episode whose instruction contains markup."""
    folder = tmp_path_factory.mktemp("run")
    return folder, record_episode(folder / "one", instruction="<script>alert(1)</script> find a couch")


@pytest.fixture(scope="module")
def page(made: tuple[Path, Scene]) -> Page:
    path = write_report(made[0], None, lambda name: made[1])
    assert path == made[0] / "report.html"
    return Page(path.read_text("utf-8"))


def test_the_page_needs_nothing_from_outside(page: Page) -> None:
    links = [attrs.get(key) or "" for _, attrs in page.tags for key in ("src", "href") if key in attrs]
    assert links
    assert all(link.startswith(("data:image/jpeg;base64,", "#")) or link == "data:," for link in links)
    assert [link["rel"] for link in page.all("link")] == ["icon"]


def test_an_instruction_is_text_and_never_markup(page: Page) -> None:
    assert "<script>alert(1)</script> find a couch" in page.text
    assert "alert(1)" not in "".join(page.scripts)


def test_every_picture_is_described_and_every_link_leads_somewhere(page: Page) -> None:
    assert all(image.get("alt") for image in page.all("img"))
    assert all(svg.get("aria-label") or svg.get("aria-hidden") for svg in page.all("svg"))
    ids = [attrs["id"] for _, attrs in page.tags if "id" in attrs]
    assert len(ids) == len(set(ids))
    links = {(a.get("href") or "")[1:] for a in page.all("a") + page.all("use")}
    assert {link for link in links if not link.startswith("step=")} <= set(ids)


def test_each_step_tells_its_call_its_reason_and_the_verdict(page: Page, made: tuple[Path, Scene]) -> None:
    episode = RecordedEpisode(made[0] / "one")
    for step in episode.steps:
        assert step.decision.reasoning in page.text
        assert step.decision.visible_state in page.text
    assert "sit_in_place(h_cm=52)" in page.text
    assert "too far" in page.text


def test_the_outcome_is_told_in_words(made: tuple[Path, Scene]) -> None:
    episode = RecordedEpisode(made[0] / "one")
    reached = milestones(episode)
    assert {stage.name: stage.met for stage in reached} == {
        "in view": True,
        "reached": True,
        "sat": True,
        "stopped": True,
    }
    sat = next(step.step for step in episode.steps if step.call and step.call.skill == "sit_in_place")
    assert [stage.detail for stage in reached if stage.name == "sat"] == [f"since step {sat}"]
    words = in_words(episode, reached)
    assert words.startswith("The body had the couch in view, ended within reach of it, sat on it and stopped")


def test_the_path_on_the_map_begins_and_ends_where_the_body_did(page: Page, made: tuple[Path, Scene]) -> None:
    walked = page.paths
    steps = RecordedEpisode(made[0] / "one").steps
    half = [line["points"] or "" for line in walked]
    assert half[0].split()[0] == "100,100"
    end = steps[-1].end
    assert [float(v) for v in half[-1].split()[-1].split(",")] == pytest.approx([100 * end[0], 100 * end[2]], abs=1)
    assert len({line["stroke"] for line in walked}) == len(half)


@pytest.fixture(scope="module")
def climbed(tmp_path_factory: pytest.TempPathFactory) -> tuple[RecordedEpisode, Scene]:
    """Record an episode from the ground floor of a house with two storeys to the bed upstairs."""
    folder = tmp_path_factory.mktemp("climbed")
    settings = {"body": {"sensors": ["vision", "touch"]}}
    scene = record_episode(folder, two_storeys(), instruction="sit on the bed", targets=(31,), settings=settings)
    return RecordedEpisode(folder), scene


def test_a_height_belongs_to_the_highest_floor_below_it() -> None:
    assert storeys_at((0.0, 2.7, 5.4), np.array([-0.4, 0.9, 2.5, 2.65, 3.6, 9.0])).tolist() == [0, 0, 0, 1, 1, 2]
    assert storeys_at((0.0,), 7.0) == 0


def test_a_house_with_one_floor_has_one_map_without_a_title() -> None:
    (only,) = house_maps(two_rooms(), "house")
    assert only.title == ""
    assert {kind for *_, kind in only.rooms} == {"bedroom", "living room"}


def test_each_storey_shows_its_own_rooms_and_objects_and_the_stairs() -> None:
    lower, upper = house_maps(two_storeys(), "house")
    assert (lower.title, upper.title) == ("ground floor", "upper floor")
    assert lower.box == upper.box
    assert lower.box[2] > 0
    assert {kind for *_, kind in lower.rooms} == {"living room"}
    assert {kind for *_, kind in upper.rooms} == {"bedroom", "hall"}
    names = [{name for _, _, name in drawn.objects} for drawn in (lower, upper)]
    assert names[0] & {"potted plant 30", "potted plant 32", "bed 31"} == {"potted plant 30"}
    assert names[1] & {"potted plant 30", "potted plant 32", "bed 31"} == {"potted plant 32", "bed 31"}
    # The first step ends at x = 2.25 m, the last begins at 5.5.
    for drawn in (lower, upper):
        stairs = " ".join(outline for outline, kind, _ in drawn.objects if kind == "stairs")
        assert "225,0" in stairs
        assert "550,0" in stairs


def test_the_path_is_drawn_on_the_storey_where_it_was_walked(climbed: tuple[RecordedEpisode, Scene]) -> None:
    episode, scene = climbed
    lower, upper = path_maps(episode, house_maps(scene, "house"))
    heights = {step.step: step.end[1] for step in episode.steps}
    assert max(heights[step] for *_, step in lower.pieces) <= UPSTAIRS + 0.1
    assert min(heights[step] for *_, step in upper.pieces) >= UPSTAIRS - 0.1
    assert {step for *_, step in lower.pieces + upper.pieces} == set(heights)
    assert lower.start is not None
    assert lower.start[:2] == (100, 50)
    assert upper.end is not None
    assert upper.end[:2] == pytest.approx((100 * episode.steps[-1].end[0], 100 * episode.steps[-1].end[2]), abs=1)
    assert (lower.end, upper.start) == (None, None)
    assert (len(lower.targets), len(upper.targets)) == (0, 1)


def test_the_labels_of_targets_beside_one_another_do_not_overlap(tmp_path: Path) -> None:
    chairs = {k: ((4.0 + 0.3 * k, 0.0, 2.0), (4.2 + 0.3 * k, 0.9, 2.2)) for k in range(2)} | {9: ((1, 0, 2), (2, 1, 3))}
    record_episode(tmp_path)
    episode = RecordedEpisode(tmp_path)
    episode.record = episode.record.model_copy(update={"targets": chairs})
    (drawn,) = path_maps(episode, house_maps(two_rooms(), "house"))
    assert [bool(label) for *_, label in drawn.targets] == [True, False, True]
    assert not any(z <= at <= z + deep for _, z, _, deep, at, _ in drawn.targets)  # The mark of a body is there.


def test_a_storey_with_neither_path_nor_target_is_left_out(tmp_path: Path) -> None:
    seat = asset("couch", "couch", block(1.6, 0.42, 0.9), seat=0.42)
    scene = record_episode(tmp_path, two_storeys((seat, scene_object(20, seat, 7.4, 1.5, -np.pi / 2))))
    (drawn,) = path_maps(RecordedEpisode(tmp_path), house_maps(scene, "house"))
    assert drawn.house.title == "ground floor"


def test_the_page_of_a_climb_shows_both_floors_and_the_senses(climbed: tuple[RecordedEpisode, Scene]) -> None:
    page = Page(write_report(climbed[0].folder, None, lambda name: climbed[1]).read_text("utf-8"))
    assert len(page.all("use")) == len(page.all("symbol")) == 2
    assert "ground floor" in page.text
    assert "upper floor" in page.text
    assert "sensors vision, touch" in page.text


def test_standing_on_an_upper_floor_is_no_contact(climbed: tuple[RecordedEpisode, Scene]) -> None:
    page = Page(write_report(climbed[0].folder, None, lambda name: climbed[1]).read_text("utf-8"))
    assert climbed[0].steps[-1].contacts[0].height > 2
    assert "left ankle on floor" not in page.text


def test_an_episode_that_ended_before_its_first_step_shows_a_start(tmp_path: Path) -> None:
    scene = record_episode(tmp_path)
    broken_off(tmp_path, steps=0)
    (tmp_path / "steps.jsonl").write_text("")
    page = Page(write_report(tmp_path, None, lambda name: scene).read_text("utf-8"))
    assert not page.paths
    assert "start end" in page.text


def test_a_page_says_first_what_was_run(page: Page) -> None:
    assert re.match("oracle in test:rooms: .*find a couch · HumanCLAW episode Skip to the replay Episode", page.text)
    assert page.text.index("Made with HumanCLAW") < page.text.index("tv 21")


def test_an_episode_without_a_target_has_missed_nothing(tmp_path: Path) -> None:
    scene = record_episode(tmp_path)
    record = RecordedEpisode(tmp_path).record
    free = record.spec.model_copy(update={"target_ids": (), "target_category": "", "max_steps": record.steps})
    broken_off(tmp_path, spec=free, targets={}, outcome="out_of_steps")
    page = Page(write_report(tmp_path, None, lambda name: scene).read_text("utf-8"))
    assert f"The body took its {record.steps} steps." in page.text
    assert "not stopped" not in page.text


def test_an_episode_of_two_runs_is_shown_under_its_runs_name(tmp_path: Path) -> None:
    for run, name in (("a", "couch-0"), ("b", "couch-1")):
        scene = record_episode(tmp_path / run / name, name=name)
    page = write_report([tmp_path / "a", tmp_path / "b"], tmp_path / "pair.html", lambda name: scene).read_text("utf-8")
    assert re.findall(r'href="(\w)/couch-\d/page.html"><span class="unit">(\w)', page) == [("a", "a"), ("b", "b")]


def test_no_senses_are_told_of_a_record_without_them(page: Page) -> None:
    assert "sensors" not in page.text


def test_all_parts_of_the_body_that_touch_an_object_are_named(made: tuple[Path, Scene]) -> None:
    episode = RecordedEpisode(made[0] / "one")
    last = episode.steps[-1].contacts[-1]
    on = tuple(replace(last, joint=joint) for joint in ("pelvis", "left_hip", "right_knee", "pelvis"))
    step = episode.steps[-1].model_copy(update={"contacts": on})
    assert touches(episode, step, named(made[1])) == "pelvis, left hip and right knee on couch 20"
    met = step.model_copy(update={"contacts": (replace(step.contacts[0], object_id=person_id(1)),)})
    assert touches(episode, met, {}).endswith(" on another person")


def test_contacts_and_events_stand_on_the_time_line(made: tuple[Path, Scene]) -> None:
    episode = RecordedEpisode(made[0] / "one")
    frames, steps = HISTORY + 15 * len(episode.steps), range(18, len(episode.steps))
    line = marks(episode, named(made[1]))
    sat = [mark.at for mark in line if mark.kind == "target"]
    assert sat == pytest.approx([100 * (HISTORY + 15 * step + 14) / frames for step in steps])
    (refused,) = (mark for mark in line if mark.kind == "refused")
    assert (refused.words, refused.at) == ("step 3: the verifier replaced the call", 100 * (HISTORY + 45) / frames)
    assert [mark.words.partition(": ")[2] for mark in line if mark.kind == "event"] == [
        "target first in view",
        "hips on the target",
    ]


def test_the_root_cause_stands_on_the_page_of_an_episode(made: tuple[Path, Scene], tmp_path: Path) -> None:
    def contribute(runs: Any, page: Any) -> None:
        page.episode(made[0], "couch-0", success=False, cause="nav: too far", step=3)

    path = write_report(made[0], tmp_path / "out.html", lambda name: made[1], contribute=contribute)
    page = Page(path.read_text("utf-8"))
    assert "root cause: nav: too far decided at step 3" in " ".join(page.text.split())
    (mark,) = [tag for tag in page.all("li") if tag.get("class") == "cause"]
    assert mark["title"] == "step 3: root cause: nav: too far"


def test_a_scene_that_cannot_be_loaded_leaves_a_note(made: tuple[Path, Scene], tmp_path: Path) -> None:
    def fail(name: str) -> Scene:
        raise SceneError(f"there is no scene {name}.")

    page = Page(write_report(made[0], tmp_path / "out.html", fail).read_text("utf-8"))
    assert "The house is not drawn: there is no scene test:rooms." in page.text
    assert page.paths
    assert not page.all("symbol")


def test_few_houses_are_in_memory(tmp_path: Path) -> None:
    record_episode(tmp_path)
    episode, houses = RecordedEpisode(tmp_path), Houses(lambda name: two_rooms())

    def drawn(number: int) -> Drawn:
        spec = episode.record.spec.model_copy(update={"scene": f"test:{number}"})
        episode.record = episode.record.model_copy(update={"spec": spec})
        return houses.of(episode)

    drawings = [drawn(number) for number in range(KEPT + 1)]
    assert drawn(KEPT) is drawings[KEPT]
    assert drawn(0) is not drawings[0]


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


def test_the_title_of_the_page_of_a_run_names_its_folder(tmp_path: Path) -> None:
    for name in ("couch-0", "couch-1"):
        scene = record_episode(tmp_path / "smoke-oracle" / name, name=name)
    text = write_report(tmp_path / "smoke-oracle", None, lambda name: scene).read_text("utf-8")
    assert "<title>smoke-oracle: oracle: 2 episodes, to find a couch" in text


def test_links_lead_through_folders_of_any_name(tmp_path: Path) -> None:
    run = tmp_path / "run #2, 50%? of it"
    scene = record_episode(run / "couch-0")
    record_episode(run / "couch-1", name="couch-1")
    out = write_report(run, tmp_path / "out.html", lambda name: scene)
    for page in (out, run / "couch-0" / "page.html"):
        tags = Page(page.read_text("utf-8")).tags
        links = [tag.get("src") or tag.get("href") or "#" for _, tag in tags]
        files = [urljoin(page.as_uri(), link) for link in links if not link.startswith(("#", "data:"))]
        assert files
        assert all(Path(unquote(urlsplit(file).path)).is_file() for file in files)


def test_from_an_episode_one_comes_back_to_the_page_of_its_own_run(tmp_path: Path) -> None:
    for run in ("a", "b"):
        for name in ("couch-0", "couch-1"):
            scene = record_episode(tmp_path / run / name, name=name)
    write_report(tmp_path / "a", None, lambda name: scene)
    write_report([tmp_path / "a", tmp_path / "b"], tmp_path / "pair.html", lambda name: scene)
    back = [
        Page((tmp_path / run / "couch-0" / "page.html").read_text("utf-8")).all("a")[1]["href"] for run in ("a", "b")
    ]
    assert back == ["../report.html", "../../pair.html"], "the pair's, where the run has none"


def test_nothing_that_a_scene_is_called_ends_its_script(made: tuple[Path, Scene]) -> None:
    strange = asset("strange", "</SCRIPT><script>alert(2)", block(1, 1, 1))
    scene = replace(made[1], assets={**made[1].assets, "strange": strange},
                    objects=(*made[1].objects, scene_object(90, strange, 4, 3)))  # fmt: skip
    assert "<" not in Drawn.of(scene).script


def test_an_interrupted_episode_is_reported_from_its_steps(tmp_path: Path) -> None:
    scene = record_episode(tmp_path / "one")
    broken_off(tmp_path / "one")
    (tmp_path / "one" / "motion.npz").unlink()
    page = Page(write_report(tmp_path, None, lambda name: scene).read_text("utf-8"))
    assert len(page.paths) > 10


def test_a_folder_without_records_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="no episode record"):
        write_report(tmp_path, None, lambda name: record_episode(tmp_path / "x"))


def test_the_end_of_a_run_of_the_benchmark_writes_its_pages(tmp_path: Path) -> None:
    scene = record_episode(tmp_path / "couch-0")
    record_episode(tmp_path / "couch-1", name="couch-1")
    lines: list[str] = []
    plugins = SimpleNamespace(scene=lambda name: scene, tell=lambda hook, **event: None)
    humanclaw_report.humanclaw_run_end(tmp_path, load_run(tmp_path), plugins, lines.append)
    assert lines == [f"report: {tmp_path / 'report.html'}"]
    links = [link["href"] for link in Page((tmp_path / "report.html").read_text("utf-8")).all("a")]
    assert {"couch-0/page.html", "couch-1/page.html"} <= set(links)
    page = Page((tmp_path / "couch-1" / "page.html").read_text("utf-8"))
    scripts = [tag["src"] for tag in page.all("script") if "src" in tag]
    assert all((tmp_path / "couch-1" / (source or "")).is_file() for source in scripts)
    assert len(scripts) == 3, "three.js, the skin and the house"


def test_a_page_takes_the_place_of_a_link_to_itself(tmp_path):
    record_episode(tmp_path / "couch-0")
    (tmp_path / "page.html").symlink_to("page.html")
    write_report(tmp_path / "couch-0", tmp_path / "page.html", lambda name: two_rooms())
    assert not (tmp_path / "page.html").is_symlink()


def test_a_link_among_the_views_is_refused_and_its_goal_not_shown(tmp_path):
    record_episode(tmp_path / "couch-0")
    broken_off(tmp_path / "couch-0")
    (tmp_path / "secret").write_bytes(b"secret")
    view = tmp_path / "couch-0" / "frames" / "0000.jpg"
    view.unlink()
    view.symlink_to(tmp_path / "secret")
    write_report(tmp_path / "couch-0", tmp_path / "page.html", lambda name: two_rooms())
    assert "c2VjcmV0" not in (tmp_path / "page.html").read_text(), "in base64"
    with pytest.raises(RecordError, match=r"0000\.jpg is a link, which is not followed"):
        RecordedEpisode(tmp_path / "couch-0").view(RecordedEpisode(tmp_path / "couch-0").steps[0])


def test_a_script_that_came_with_the_records_is_replaced(tmp_path: Path) -> None:
    for name in ("couch-0", "couch-1"):
        scene = record_episode(tmp_path / name, name=name)
    write_report(tmp_path, None, lambda name: scene)
    scripts = {path: path.read_bytes() for path in (tmp_path / "report").iterdir()}
    assert len(scripts) == 3
    for path in scripts:
        path.write_text("alert(1)")
    write_report(tmp_path, None, lambda name: scene)
    assert {path: path.read_bytes() for path in (tmp_path / "report").iterdir()} == scripts


def test_a_page_is_kept_until_what_it_shows_changes(tmp_path: Path) -> None:
    names = ("couch-0", "couch-1")
    for name in names:
        scene = record_episode(tmp_path / name, name=name)
    pages, causes = [tmp_path / name / "page.html" for name in names], ["", ""]

    def written() -> list[bool]:
        """Write the report; tell which pages are new files."""
        before = [page.stat().st_ino if page.exists() else 0 for page in pages]
        held = [page.open() for page in pages if page.exists()]  # Else a new file may get the number of the old one.
        write_report(tmp_path, None, lambda name: scene, contribute=contribute)
        for file in held:
            file.close()
        return [page.stat().st_ino != number for page, number in zip(pages, before, strict=True)]

    def contribute(runs: Any, page: Any) -> None:
        for name, cause in zip(names, causes, strict=True):
            page.episode(tmp_path, name, success=not cause, cause=cause)

    assert [written(), written()] == [[True, True], [False, False]]
    write_record(tmp_path / "couch-1", RecordedEpisode(tmp_path / "couch-1").record.model_copy(update={"agent": "me"}))
    assert [written(), written()] == [[False, True], [False, False]]
    causes[0] = "nav: too far"
    assert [written(), written()] == [[True, False], [False, False]]
    (tmp_path / "couch-0" / "film.gif").write_bytes(b"film")
    pages[1].write_text("a stranger's")
    assert [written(), written()] == [[True, True], [False, False]]
    (script,) = (tmp_path / "report").glob("house-*.js")
    script.unlink()
    assert [written()[0], script.exists(), written()] == [True, True, [False, False]]


def test_of_two_bodies_the_page_shows_both_views_and_colours(tmp_path: Path) -> None:
    for name in ("one", "other"):
        scene = record_episode(tmp_path / name, name=name)
        record = RecordedEpisode(tmp_path / name).record.model_copy(update={"company": ("one", "other")})
        write_record(tmp_path / name, record)
    page = Page(write_report(tmp_path / "other", None, lambda name: scene).read_text("utf-8"))
    (seen,) = [tag["src"] for tag in page.all("img") if tag.get("id") == "other0"]
    other = RecordedEpisode(tmp_path / "one")
    assert seen == data_uri(other.view(other.steps[0]), "image/jpeg")
    assert '"looks": [1, 0]' in "".join(page.scripts)
    shirt = "#" + bytes(skin(SKINS[0]).colours[REGIONS.index("shirt")]).hex()
    (way,) = [tag for tag in page.all("polyline") if tag.get("class") == "path other"]
    assert way["stroke"] == shirt
    last = np.array([float(number) for number in way["points"].replace(",", " ").split()])[-2:]
    assert last == pytest.approx(100 * other.motion().root[::3][-1, [0, 2]], abs=1.0)


def test_the_page_of_a_task_of_ones_own_tells_its_success_alone(tmp_path: Path) -> None:
    record_episode(tmp_path)
    recorded = RecordedEpisode(tmp_path)
    recorded.record = recorded.record.model_copy(
        update={"spec": recorded.record.spec.model_copy(update={"success": "to_the_kitchen"})}
    )
    assert [stage.name for stage in milestones(recorded)] == ["stopped"]
    solved, _ = met = milestones(recorded, success=True)
    assert (solved.name, solved.met, solved.detail) == ("solved", True, "to the kitchen")
    assert in_words(recorded, met).startswith("The body solved its task and stopped")
    assert "did not solve its task" in in_words(recorded, milestones(recorded, success=False))
