"""Two rows whose runs were played in different conditions never look alike, and each says its own."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from manifests import invoke, tell
from rollouts import COUCH, rollout, step

from humanclaw import load_run
from humanclaw.records import SkillInfo
from humanclaw_bench.conditions import conditions_of, differences, labels
from humanclaw_bench.results import named
from humanclaw_bench.scoring import scored

SAT = [
    step(says="A couch is 2 m ahead.", pixels=500),
    step("sit_in_place", away=0.1, pelvis_contacts=(COUCH,), motion_frames=60),
    step("stop", away=0.1, pelvis_contacts=(COUCH,)),
]
BODY = {
    "simulator": "bullet", "renderer": "raster", "generator": "dit", "prior": "lite", "profile": "default",
    "sensors": ["vision"],
}  # fmt: skip
SKILLS = {
    "walk": SkillInfo("locomotion", digest="a" * 64, origin="walks"), "sit_in_place": SkillInfo("sit"),
    "stop": SkillInfo("stop"),
}  # fmt: skip


def played(folder: Path, **more: Any) -> Path:
    """A run of two episodes, told by default alike."""
    record: dict[str, Any] = {"settings": {"body": BODY, "limits": {}}, "skills": SKILLS, "versions": {"walks": "1.0"}}
    for k in range(2):
        rollout(folder, SAT, name=f"e{k}", **(record | more))
    return tell(folder, backends=(record | more)["settings"]["body"], limits=(record | more)["settings"]["limits"])


def test_a_skill_that_moves_farther_than_the_papers_is_named(tmp_path: Path) -> None:
    def moved(metres: float) -> Path:
        rollout(tmp_path / str(metres), [step("walk", end=(metres, 1.0, 0.0)), step("stop")])
        return tmp_path / str(metres)

    assert rows(moved(1.0)) == ["model"]
    assert rows(moved(1.25)) == ["model, 1.25 m a call"]


def test_the_time_to_rise_before_a_step_does_not_break_the_pace(tmp_path: Path) -> None:
    rollout(tmp_path, [step("walk", motion_frames=45, rise_frames=30), step("stop")])
    assert rows(tmp_path) == ["model"]


def rows(*runs: Path) -> list[str]:
    return [row.name for row in named({str(run): scored(load_run(run)) for run in runs})]


def body(**changed: Any) -> dict[str, Any]:
    return {"settings": {"body": BODY | changed, "limits": {}}}


def test_an_option_that_the_body_has_too_is_told_once(tmp_path: Path) -> None:
    runs = [played(tmp_path / name, **body(profile=name), options={"profile": name}) for name in ("default", "paper")]
    assert rows(*runs) == [f"model, profile {name}, 2.0 s a call" for name in ("default", "paper")]


OTHER: dict[str, tuple[dict[str, Any], str, str]] = {
    "simulator": (body(simulator="mujoco"), "bullet", "mujoco"),
    "renderer": (body(renderer="gl"), "renderer raster", "renderer gl"),
    "prior": (body(prior="large"), "prior lite", "prior large"),
    "profile": (body(profile="paper"), "profile default", "profile paper"),
    "sensors": (body(sensors=["vision", "touch"]), 'sensors ["vision"]', 'sensors ["vision", "touch"]'),
    "limits": (
        {"settings": {"body": BODY, "limits": {"episode.usd": 0.5}}}, "limit episode.usd none", "limit episode.usd 0.5",
    ),
    "skill": (
        {"skills": SKILLS | {"walk": SkillInfo("locomotion", digest="b" * 64, origin="walks")}}, "skill walk aaaaaaaa",
        "skill walk bbbbbbbb",
    ),
    "version": ({"versions": {"walks": "1.1"}}, "version walks 1.0", "version walks 1.1"),
}  # fmt: skip


@pytest.mark.parametrize("what", OTHER)
def test_a_row_says_what_it_alone_was_played_with(tmp_path: Path, what: str) -> None:
    changed, mine, other = OTHER[what]
    first, second = played(tmp_path / "one"), played(tmp_path / "two", **changed)
    assert rows(first, second) == [f"model, {mine}, 2.0 s a call", f"model, {other}, 2.0 s a call"]
    assert rows(first) == ["model, 2.0 s a call"]
    conditions = [conditions_of(load_run(run)[0].record) for run in (first, second)]
    assert len(differences(*conditions)) == 1


def test_several_skills_that_differ_are_one_label(tmp_path: Path) -> None:
    other = {name: SkillInfo("locomotion", digest="c" * 64) for name in SKILLS}
    plain, changed = played(tmp_path / "one"), played(tmp_path / "two", skills=other)
    first, second = rows(plain, changed)
    assert first.startswith("model, skills ")
    assert first != second
    output = " ".join(invoke("compare", plain, changed, "--partial").output.split())
    assert "skill walk (aaaaaaaa and cccccccc)" in output


def test_models_differ_in_settings_without_a_label() -> None:
    cold, warm = {"agent temperature": "0", "simulator": "bullet"}, {"agent temperature": "1", "simulator": "bullet"}
    assert labels([("a", cold), ("b", warm)]) == ["", ""]
    assert labels([("a", cold), ("a", warm)]) == [", agent temperature 0", ", agent temperature 1"]


def test_a_comparison_says_what_differs_in_settings_before_any_rate(tmp_path: Path) -> None:
    runs = played(tmp_path / "one"), played(tmp_path / "two", **body(profile="paper"))
    text = " ".join(invoke("compare", *runs).output.split())
    assert text.index("Settings that differ (A and B): profile (default and paper).") < text.index("FindSR")
    comparison = json.loads(invoke("compare", *runs, "--json").output)
    assert comparison["settings"] == ["profile (default and paper)"]
    assert comparison["metrics"][0]["metric"] == "FindSR"
    same = " ".join(invoke("compare", runs[0], runs[0]).output.split())
    assert "No setting differs." in same


def test_a_table_tells_settings_seconds_and_the_longest_call(tmp_path: Path) -> None:
    result = json.loads(invoke("table", played(tmp_path), "--only", "main", "--no-paper", "--json").output)["main"]
    assert result["rows"][0]["motion (s)"]["value"] == 2.5  # Half a second, then two.
    assert result["rows"][0]["steps"]["value"] == 3
    (note,) = [note for note in result["notes"] if note.startswith("model, 2.0 s a call: ")]
    assert (
        'Played with bullet, renderer raster, generator dit, prior lite, profile default, sensors ["vision"], no limits'
        in note
    )
    assert "3 skills (" in note
    assert (
        "Not at the paper's pace: a call moves the body for up to 2.0 s, and by up to 0.00 m in half a second." in note
    )
    assert result["rows"][0]["agent"] == "model, 2.0 s a call"


def test_a_leaderboard_tells_settings_and_seconds_of_motion(tmp_path: Path) -> None:
    for name, more in {"one": {}, "two": body(profile="paper")}.items():
        run = played(tmp_path / name, **more)
        assert invoke("submit", run, "--who", name).exit_code == 0
    invoke("leaderboard", tmp_path)
    apart = (tmp_path / "index.html").read_text().partition("Not ranked")
    assert "profile" not in apart[0]
    assert apart[2].count("not at the paper&#39;s pace (2.5, at most 2.0 a call") == 2
    invoke("leaderboard", tmp_path, "--any-pace")
    page = (tmp_path / "index.html").read_text()
    assert "Not ranked" not in page
    assert page.count("profile default</summary>") == 1
    assert page.count("profile paper</summary>") == 1
    assert page.count("<dd>2.5, at most 2.0 a call, 0.00 m in half a second</dd>") == 2
