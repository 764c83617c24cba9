"""Submissions state the numbers of the records, and contradictions are detected."""

from __future__ import annotations

import html
import json
import os
import re
import shutil
import subprocess
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
from humanclaw_bench import leaderboard, submission
from humanclaw_bench.cli import bench
from humanclaw_bench.integrity import split_digest
from humanclaw_bench.signing import signer
from humanclaw_bench.splits import load_split, repeated

SAT = [
    step(says="A couch is 2 m ahead.", pixels=500),
    step("sit_in_place", away=0.1, pelvis_contacts=(COUCH,)),
    step("stop", away=0.1, pelvis_contacts=(COUCH,)),
]
FAR = [step("stop", away=0.5)]
WARM = {"agent": {"temperature": 0.2}, "body": {"simulator": "bullet"}}


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("kept")
    for k in range(4):
        recorded = rollout(folder, SAT if k else FAR, name=f"e{k}")
        rewrite(folder, recorded.record.spec.id, settings=WARM)
    return tell(folder, agent="model")


@pytest.fixture
def run(kept: Path, tmp_path: Path) -> Path:
    return shutil.copytree(kept, tmp_path / "board" / "mine")


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
    assert (found.engine, found.asked, found.run["agent"]) == ("bullet", 4, "model")
    assert found.rates["NavSR"][0] == 0.75
    assert [one.scores.interact for one in found.episodes] == [False, True, True, True]


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
    better = honest.episodes[0].model_copy(
        update={"scores": honest.episodes[0].scores.model_copy(update={"nav": True})}
    )
    rates = {**honest.rates, "NavSR": (1.0, 0.5, 1.0, 4)}
    forged = honest.model_copy(update={"episodes": (better, *honest.episodes[1:]), "rates": rates}).sealed
    path.write_text(forged.model_dump_json())
    result = invoke("verify", run, "--submission", path)
    assert result.exit_code == 1
    assert "episode e0: nav is False, not True" in result.output
    assert "rates" in result.output


def forged(run: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """Change a submission and seal it again."""
    path = submitted(run)
    content = json.loads(path.read_text())
    change(content)
    path.write_text(submission.Submission.model_validate(content).sealed.model_dump_json())
    return path


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda it: it["episodes"].append(it["episodes"][0]), "episode e0 is there 2 times"),
        (lambda it: it["episodes"][0].update(seed=5), "episode e0: seed is 0, not 5"),
        (lambda it: it["episodes"][0].update(seed=5), "seeds are not those of its episodes"),
        (lambda it: it.update(asked=3), "asked is 4, not 3"),
    ],
)
def test_an_episode_that_is_there_twice_or_with_another_seed_contradicts(run: Path, change: Any, words: str) -> None:
    result = invoke("verify", run, "--submission", forged(run, change))
    assert (result.exit_code, words in result.output) == (1, True)


# -- a run that is not what it says ------------------------------------------------------------------------------------
def keep_successes(run: Path) -> None:
    """Take the failures out, and say in run.json that the rest is all."""
    write_episodes(run / "split.jsonl", [one.record.spec for one in load_run(run)])
    shutil.rmtree(run / "e0")
    say(run, episodes=3)


def keep_successes_alone(run: Path) -> None:
    keep_successes(run)
    (run / "split.jsonl").unlink()


def say(run: Path, **what: Any) -> None:
    told = json.loads((run / "run.json").read_text())
    (run / "run.json").write_text(json.dumps(told | what))


def rewrite(run: Path, name: str, spec: dict[str, Any] | None = None, **changes: Any) -> None:
    """Change a record as if it had been written so."""
    record = EpisodeRecord.model_validate_json((run / name / "episode.json").read_bytes())
    write_record(run / name, record.model_copy(update={"spec": record.spec.model_copy(update=spec or {}), **changes}))


def unseal(run: Path) -> None:
    path = run / "e1" / "episode.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"seal": "", "files": {}}))


def another_start(run: Path) -> None:
    write_episodes(run / "split.jsonl", [one.record.spec for one in load_run(run)])
    rewrite(run, "e1", {"start": Pose2D(x=1.5, z=1.2, yaw=2.0), "seed": 99, "max_steps": 2})


def other_options(run: Path) -> None:
    say(run, options={"history": 4})


def another_engine(run: Path) -> None:
    say(run, backends={"simulator": "mujoco"})


def other_limits(run: Path) -> None:
    """Limits of a run hold for a session, and so may be others in each; those of an episode may not."""
    for name in ("e0", "e1", "e2", "e3"):
        rewrite(run, name, settings=WARM | {"limits": {"episode.usd": 0.5, "run.usd": float(name[1]) + 1}})
    say(run, limits={"episode.usd": 0.5})
    assert invoke("verify", run).exit_code == 0
    rewrite(run, "e2", settings=WARM | {"limits": {"episode.usd": 5}})


def other_choice(run: Path) -> None:
    for name in ("e0", "e1", "e2", "e3"):
        rewrite(run, name, settings=WARM | {"plugins": {"without": ["climb_upstairs"]}})
    say(run, choice={"prefer": [], "without": ["climb_upstairs"], "skills": []})
    assert invoke("verify", run).exit_code == 0
    rewrite(run, "e2", settings=WARM)


def other_skills(run: Path) -> None:
    """An episode of another run, played by a walk with other weights."""
    for name in ("e0", "e1", "e2", "e3"):
        rewrite(run, name, skills={"walk": SkillInfo("locomotion", digest="b" if name == "e2" else "a")})


def half_checked(run: Path) -> None:
    """A verifier in half of the episodes; run.json tells that there was one."""
    for name in ("e0", "e1", "e2", "e3"):
        rewrite(run, name, verifier="weak" if name == "e3" else "strong")
    say(run, verifier="strong")


def half_warm(run: Path) -> None:
    rewrite(run, "e3", settings=WARM | {"agent": {"temperature": 1.5}})


def two_engines(run: Path) -> None:
    """Half of the episodes on another engine, and run.json holds nothing to any."""
    rewrite(run, "e3", settings=WARM | {"body": {"simulator": "mujoco"}})
    say(run, backends={})


def foreign_skill(run: Path) -> None:
    for name in ("e0", "e1", "e2", "e3"):
        rewrite(run, name, skills={"leap": SkillInfo("locomotion", digest="a", origin="C:\\mine\\leap.py")})
    say(run, **{"plugin files": {"leap.py": "0" * 64}})
    assert invoke("verify", run).exit_code == 0
    say(run, **{"plugin files": {}})


def best_of_two(run: Path) -> None:
    """The record of another attempt, in a run whose journal saw this one end otherwise."""
    end = {"episode": "e1", "outcome": "stopped", "limit": "", "steps": 3}
    (run / "journal.jsonl").write_text(json.dumps(end))
    assert invoke("verify", run).exit_code == 0
    (run / "journal.jsonl").write_text(json.dumps(end | {"steps": 1}))


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
    (unseal, "e1/episode.json has no seal"),
    (another_start, "e1 is not of this run: start, max_steps, seed."),
    (other_options, "e0 is not of this run: options."),
    (another_engine, "e0 is not of this run: backends simulator."),
    (other_limits, "e2 is not of this run: limits."),
    (half_checked, "e3 is not of this run: verifier of the others."),
    (half_warm, "e3 is not of this run: temperature of the others."),
    (two_engines, "e0 is not of this run: backends simulator."),
    (foreign_skill, "e0 is not of this run: plugin files."),
    (
        best_of_two,
        "e1 is not the record that was made last: stopped after 3 steps; by the journal stopped after 1 step.",
    ),
    (other_choice, "e2 is not of this run: choice of plugins."),
    (other_skills, "e2 is not of this run: skills of the others."),
]


@pytest.mark.parametrize(("tamper", "words"), TAMPERED)
def test_a_run_that_is_not_what_it_says_is_named_everywhere(run: Path, tamper: Any, words: str) -> None:
    honest = submitted(run)
    tamper(run)
    verified = invoke("verify", run, "--submission", honest)
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
    ranked, _, apart = text.partition("<caption>Not ranked")
    return ranked, apart


@pytest.mark.parametrize("name", ["val", "val-400", "mini", "smoke"])
def test_a_part_of_a_split_of_the_benchmark_is_held_to_it_without_a_file(tmp_path: Path, name: str) -> None:
    split = load_split(name)
    rollout(tmp_path, FAR, name=split[2].id)
    rewrite(tmp_path, split[2].id, dict(split[2]))
    tell(tmp_path, episodes=len(split), split=split_digest(split))
    assert invoke("verify", tmp_path).exit_code == 0
    rewrite(tmp_path, split[2].id, {"seed": 10_000})
    assert "is not of this run: seed." in invoke("verify", tmp_path).output


ODD = ["{", "[1]", "null", "{}", "[" * 100_000, '{"episodes": 4}', '{"split": "a", "episodes": 4, "options": 1}']
WHOLE = {"split": "a", "episodes": 4, "options": {}, "verifier": "", "limits": {}, "backends": {}, "versions": {}}
ODD += [json.dumps(WHOLE), json.dumps(WHOLE | {"weights": {}, "verifier": None})]
ODD += [f'{{"split": "a", "episodes": {odd}}}' for odd in ('"many"', "null", "-5", "true", "1e400")]


@pytest.mark.parametrize("text", ODD)
@pytest.mark.parametrize("command", [("table",), ("submit", "--who", "x"), ("verify",)])
def test_an_odd_run_json_is_named(run: Path, command: tuple[str, ...], text: str) -> None:
    (run / "run.json").write_text(text)
    result = invoke(command[0], run, *command[1:])
    assert isinstance(result.exception, RecordError)
    assert "run.json is damaged" in str(result.exception)


# -- the page ----------------------------------------------------------------------------------------------------------
def test_the_leaderboard_shows_who_and_whether_the_records_agree(run: Path) -> None:
    submitted(run)
    assert invoke("leaderboard", run.parent).exit_code == 0
    page = (run.parent / "index.html").read_text()
    assert "Ada &lt;ada@example.org&gt;" in page
    assert re.search(r"75\.0% \[30\.1, 95\.4\]<span class='bar'><span style='left:30\.1%;width:65\.\d%'>", page)
    assert "<span class='told'>agree</span>" in page
    assert "<dt>verifier</dt>" in page
    assert "<i style='left:75.0%'></i>" in page  # The mark at the rate.
    assert "<title>HumanCLAW-Bench: not one of the benchmark&#x27;s</title>" in page
    assert re.findall("<th scope='col'>([^<]*)", page)[:3] == ["agent", "InteractSR", "records"]
    assert page.index("</table>") < page.index("confidence intervals")
    shutil.rmtree(run)
    invoke("leaderboard", run.parent)
    assert "<span class='told'>not here</span>" in (run.parent / "index.html").read_text()


def test_a_row_links_to_the_page_that_the_board_wrote_and_to_no_other(run: Path) -> None:
    forged(run, lambda it: it["run"].update(page="https://example.org/"))
    for name in ("report.html", "evil.html", "e0/evil.js", "e0/film.gif"):
        (run / name).write_text("brought along")
    shutil.copytree(run, run.parent / "o'f: <x>")
    honest = submitted(run)
    shutil.copy(honest, run.parent / "o'f: <x>.json")
    shutil.copy(honest, run.parent / "told.json")
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
    assert (site / "index.html").read_text().count("the same records as") == 3
    shutil.copy(honest, run.parent / "played again the same.json")
    invoke("leaderboard", run.parent)
    assert "class='good'" not in page(run)[0]
    assert invoke("verify", run, "--submission", honest).exit_code == 0


@pytest.mark.parametrize("name", ["...json", "..json"])
def test_a_submission_of_dots_alone_names_no_run_and_nothing_above_the_board_is_touched(run: Path, name: str) -> None:
    told = submitted(run)
    board = run / "board"
    board.mkdir()
    shutil.copy(told, board / name)
    invoke("leaderboard", "--pages", board / "site", board)
    text = (board / "site" / "index.html").read_text()
    assert "has a name of dots alone" in text
    assert "href" not in text
    assert [path.name for path in (board / "site").iterdir()] == ["index.html"]


@pytest.mark.parametrize("name", ["index.html", "INDEX.HTML"])
def test_a_submission_named_as_the_board_itself_is_to_be_renamed_and_the_others_are_shown(run: Path, name: str) -> None:
    shutil.copy(submitted(run), run.parent / f"{name}.json")
    shutil.copytree(run, run.parent / name)
    site = run.parent / "site"
    assert invoke("leaderboard", "--pages", site, run.parent).exit_code == 0
    text = (site / "index.html").read_text()
    assert re.search(r"Not read: \S+\.json has the name of the board&#x27;s own page. Rename it", text, re.IGNORECASE)
    assert "mine/report.html" in text
    if name == "index.html":
        assert "Name another folder with --pages" in str(invoke("leaderboard", run.parent).exception)


def test_a_page_that_cannot_be_written_is_told_and_the_row_stays(run: Path) -> None:
    submitted(run)
    site = run.parent / "site"
    (site / "mine" / "report.html" / "x").mkdir(parents=True)
    assert invoke("leaderboard", "--pages", site, run.parent).exit_code == 0
    assert "<span class='told'>agree; page not written</span>" in (site / "index.html").read_text()


@slow
@looks
def test_the_leaderboard_fits_and_has_no_serious_barrier(run: Path, size: dict[str, int], scheme: str) -> None:
    submitted(run)
    invoke("leaderboard", "--pages", run.parent / "site", run.parent)
    with browsing() as browser:
        tab, errors = opened(browser, run.parent / "site" / "index.html", size, scheme, ready="true")
        assert not barriers(tab)
        assert not errors


def test_a_privileged_decider_is_called_so_under_the_table_in_the_submission_and_on_the_leaderboard(run: Path) -> None:
    submitted(run)
    invoke("leaderboard", run.parent)
    assert "rivileged" not in invoke("table", run, "--format", "markdown").output + page(run)[0]
    for one in load_run(run):
        told = {**one.record.settings, "privileged": {"agent": True}}
        rewrite(run, one.folder.name, settings=told)
    assert "Privileged (knows scene and true state): agent." in invoke("table", run, "--format", "markdown").output
    path = submitted(run)
    assert {one.scores.privileged for one in submission.read(path).episodes} == {"agent"}
    invoke("leaderboard", run.parent)
    assert "model (privileged)" in page(run)[0]
    path.write_text(hide(submission.read(path)).model_dump_json())
    assert "privileged is 'agent', not ''" in invoke("verify", run, "--submission", path).output


def hide(told: submission.Submission) -> submission.Submission:
    """Leave out of a submission that anybody was privileged."""
    scores = [one.scores.model_copy(update={"privileged": ""}) for one in told.episodes]
    episodes = tuple(one.model_copy(update={"scores": s}) for one, s in zip(told.episodes, scores, strict=True))
    return told.model_copy(update={"episodes": episodes}).sealed


def test_numbers_that_are_only_told_have_a_table_of_their_own(run: Path) -> None:
    honest = submitted(run)
    told = submission.read(honest).model_copy(update={"who": "Eve"}).sealed
    (run.parent / "eve.json").write_text(told.model_dump_json())
    invoke("leaderboard", run.parent)
    first, second = page(run)[0].split("</table>")[:2]
    assert ("Ada" in first, "Eve" in first) == (True, False)
    assert "scored again from the records" in first
    assert ("Ada" in second, "Eve" in second) == (False, True)
    assert "as told: nobody here has the records" in second


def of_mini(it: dict[str, Any]) -> None:
    it["run"]["split"] = split_digest(load_split("mini"))


def of_mini_whole(it: dict[str, Any]) -> None:
    of_mini(it)
    it["asked"] = it["run"]["episodes"] = 100


def rates(*values: float) -> Callable[[dict[str, Any]], None]:
    return lambda it: it["rates"].update(InteractSR=[*values, 3])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (rates(1.0, 0.9, 1.0), "InteractSR is 1 of 3 by its rates, and 0.75 of 4 by its episodes"),
        (lambda it: it["rates"].pop("NavSR"), "NavSR is not among its rates, and 0.75 of 4 by its episodes"),
        (
            lambda it: it["rates"].update(NavSR=[0.75, 0.75, 0.75, 4]),
            "NavSR has the interval 0.75 to 0.75, and 0.300642 to 0.954413 by its episodes",  # Wilson's of 3 in 4.
        ),
        (lambda it: it.update(cost=100.0), "cost is 100, and 0 by its episodes"),
        (lambda it: it.update(tokens=7), "tokens are 7, and 0 by its episodes"),
        (of_mini, "asked is 4, and split mini has 100"),
        (of_mini_whole, "episode e0 is not of split mini"),
        (lambda it: it.update(episodes=[], seeds=[]), "FindSR is 0.75 of 4 by its rates, and 0 of 0 by its episodes"),
    ],
)
def test_numbers_that_contradict_themselves_are_not_ranked_though_nobody_has_the_records(
    run: Path, change: Any, words: str
) -> None:
    forged(run, change)
    shutil.rmtree(run)
    assert invoke("leaderboard", run.parent).exit_code == 0
    ranked, apart = page(run)
    assert "Ada" not in ranked
    assert words in html.unescape(apart)


def of_smoke(folder: Path, times: int = 1) -> Path:
    """Records of all episodes of a split of the benchmark, of each so many."""
    for spec in repeated(load_split("smoke"), times):
        rollout(folder, FAR, name=spec.id)
        rewrite(folder, spec.id, dict(spec))
    return tell(folder, agent="model")


BED = next(spec for spec in load_split("smoke") if spec.target_category == "bed")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda bed: bed.update(seed=BED.seed + 1), f"{BED.id} has seed {BED.seed} in split smoke, not {BED.seed + 1}"),
        (lambda bed: bed["scores"].update(scene="house:99"), f"is in {BED.scene} in split smoke, not in 'house:99'"),
        (lambda bed: bed["scores"].update(interact=None), f"{BED.id} is to sit down in split smoke"),
    ],
)
def test_an_episode_that_is_told_otherwise_than_its_split_has_it_is_not_ranked(
    tmp_path: Path, change: Any, words: str
) -> None:
    run = of_smoke(tmp_path / "board" / "mine")

    def tell_otherwise(it: dict[str, Any]) -> None:
        change(next(one for one in it["episodes"] if one["id"] == BED.id))
        it["seeds"] = sorted(one["seed"] for one in it["episodes"])

    forged(run, tell_otherwise)
    shutil.rmtree(run)
    invoke("leaderboard", run.parent)
    ranked, apart = page(run)
    assert "Ada" not in ranked
    assert words in html.unescape(apart)


@pytest.mark.parametrize(
    ("number", "bad"),
    [
        ("cost", "abc"), ("cost", [1]), ("cost", -50.0), ("cost", 1e308), ("tokens_in", 10**400), ("tokens_out", -1),
        ("tokens_in", 0.5), ("false_claims", -3.5), ("false_claims", "1"), ("find", "no"), ("nav", "false"),
        ("interact", [0]), ("scene", 5), ("outcome", None),
    ],
)  # fmt: skip
def test_an_episode_with_a_number_that_is_none_is_no_submission(run: Path, number: str, bad: object) -> None:
    path = submitted(run)
    content = json.loads(path.read_text())
    content["episodes"][1]["scores"][number] = bad
    path.write_text(json.dumps(content))
    invoke("leaderboard", run.parent)
    assert f"is not a submission: episodes.1.scores.{number}: " in "".join(page(run))


@pytest.mark.parametrize(
    ("key", "bad"), [("asked", -(10**400)), ("made", "9999-99-99"), ("who", "x" * 501), ("who", " ")]
)
def test_a_submission_that_says_something_odd_is_none(run: Path, key: str, bad: object) -> None:
    path = submitted(run)
    path.write_text(json.dumps(json.loads(path.read_text()) | {key: bad}))
    invoke("leaderboard", run.parent)
    assert f"is not a submission: {key}: " in "".join(page(run))


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
    os.mkfifo(run.parent / "pipe.json")
    (run.parent / os.fsdecode(b"\xff.json")).write_text("nope")
    assert invoke("leaderboard", run.parent).exit_code == 0
    assert page(run)[0].count("is not a submission") == 2


def test_a_temperature_that_is_no_number_is_not_told(run: Path) -> None:
    for name in ("e0", "e1", "e2", "e3"):
        rewrite(run, name, settings=WARM | {"agent": {"temperature": "default"}})
    assert submission.read(submitted(run)).temperature is None
    invoke("leaderboard", run.parent)
    assert "<span class='told'>agree</span>" in page(run)[0]


def test_a_run_whose_host_has_no_journal_agrees(run: Path) -> None:
    end = {"episode": "e0", "outcome": "stopped", "limit": "", "steps": 1}
    (run / "journal.jsonl").write_text(f"{json.dumps(end)}\n{json.dumps(end)}\n")
    told = submitted(run)
    (run / "journal.jsonl").unlink()
    assert invoke("verify", run, "--submission", told).exit_code == 0
    invoke("leaderboard", run.parent)
    assert "4 of 4, 1 played again" in page(run)[0]


def test_the_page_tells_what_a_run_was_played_with(run: Path) -> None:
    for name in ("e0", "e1", "e2", "e3"):
        rewrite(run, name, verifier="judge", options={"profile": "paper"})
    tell(run, **{"plugin files": {"mine.py": "0" * 64}})
    submitted(run)
    invoke("leaderboard", run.parent)
    row = html.unescape(page(run)[0])
    assert "<dd>judge</dd>" in row
    assert 'options {"profile": "paper"}; plugin files {"mine.py": "' in row


def test_invented_episodes_do_not_stand_beside_those_of_a_split_played_twice(tmp_path: Path) -> None:
    folder = of_smoke(tmp_path / "mine", times=2)
    split = json.loads((folder / "run.json").read_text())["split"]
    submitted(folder)
    rollout(tmp_path / "eve", SAT, name="x")
    tell(tmp_path / "eve", split=split_digest([one.record.spec for one in load_run(tmp_path / "eve")]))
    invoke("submit", tmp_path / "eve", "--who", "Eve", "--out", tmp_path / "eve.json")
    content = json.loads((tmp_path / "eve.json").read_text())
    content["run"]["split"] = split
    (tmp_path / "eve.json").write_text(submission.Submission.model_validate(content).sealed.model_dump_json())
    shutil.rmtree(tmp_path / "eve")
    invoke("leaderboard", tmp_path)
    tables = page(folder)[0].split("</table>")
    assert [table for table in tables if "Ada" in table and "Eve" in table] == []
    assert any("1 episode, split" in table and "Eve" in table for table in tables)


def test_the_page_names_a_split_of_which_each_episode_was_played_twice(tmp_path: Path) -> None:
    folder = of_smoke(tmp_path / "mine", times=2)
    submitted(folder)
    invoke("leaderboard", tmp_path)
    assert "<caption>smoke, each 2 times: 10 episodes, split " in page(folder)[0]


@pytest.mark.parametrize("bad", ["NaN", "Infinity", '"NaN"', "1e999", "-5.0"])
def test_what_is_no_number_is_no_submission(run: Path, bad: str) -> None:
    path = submitted(run)
    path.write_text(re.sub(r'"cost": [0-9.]+,\n "tokens"', f'"cost": {bad},\n "tokens"', path.read_text()))
    with pytest.raises(RecordError, match="is not a submission: cost"):
        submission.read(path)


def test_false_claims_that_are_whole_numbers_are_shown_too(run: Path) -> None:
    def always(it: dict[str, Any]) -> None:
        for one in it["episodes"]:
            one["scores"]["false_claims"] = 1

    forged(run, always)
    shutil.rmtree(run)
    invoke("leaderboard", run.parent)
    assert "<dd>100.0%</dd>" in page(run)[0]


def test_what_would_steer_a_terminal_is_not_on_the_page(run: Path) -> None:
    forged(run, lambda it: it.update(who="Eve\x1b[31m\u202e"))
    invoke("leaderboard", run.parent)
    text = (run.parent / "index.html").read_text()
    assert ("Eve" in text, "\x1b" in text, "\u202e" in text) == (True, False, False)


def test_a_number_that_no_float_can_hold_stops_nothing(run: Path) -> None:
    path = forged(run, lambda it: it["episodes"][1]["scores"].update(jerk=10**400))
    assert "episode e1: jerk is" in invoke("verify", run, "--submission", path).output
    path.write_text(path.read_text().replace('"tokens":0,', f'"tokens":{10**400},'))
    invoke("leaderboard", run.parent)
    assert "is not a submission: tokens" in page(run)[1] + page(run)[0]


def test_the_page_does_not_quote_a_file_that_is_no_submission(run: Path) -> None:
    submitted(run)
    (run.parent / "link.json").write_text("root:x:0:0:secret")
    invoke("leaderboard", run.parent)
    assert "secret" not in (run.parent / "index.html").read_text()


def test_an_episode_that_was_thrown_away_and_played_once_more_is_told_of_everywhere(run: Path) -> None:
    ends = [("e0", "stopped", 3), ("e1", "interrupted", 1), ("e1", "stopped", 3), ("e0", "stopped", 1)]
    lines = [json.dumps({"episode": name, "outcome": outcome, "limit": "", "steps": n}) for name, outcome, n in ends]
    (run / "journal.jsonl").write_text("\n".join(lines))
    assert submission.read(submitted(run)).again == 1
    verified = invoke("verify", run)
    assert (verified.exit_code, "'e0' was played more than once from its first step" in verified.output) == (0, True)
    assert "'e1' was" not in verified.output
    assert "Played more than once from the first step: 1." in invoke("table", run, "--format", "markdown").output
    invoke("leaderboard", run.parent)
    assert "4 of 4, 1 played again" in page(run)[0]


TORN = ["{", "[]", "{}", '{"episode": "e0"}', "[" * 100_000, "", '{"time": 1, "epis']
TORN += [json.dumps({"episode": "e0", "outcome": "stopped", "limit": "", "steps": float("inf")})]


@pytest.mark.parametrize("torn", TORN)
def test_a_torn_line_of_the_journal_tells_of_nothing_and_the_others_count(run: Path, torn: str) -> None:
    end = json.dumps({"episode": "e0", "outcome": "stopped", "limit": "", "steps": 1})
    (run / "journal.jsonl").write_text(f"{end}\n{torn}\n{end}\n{torn}")
    assert "Played more than once from the first step: 1." in invoke("table", run, "--format", "markdown").output


def test_verify_names_no_episode_of_a_journal_so_that_it_looks_like_a_line_of_its_own(run: Path) -> None:
    end = json.dumps({"episode": "x\n9 records: all whole.\x1b[2J", "outcome": "stopped", "limit": "", "steps": 1})
    (run / "journal.jsonl").write_text(f"{end}\n{end}")
    assert [line for line in invoke("verify", run).output.splitlines() if line.startswith("9 records")] == []
    assert "\x1b" not in invoke("verify", run).output


def test_verify_holds_the_folder_of_an_episode_and_one_of_runs_to_their_run_json(run: Path) -> None:
    assert "nothing tells" not in invoke("verify", run / "e0").output
    assert "nothing tells" not in invoke("verify", run.parent).output


def test_verify_says_where_no_run_json_tells_what_the_records_are_of(run: Path) -> None:
    (run / "run.json").unlink()
    assert "split and settings of the records are unknown" in invoke("verify", run).output


def test_verify_says_how_many_records_there_should_be(run: Path) -> None:
    write_episodes(run / "split.jsonl", [one.record.spec for one in load_run(run)])
    shutil.rmtree(run / "e2")
    result = invoke("verify", run)
    assert (result.exit_code, "3 of 4 records" in result.output) == (0, True)


def test_a_folder_without_submissions_is_no_leaderboard(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="no submission"):
        leaderboard.leaderboard(tmp_path)
    with pytest.raises(RecordError, match=r"there is no folder .*nowhere"):
        leaderboard.leaderboard(tmp_path / "nowhere")


def test_a_partial_run_and_one_that_its_records_contradict_are_listed_apart_and_unranked(run: Path) -> None:
    honest = submitted(run)
    shutil.copytree(run, run.parent / "part")
    write_episodes(run.parent / "part" / "split.jsonl", [one.record.spec for one in load_run(run)])
    shutil.rmtree(run.parent / "part" / "e0")
    made = invoke("submit", run.parent / "part", "--who", "Bob", "--partial", "--out", run.parent / "part.json")
    assert made.exit_code == 0
    better = submission.read(honest).model_copy(update={"who": "Eve", "cost": 9.0}).sealed
    (run.parent / "eve.json").write_text(better.model_dump_json())
    shutil.copytree(run, run.parent / "eve")
    assert invoke("leaderboard", run.parent).exit_code == 0
    ranked, apart = page(run)
    assert ("Ada" in ranked, "Bob" in ranked, "Eve" in ranked) == (True, False, False)
    assert "partial: 1 episode missing" in apart
    assert "contradicted: cost is 9, and 0 by its episodes" in apart


def test_damaged_records_and_a_file_that_is_no_submission_are_named_and_the_others_shown(run: Path) -> None:
    submitted(run)
    shutil.copytree(run, run.parent / "hurt")
    shutil.copy(run.parent / "mine.json", run.parent / "hurt.json")
    (run.parent / "hurt" / "e0" / "steps.jsonl").write_text("x\n")
    (run.parent / "list.json").write_text("[]")
    assert invoke("leaderboard", run.parent).exit_code == 0
    ranked, apart = page(run)
    assert ranked.count("Ada") == 1
    assert "e0/steps.jsonl has been changed" in apart
    assert "list.json is not a submission" in apart


def test_the_page_names_the_split(tmp_path: Path) -> None:
    folder = of_smoke(tmp_path / "mine")
    submitted(folder)
    invoke("leaderboard", tmp_path)
    assert "<caption>smoke: 5 episodes, split" in page(folder)[0]


@pytest.fixture
def keys(tmp_path: Path) -> Path:
    """A folder with the keys of Ada, whom `allowed` names, and of Eve."""
    if not shutil.which("ssh-keygen"):
        pytest.skip("OpenSSH is not installed")
    for name in ("ada", "eve"):
        command = ["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", name, "-f", str(tmp_path / name)]
        subprocess.run(command, check=True)
    (tmp_path / "allowed").write_text(f"ada@example.org {(tmp_path / 'ada.pub').read_text()}")
    return tmp_path


def sign(key: Path, path: Path, purpose: str = "humanclaw") -> None:
    command = ["ssh-keygen", "-q", "-Y", "sign", "-n", purpose, "-f", str(key), str(path)]
    subprocess.run(command, check=True, capture_output=True)


@pytest.mark.integration
def test_a_signed_submission_names_its_signer(run: Path, keys: Path) -> None:
    path = submitted(run)
    sign(keys / "ada", path)
    done = invoke("verify", run, "--submission", path, "--signers", keys / "allowed")
    assert done.exit_code == 0
    assert "is signed by ada@example.org." in done.output


@pytest.mark.integration
def test_what_is_compared_is_what_was_signed(run: Path, keys: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = submitted(run)
    sign(keys / "ada", path)

    def swapped(*given: Any) -> str:
        name = signer(*given)
        path.write_text("{}")
        return name

    monkeypatch.setattr("humanclaw_bench.checking.signer", swapped)
    done = invoke("verify", run, "--submission", path, "--signers", keys / "allowed")
    assert "agrees with them." in done.output


@pytest.mark.integration
@pytest.mark.parametrize(("who", "purpose", "then"), [("", "", ""), ("eve", "humanclaw", ""), ("ada", "file", ""),
                                                      ("ada", "humanclaw", " ")])  # fmt: skip
def test_no_other_signature_counts(run: Path, keys: Path, who: str, purpose: str, then: str) -> None:
    path = submitted(run)
    if who:
        sign(keys / who, path, purpose)
    path.write_text(path.read_text() + then)
    done = invoke("verify", run, "--submission", path, "--signers", keys / "allowed")
    assert isinstance(done.exception, RecordError)
    assert "is not signed by anybody in" in str(done.exception)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes")
def test_a_pipe_in_the_place_of_a_signature_is_none(tmp_path):
    (tmp_path / "one.json").write_text("{}")
    (tmp_path / "allowed").write_text("")
    os.mkfifo(tmp_path / "one.json.sig")
    with pytest.raises(RecordError, match="is not signed by anybody"):
        signer(tmp_path / "one.json", b"{}", tmp_path / "allowed")
