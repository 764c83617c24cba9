"""Scores are kept for the next command, as long as the record and the code are the same."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from rollouts import rollout, step

from humanclaw import RecordedEpisode, load_run
from humanclaw_bench import scoring
from humanclaw_bench.scores import Scores, score
from humanclaw_bench.scoring import Measured, scored

FAR = [step(away=3.0), step("stop", away=3.0)]
NEAR = [step(away=0.1), step("stop", away=0.1)]


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[str]:
    """Names of the episodes whose scores were computed, with a cache that is empty at first."""
    monkeypatch.setenv("HUMANCLAW_CACHE", str(tmp_path / "cache"))
    names = list[str]()

    def watched(recorded: RecordedEpisode) -> Scores:
        names.append(recorded.record.spec.id)
        return score(recorded)

    monkeypatch.setattr(scoring, "score", watched)
    return names


@pytest.fixture
def run(tmp_path: Path) -> Path:
    for name in ("a", "b"):
        rollout(tmp_path / "run", FAR, name=name)
    return tmp_path / "run"


def test_an_unchanged_record_is_scored_once(run: Path, computed: list[str]) -> None:
    first, again = scored(load_run(run)), scored(load_run(run))
    assert (computed, repr(again)) == (["a", "b"], repr(first))


def test_a_changed_record_alone_is_scored_anew(run: Path, computed: list[str]) -> None:
    scored(load_run(run))
    shutil.rmtree(run / "a")
    rollout(run, NEAR, name="a")
    (changed, _), (same, _) = scored(load_run(run))
    assert (computed, changed.nav, same.nav) == (["a", "b", "a"], True, False)


def test_changed_code_scores_everything_anew(run: Path, computed: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    scored(load_run(run))
    monkeypatch.setattr(scoring, "source_digest", lambda *sources: "other code")
    scored(load_run(run))
    assert computed == ["a", "b"] * 2


def test_a_changed_metric_of_a_plugin_measures_anew(run: Path, computed: list[str]) -> None:
    def measured(value: float) -> list[float]:
        pairs = scored(load_run(run), {"mine": Measured("mine", "me", lambda recorded: value)})
        return [scores.extra["mine"] for scores, _ in pairs]

    assert (measured(1.0), measured(2.0), computed) == ([1.0] * 2, [2.0] * 2, ["a", "b"])


def test_an_episode_with_company_is_scored_anew(tmp_path: Path, computed: list[str]) -> None:
    """Its score reads the record of the other, too, which may change."""
    rollout(tmp_path / "run", FAR, name="a", company=("a", "b"))
    scored(load_run(tmp_path / "run"))
    scored(load_run(tmp_path / "run"))
    assert computed == ["a"] * 2
