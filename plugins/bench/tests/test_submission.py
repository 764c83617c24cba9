"""Submissions: what the records say, in one file that gives itself away when it says something else."""

from __future__ import annotations

import json
from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result
from rollouts import COUCH, rollout, step

from humanclaw import RecordError
from humanclaw.records import EpisodeRecord, write_record
from humanclaw_bench import submission
from humanclaw_bench.cli import bench

SAT = [
    step(says="A couch is 2 m ahead.", pixels=500),
    step("sit_in_place", away=0.1, pelvis_contacts=(COUCH,)),
    step("stop", away=0.1, pelvis_contacts=(COUCH,)),
]
FAR = [step("stop", away=0.5)]


@pytest.fixture
def run(tmp_path: Path) -> Path:
    folder = tmp_path / "board" / "mine"
    for k in range(4):
        recorded = rollout(folder, SAT if k else FAR, name=f"e{k}")
        warm = {"agent": {"temperature": 0.2}, "body": {"simulator": "bullet"}}
        record = EpisodeRecord.model_validate_json((recorded.folder / "episode.json").read_bytes())
        write_record(recorded.folder, record.model_copy(update={"settings": warm}))
    (folder / "run.json").write_text(json.dumps({"episodes": 4, "split": "abc", "agent": "model"}))
    return folder


def invoke(*words: object) -> Result:
    return CliRunner().invoke(click.Group("x", {"bench": bench}), ["bench", *map(str, words)])


def submitted(run: Path) -> Path:
    path = run.parent / "mine.json"
    assert (
        invoke("submit", run, "--who", "Ada <ada@example.org>", "--model-date", "2026-11", "--out", path).exit_code == 0
    )
    return path


def test_a_submission_holds_what_was_run_and_what_came_of_it(run: Path) -> None:
    found = submission.read(submitted(run))
    assert (found.who, found.agent, found.model_date, found.temperature) == (
        "Ada <ada@example.org>",
        "model",
        "2026-11",
        0.2,
    )
    assert (found.engine, found.asked, found.run["split"]) == ("bullet", 4, "abc")
    assert found.rates["NavSR"][0] == 0.75
    assert [one.scores["interact"] for one in found.episodes] == [False, True, True, True]


def test_records_that_are_scored_again_agree_with_it(run: Path) -> None:
    result = invoke("verify", run, "--submission", submitted(run))
    assert result.exit_code == 0
    assert "agrees" in result.output


def test_a_number_that_was_changed_breaks_the_seal(run: Path) -> None:
    path = submitted(run)
    path.write_text(path.read_text().replace('"nav": false', '"nav": true').replace('"nav":false', '"nav":true'))
    with pytest.raises(RecordError, match="has been changed"):
        submission.read(path)


def test_a_number_that_was_changed_and_sealed_again_contradicts_the_records(run: Path) -> None:
    path = submitted(run)
    honest = submission.read(path)
    better = honest.episodes[0].model_copy(update={"scores": {**honest.episodes[0].scores, "nav": True}})
    rates = {**honest.rates, "NavSR": (1.0, 0.5, 1.0, 4)}
    forged = honest.model_copy(update={"episodes": (better, *honest.episodes[1:]), "rates": rates}).sealed
    path.write_text(forged.model_dump_json())
    result = invoke("verify", run, "--submission", path)
    assert result.exit_code == 1
    assert "episode e0: nav is False, not True" in result.output
    assert "rates" in result.output


def test_the_leaderboard_shows_who_and_whether_the_records_agree(run: Path) -> None:
    submitted(run)
    assert invoke("leaderboard", run.parent).exit_code == 0
    page = (run.parent / "index.html").read_text()
    assert "Ada &lt;ada@example.org&gt;" in page
    assert "75.0% [30.1, 95.4]" in page
    assert "<td>agree</td>" in page
    (run / "run.json").unlink()
    invoke("leaderboard", run.parent)
    assert "<td>not here</td>" in (run.parent / "index.html").read_text()


def test_a_folder_without_submissions_is_no_leaderboard(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="no submission"):
        submission.leaderboard(tmp_path)
