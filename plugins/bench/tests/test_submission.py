"""A submission is a run and its author; every number on the page is computed from the records."""

from __future__ import annotations

import html
import json
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import pytest
from browser import barriers, browsing, looks, opened, slow
from click.testing import CliRunner, Result
from manifests import tell
from rollouts import COUCH, rollout, step

from humanclaw import RecordError, load_run
from humanclaw.body import Pose2D
from humanclaw.records import EpisodeRecord, SkillInfo, write_episodes, write_record
from humanclaw_bench import leaderboard
from humanclaw_bench.cli import bench
from humanclaw_bench.splits import load_split
from humanclaw_bench.verification import split_digest

SAT = [
    step(says="A couch is 2 m ahead.", pixels=500),
    step("sit_in_place", away=0.1, pelvis_contacts=(COUCH,)),
    step("stop", away=0.1, pelvis_contacts=(COUCH,)),
]
FAR = [step("stop", away=0.5)]
WARM = {"agent": {"temperature": 0.2}, "body": {"simulator": "bullet"}}


@pytest.fixture
def run(tmp_path: Path) -> Path:
    folder = tmp_path / "board" / "mine"
    for k in range(4):
        recorded = rollout(folder, SAT if k else FAR, name=f"e{k}")
        rewrite(folder, recorded.record.spec.id, settings=WARM)
    return tell(folder, agent="model")


def invoke(*words: object) -> Result:
    return CliRunner().invoke(click.Group("x", {"bench": bench}), ["bench", *map(str, words)])


def submitted(run: Path, who: str = "Ada <ada@example.org>") -> Path:
    assert invoke("submit", run, "--who", who, "--model-date", "2026-11").exit_code == 0
    return run / "submission.json"


def change(path: Path, **what: Any) -> None:
    path.write_text(json.dumps(json.loads(path.read_text()) | what))


def test_a_submission_names_author_model_and_records_and_no_number(run: Path) -> None:
    claims = json.loads(submitted(run).read_text())
    assert claims.keys() == {"format", "who", "made", "model_date", "digest"}
    assert (claims["who"], claims["model_date"], len(claims["digest"])) == ("Ada <ada@example.org>", "2026-11", 64)


def test_verify_says_who_submitted_the_records(run: Path) -> None:
    submitted(run)
    result = invoke("verify", run)
    assert result.exit_code == 0
    assert "4 records in" in result.output
    assert "all whole. Submitted by Ada <ada@example.org>." in result.output


def better_record(run: Path) -> None:
    shutil.rmtree(run / "e0")
    rollout(run, SAT, name="e0")
    rewrite(run, "e0", settings=WARM)


def another_agent(run: Path) -> None:
    say(run, agent="a larger model")


@pytest.mark.parametrize("edit", [better_record, another_agent])
def test_a_submission_holds_for_its_records_and_run_json_alone(run: Path, edit: Callable[[Path], None]) -> None:
    submitted(run)
    edit(run)
    assert "is of other records, or of another run.json" in str(invoke("verify", run).exception)
    invoke("leaderboard", run.parent)
    ranked, apart = page(run)
    assert "Ada" not in ranked
    assert "is of other records, or of another run.json" in apart


# -- a run that is not what it says ------------------------------------------------------------------------------------
def keep_successes(run: Path) -> None:
    """Take the failures out, and say in run.json that the rest is all."""
    write_episodes(run / "split.jsonl", [episode.record.spec for episode in load_run(run)])
    shutil.rmtree(run / "e0")
    say(run, episodes=3)


def keep_successes_alone(run: Path) -> None:
    keep_successes(run)
    (run / "split.jsonl").unlink()


def say(run: Path, **what: Any) -> None:
    manifest = json.loads((run / "run.json").read_text())
    (run / "run.json").write_text(json.dumps(manifest | what))


def rewrite(run: Path, name: str, spec: dict[str, Any] | None = None, **changes: Any) -> None:
    """Change a record as if it had been written so."""
    record = EpisodeRecord.model_validate_json((run / name / "episode.json").read_bytes())
    write_record(run / name, record.model_copy(update={"spec": record.spec.model_copy(update=spec or {}), **changes}))


def unseal(run: Path) -> None:
    path = run / "e1" / "episode.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"seal": "", "files": {}}))


def unseal_files(run: Path) -> None:
    """A record that seals itself and none of its files."""
    rewrite(run, "e1", files={})


def another_start(run: Path) -> None:
    write_episodes(run / "split.jsonl", [episode.record.spec for episode in load_run(run)])
    rewrite(run, "e1", {"start": Pose2D(x=1.5, z=1.2, yaw=2.0), "seed": 99, "max_steps": 2})


def other_options(run: Path) -> None:
    say(run, options={"history": 4})


def deeper(run: Path) -> None:
    """Records of another run, put away in a folder of this one."""
    shutil.copytree(run / "e1", run / "old" / "e1")


def inside_another(run: Path) -> None:
    """A run of other options in a folder of this one, whose run.json would stand for it."""
    (run / "rest").mkdir()
    for name in ("e0", "e1", "e2", "e3"):
        (run / name).rename(run / "rest" / name)
        rewrite(run / "rest", name, options={"hint": True})
    tell(run / "rest", options={"hint": True})


TAMPERED = [
    (inside_another, "rest/e0 lies below the run"),
    (deeper, "old/e1 lies below the run"),
    (keep_successes, "run.json says that the run is of 3 episodes; split"),
    (keep_successes_alone, "run.json names 3 episodes of split"),
    (unseal, "e1/episode.json has no seal of its files"),
    (unseal_files, "e1/episode.json has no seal of its files"),
    (another_start, "e1 is not of this run: start, max_steps, seed."),
    (other_options, "e0 is not of this run: options."),
]


@pytest.mark.parametrize(("tamper", "words"), TAMPERED)
def test_a_run_that_is_not_what_it_says_is_named_everywhere(run: Path, tamper: Any, words: str) -> None:
    path = submitted(run).rename(run.parent / "told")
    tamper(run)  # Some verify in between.
    path.rename(run / "submission.json")
    verified = invoke("verify", run)
    assert (verified.exit_code, words in verified.output.replace("\\", "/")) == (1, True)
    for refused in (("submit", run, "--who", "x"), ("table", run, "--format", "latex", "--partial")):
        result = invoke(*refused)
        assert isinstance(result.exception, RecordError)
        assert words in str(result.exception).replace("\\", "/")
    shown = invoke("table", run, "--format", "markdown", "--only", "main").output.replace("\\", "/")
    assert re.search(rf"Warning: \S*{re.escape(words)}", shown)
    invoke("leaderboard", run.parent)
    ranked, apart = page(run)
    assert "Ada" not in ranked
    assert words in apart


def page(run: Path) -> tuple[str, str]:
    """Return what the leaderboard beside a run ranks, and the rest."""
    text = (run.parent / "index.html").read_text().replace("\\", "/")
    ranked, _, apart = text.partition("Not ranked")
    return ranked, apart


MIXED = [
    {"verifier": "weak"},
    {"agent": "another"},
    {"settings": WARM | {"body": {"simulator": "mujoco"}}},
    {"skills": {"walk": SkillInfo("locomotion", digest="b")}},
]


@pytest.mark.parametrize("other", MIXED)
def test_a_run_with_an_episode_played_otherwise_is_no_submission(run: Path, other: dict[str, Any]) -> None:
    rewrite(run, "e3", **other)
    assert "holds runs of several agents or settings" in str(invoke("submit", run, "--who", "x").exception)


@pytest.mark.parametrize("name", ["val", "val-400", "mini", "smoke"])
def test_a_part_of_a_split_of_the_benchmark_needs_no_file(tmp_path: Path, name: str) -> None:
    split = load_split(name)
    rollout(tmp_path, FAR, name=split[2].id)
    rewrite(tmp_path, split[2].id, dict(split[2]))
    tell(tmp_path, episodes=len(split), split=split_digest(split))
    assert invoke("verify", tmp_path).exit_code == 0
    rewrite(tmp_path, split[2].id, {"seed": 10_000})
    assert "is not of this run: seed." in invoke("verify", tmp_path).output


ODD = ["{", "[1]", "null", "{}", "[" * 100_000, '{"episodes": 4}', '{"split": "a", "episodes": 4, "options": 1}']
ODD += [f'{{"split": "a", "episodes": {odd}}}' for odd in ('"many"', "null", "-5", "true", "1e400")]


@pytest.mark.parametrize("text", ODD)
@pytest.mark.parametrize("command", [("table",), ("submit", "--who", "x"), ("verify",)])
def test_an_odd_run_json_is_named(run: Path, command: tuple[str, ...], text: str) -> None:
    (run / "run.json").write_text(text)
    result = invoke(command[0], run, *command[1:])
    assert isinstance(result.exception, RecordError)
    assert "run.json is damaged" in str(result.exception)


# -- the page ----------------------------------------------------------------------------------------------------------
def test_the_leaderboard_shows_who_and_numbers_from_the_records(run: Path) -> None:
    submitted(run)
    assert invoke("leaderboard", run.parent).exit_code == 0
    page = (run.parent / "index.html").read_text()
    assert "Ada &lt;ada@example.org&gt;" in page
    assert re.search(r"75\.0% \[30\.1, 95\.4\]<span class='bar'><span style='left:30\.1%;width:65\.\d%'>", page)
    assert "<span class='told'>whole</span>" in page
    for fact in (
        "<dt>temperature</dt><dd>0.2</dd>",
        "<dt>date of the model</dt><dd>2026-11</dd>",
        "<dt>engine</dt><dd>bullet</dd>",
    ):
        assert fact in page
    assert "<i style='left:75.0%'></i>" in page  # The mark at the rate.
    assert "<title>HumanCLAW-Bench: not one of the benchmark&#39;s</title>" in page
    assert re.findall("<th scope='col'>([^<]*)", page)[:3] == ["agent", "InteractSR", "records"]
    assert page.index("</table>") < page.index("confidence intervals")


def test_a_row_links_to_the_page_that_the_board_wrote_and_to_no_other(run: Path) -> None:
    for name in ("report.html", "evil.html", "e0/evil.js", "e0/film.gif"):
        (run / name).write_text("brought along")
    submitted(run)
    shutil.copytree(run, run.parent / "o'f: <x>")
    invoke("leaderboard", run.parent)
    assert "<a " not in "".join(page(run))
    site = run.parent / "site"
    assert "holds what submitters sent" in str(invoke("leaderboard", "--pages", run.parent, run.parent).exception)
    assert invoke("leaderboard", "--pages", site, run.parent).exit_code == 0
    assert re.findall("<a href='([^']*)'>model</a>", (site / "index.html").read_text()) == [
        "mine/report.html",
        "o%27f%3A%20%3Cx%3E/report.html",
    ]
    assert not any(b"brought along" in path.read_bytes() for path in site.rglob("*") if path.is_file())
    assert "e0/page.html" in (site / "mine" / "report.html").read_text()
    assert (site / "mine" / "e0" / "steps.jsonl").read_bytes() == (run / "e0" / "steps.jsonl").read_bytes()
    shutil.copytree(run, run.parent / "played again the same")
    invoke("leaderboard", run.parent)
    assert "class='good'" not in page(run)[0]


@pytest.mark.parametrize("name", ["index.html", "INDEX.HTML"])
def test_a_run_named_as_the_board_itself_is_to_be_renamed(run: Path, name: str) -> None:
    submitted(run)
    shutil.copytree(run, run.parent / name)
    site = run.parent / "site"
    assert invoke("leaderboard", "--pages", site, run.parent).exit_code == 0
    text = (site / "index.html").read_text()
    assert re.search(r"Not ranked: \S+ has the name of the board&#39;s own page. Rename it", text, re.IGNORECASE)
    assert "mine/report.html" in text
    if name == "index.html":
        assert "Name another folder with --pages" in str(invoke("leaderboard", run.parent).exception)


def test_the_board_follows_no_link_of_a_submitter(run: Path) -> None:
    submitted(run)
    board = run.parent.parent / "other"
    board.mkdir()
    (board / "linked").symlink_to(run)
    assert "no submitted run" in str(invoke("leaderboard", board).exception)
    shutil.copytree(run, board / "mine")
    (board / "mine" / "submission.json").unlink()
    (board / "mine" / "submission.json").symlink_to(run / "submission.json")
    invoke("leaderboard", board)
    assert "Ada" not in (board / "index.html").read_text()


def test_a_page_that_cannot_be_written_is_told_and_the_row_stays(run: Path) -> None:
    submitted(run)
    site = run.parent / "site"
    (site / "mine" / "report.html" / "x").mkdir(parents=True)
    assert invoke("leaderboard", "--pages", site, run.parent).exit_code == 0
    assert "<span class='told'>whole; page not written</span>" in (site / "index.html").read_text()


@slow
@looks
def test_the_leaderboard_fits_and_has_no_serious_barrier(run: Path, size: dict[str, int], scheme: str) -> None:
    submitted(run)
    invoke("leaderboard", "--pages", run.parent / "site", run.parent)
    with browsing() as browser:
        tab, errors = opened(browser, run.parent / "site" / "index.html", size, scheme, ready="true")
        assert not barriers(tab)
        assert not errors


def test_a_privileged_agent_is_called_so_under_every_table(run: Path) -> None:
    submitted(run)
    invoke("leaderboard", run.parent)
    assert "rivileged" not in invoke("table", run, "--format", "markdown").output + page(run)[0]
    for episode in load_run(run):
        settings = {**episode.record.settings, "privileged": {"agent": True}}
        rewrite(run, episode.folder.name, settings=settings)
    told = "Privileged (may read scene, true state, target ids, and depth and ids of its view): agent."
    assert told in invoke("table", run, "--format", "markdown").output
    submitted(run)
    invoke("leaderboard", run.parent)
    assert "model (privileged)" in page(run)[0]


def of_smoke(folder: Path) -> Path:
    """Records of all episodes of a split of the benchmark."""
    for spec in load_split("smoke"):
        rollout(folder, FAR, name=spec.id)
        rewrite(folder, spec.id, dict(spec))
    return tell(folder, agent="model")


@pytest.mark.parametrize(
    ("key", "bad"),
    [("made", "9999-99-99"), ("who", "x" * 501), ("who", " "), ("who", None), ("format", 2), ("rates", {"NavSR": 1})],
)
def test_a_submission_that_says_something_odd_is_none(run: Path, key: str, bad: object) -> None:
    change(submitted(run), **{key: bad})
    invoke("leaderboard", run.parent)
    assert f"submission.json is damaged: {key}: " in page(run)[1]


@pytest.mark.parametrize("name", ["", " ", "x" * 501])
def test_somebody_of_no_name_or_too_long_a_one_is_told_so(run: Path, name: str) -> None:
    result = invoke("submit", run, "--who", name)
    assert isinstance(result.exception, RecordError)
    assert "no submission can be made" in str(result.exception)
    assert "who: " in str(result.exception)
    assert str(result.exception) == str(invoke("submit", run.parent / "nowhere", "--who", name).exception)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes in folders")
def test_what_never_ends_or_has_no_legible_name_stops_no_page(run: Path) -> None:
    submitted(run)
    for name in ("pipe", os.fsdecode(b"\xff")):
        shutil.copytree(run, run.parent / name)
        (run.parent / name / "submission.json").unlink()
    os.mkfifo(run.parent / "pipe" / "submission.json")
    (run.parent / os.fsdecode(b"\xff") / "submission.json").write_text("nope")
    assert invoke("leaderboard", run.parent).exit_code == 0
    assert page(run)[1].count("Write it with `humanclaw bench submit`") == 2
    assert "Ada" in page(run)[0]


def test_a_temperature_that_is_no_number_is_shown_as_recorded(run: Path) -> None:
    for name in ("e0", "e1", "e2", "e3"):
        rewrite(run, name, settings=WARM | {"agent": {"temperature": "<default>"}})
    submitted(run)
    invoke("leaderboard", run.parent)
    assert "<dt>temperature</dt><dd>&lt;default&gt;</dd>" in page(run)[0]


def test_the_page_tells_what_a_run_was_played_with(run: Path) -> None:
    for name in ("e0", "e1", "e2", "e3"):
        rewrite(run, name, verifier="judge", options={"profile": "paper"})
    tell(run, **{"plugin files": {"mine.py": "0" * 64}})
    submitted(run)
    invoke("leaderboard", run.parent)
    row = html.unescape(page(run)[0])
    assert "<dd>judge</dd>" in row
    assert 'options {"profile": "paper"}; plugin files {"mine.py": "' in row


def test_what_would_steer_a_terminal_is_shown_nowhere(run: Path) -> None:
    submitted(run, "Eve\x1b[31m\u202e")
    invoke("leaderboard", run.parent)
    for text in ((run.parent / "index.html").read_text(), invoke("verify", run).output):
        assert ("Eve" in text, "\x1b" in text, "\u202e" in text) == (True, False, False)


def test_the_page_does_not_quote_a_file_that_is_no_submission(run: Path) -> None:
    submitted(run).write_text("root:x:0:0:secret")
    invoke("leaderboard", run.parent)
    assert "secret" not in (run.parent / "index.html").read_text()


def test_verify_says_where_no_run_json_tells_what_the_records_are_of(run: Path) -> None:
    (run / "run.json").unlink()
    assert "split and settings of the records are unknown" in invoke("verify", run).output


def test_verify_says_how_many_records_there_should_be(run: Path) -> None:
    write_episodes(run / "split.jsonl", [episode.record.spec for episode in load_run(run)])
    shutil.rmtree(run / "e2")
    result = invoke("verify", run)
    assert (result.exit_code, "3 of 4 records" in result.output) == (0, True)


def test_a_folder_without_submissions_is_no_leaderboard(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="no submitted run"):
        leaderboard.leaderboard(tmp_path)
    with pytest.raises(RecordError, match=r"there is no folder .*nowhere"):
        leaderboard.leaderboard(tmp_path / "nowhere")


def test_a_partial_run_is_listed_apart_and_unranked(run: Path) -> None:
    submitted(run)
    part = run.parent / "part"
    shutil.copytree(run, part)
    write_episodes(part / "split.jsonl", [episode.record.spec for episode in load_run(run)])
    shutil.rmtree(part / "e0")
    assert "not complete" in str(invoke("submit", part, "--who", "Bob").exception)
    assert invoke("submit", part, "--who", "Bob", "--partial").exit_code == 0
    assert invoke("leaderboard", run.parent).exit_code == 0
    ranked, apart = page(run)
    assert ("Ada" in ranked, "Bob" in ranked, "Bob" in apart) == (True, False, True)
    assert "partial: 1 episode missing" in apart


def test_damaged_records_are_named_and_the_others_shown(run: Path) -> None:
    submitted(run)
    shutil.copytree(run, run.parent / "hurt")
    (run.parent / "hurt" / "e0" / "steps.jsonl").write_text("x\n")
    assert invoke("leaderboard", run.parent).exit_code == 0
    ranked, apart = page(run)
    assert ranked.count("Ada") == 1
    assert "e0/steps.jsonl has been changed" in apart


def test_the_page_names_the_split(tmp_path: Path) -> None:
    folder = of_smoke(tmp_path / "mine")
    submitted(folder)
    invoke("leaderboard", tmp_path)
    assert "<caption>smoke: 5 episodes, digest" in page(folder)[0]
