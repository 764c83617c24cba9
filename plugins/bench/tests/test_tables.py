"""Tables in each format, and the commands that print them."""

from __future__ import annotations

import io
import json
import shutil
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hosting import plugin
from manifests import invoke, tell
from PIL import ImageColor
from rollouts import COUCH, rollout, step

from humanclaw import PluginError, Plugins, RecordedEpisode, load_run
from humanclaw.cli import Console
from humanclaw.records import Difficulty, write_episodes
from humanclaw.world import GAZES
from humanclaw_bench.attribution import CAUSES, STAGES, attribute
from humanclaw_bench.failures import FACULTIES, GREY, NAME, WIDE, picture
from humanclaw_bench.metrics import ALL, MAIN, compare, estimate
from humanclaw_bench.overview import overview
from humanclaw_bench.results import Result as Scored, named
from humanclaw_bench.scores import Scores, score
from humanclaw_bench.scoring import metrics_of, scored
from humanclaw_bench.statistics import Difference, wilson
from humanclaw_bench.tables import Column, ResultTable, all_tables, factors_table, paper_results, result_table
from humanclaw_bench.writers import compare_table, compared, latex, markdown, terminal, texts, verdict

SEE = "A couch is 2 m ahead."
FOUND = step(says=SEE, pixels=500, end=(1.0, 1.0, 0.0))
SAT = [
    FOUND,
    step("sit_in_place", away=0.1, pelvis_contacts=(COUCH,)),
    step("stop", away=0.1, pelvis_contacts=(COUCH,)),
]
FAR = [FOUND, step("stop", away=0.5)]


def write_run(folder: Path, sat: int, far: int, broken: int = 0, **more: object) -> Path:
    for k in range(sat + far + broken):
        steps = SAT if k < sat else FAR
        rollout(folder, steps, name=f"e{k:02}", outcome="infra_error" if k >= sat + far else "", **more)  # type: ignore[arg-type]
    return tell(folder)


@pytest.fixture
def base(tmp_path: Path) -> Scores:
    return replace(score(rollout(tmp_path / "base", SAT)), conditions={})


def results_of(base: Scores, *agents: str) -> tuple:
    far = replace(base, nav=False, interact=False, outcome="out_of_steps")
    four = [replace(scores, episode=f"e{k}") for k, scores in enumerate((base, base, base, far))]
    return named({name: [(replace(s, agent=name), None) for s in four] for name in agents})


def test_rows_of_two_simulators_are_never_one_row(base: Scores):
    of = {name: [(replace(base, agent="model", conditions={"simulator": name}), None)] for name in ("bullet", "mujoco")}
    mixed = named({"one run": of["bullet"] + of["mujoco"]})
    assert [(result.name, len(result.scores)) for result in mixed] == [("model, bullet", 1), ("model, mujoco", 1)]
    assert [result.name for result in named({"a": of["mujoco"]})] == ["model"]


def test_rows_of_two_gazes_name_theirs(base: Scores):
    bodies = [replace(base, conditions={"simulator": "bullet", "profile": "paper", "gaze": name}) for name in GAZES]
    near, far = named({"one run": [(scores, None) for scores in bodies]})
    assert (near.name, far.name) == (f"{base.agent}, gaze body", f"{base.agent}, gaze far")
    assert all(text in far.note for text in ("bullet", "paper", "far"))


# -- the values --------------------------------------------------------------------------------------------------------
def test_a_row_holds_rates_with_intervals_and_number_of_episodes(base: Scores) -> None:
    table = result_table("main", results_of(base, "model"), paper=False)
    assert [column.name for column in table.columns] == [metric.name for metric in MAIN]
    assert table.rows[0].cells[2] == wilson(3, 4)
    assert texts(table)[1][0][:4] == ("model", "100.0% [51.0, 100.0]", "0.0%", "75.0% [30.1, 95.4]")
    assert "model: 4 episodes, of an unknown total (no run.json)." in table.notes


def test_columns_of_the_body_and_of_paths_hold_their_own_numbers(base: Scores) -> None:
    groups = {"any": 0.5, "arm_hand": 0.1, "torso": 0.2, "leg_foot": 0.3, "head": 0.4, "fixed": 0.0, "person": 0.0}
    scores = replace(base, collisions=groups, disturbed=2, displaced=1, disturbed_path=3.0)
    values = {metric.name: estimate(metric, [scores]).value for metric in ALL}
    assert [values[name] for name in ("Arm/Hand", "Torso", "Leg/Foot", "Head")] == [0.1, 0.2, 0.3, 0.4]
    assert values["path (m)"] == 1.5


def test_a_number_that_rounds_to_zero_has_no_sign() -> None:
    assert Column("x", digits=1).number(-0.04) == "0.0"


def test_episodes_apart_are_told_and_counted_in_nothing(base: Scores) -> None:
    scores = [(base, None), (replace(base, outcome="infra_error", nav=False), None)]
    table = result_table("main", named({"run": scores}), paper=False)
    assert table.rows[0].cells[2] == wilson(1, 1)
    assert table.notes == (
        "model: 1 of 2 episodes, of an unknown total (no run.json); not in any number: 1 infra_error.",
    )


def test_failures_of_a_plugin_and_of_a_limit_count_and_are_told(base: Scores) -> None:
    broken = replace(base, outcome="plugin_error", error="humanclaw_nod raised ValueError: no", nav=False)
    spent = [replace(base, outcome="limit_reached", limit=limit, nav=False) for limit in ("episode", "call", "run")]
    scores = [replace(scores, episode=f"e{k}") for k, scores in enumerate((base, broken, *spent))]
    table = result_table("main", named({"run": [(s, None) for s in scores]}), paper=False)
    assert table.rows[0].cells[2] == wilson(1, 4)
    assert table.notes == (
        "model: 4 of 5 episodes, of an unknown total (no run.json); not in any number: 1 limit_reached. Failed by a "
        "plugin, and counted: 1 "
        "(humanclaw_nod raised ValueError: no).",
    )


@pytest.mark.parametrize(("unasked", "words"), [(1, "1.0 %."), (2, "2.0 %. Warning")])
def test_a_verifier_that_was_not_asked_is_in_its_row(base: Scores, unasked: int, words: str) -> None:
    scores = replace(base, verifier="llm", verified=100, unasked=unasked)
    table = result_table("main", named({"run": [(scores, None)]}), paper=False)
    column = [c.name for c in table.columns].index("unasked")
    assert table.rows[0].cells[column].value == unasked / 100
    assert f"Calls executed unverified: {words}" in table.notes[0]
    assert ("Warning" in table.notes[0]) is (unasked > 1)


@pytest.mark.parametrize(("words", "shown"), [((), (0, 0)), (("--paper",), (1, 2)), (("--column", "NavSR"), (1, 0))])
def test_a_terminal_shows_the_papers_rows_if_asked(tmp_path: Path, words: tuple[str, ...], shown: tuple[int, int]):
    """Its agents among results, and its pooled models in the funnel and among root causes."""
    text = invoke("table", write_run(tmp_path, 2, 1), *words).output
    assert ("GPT-5.5 \u2020" in text, text.count("nine models \u2020")) == shown


def test_an_incomplete_run_is_told_and_refused_where_it_would_mislead(tmp_path: Path) -> None:
    whole, part = write_run(tmp_path / "a", 2, 1), write_run(tmp_path / "b", 2, 1)
    write_episodes(part / "split.jsonl", [episode.record.spec for episode in load_run(part)])
    shutil.rmtree(part / "e01")
    assert "2 of 3 episodes" in invoke("table", part).output.replace("\n", " ")
    for command in (("table", part, "--format", "latex"), ("compare", whole, part)):
        assert "not complete: model: 2 of 3 episodes" in invoke(*command).output.replace("\n", " ")
        assert invoke(*command, "--partial").exit_code == 0


def test_a_run_without_a_run_json_is_not_taken_for_whole(tmp_path: Path) -> None:
    run = write_run(tmp_path, 2, 1)
    (run / "run.json").unlink()
    assert "3 episodes, of an unknown total (no run.json)" in invoke("table", run).output.replace("\n", " ")
    refused = invoke("table", run, "--format", "latex")
    assert refused.exit_code == 2
    assert "not known to be complete" in refused.output.replace("\n", " ")
    assert invoke("table", run, "--format", "latex", "--partial").exit_code == 0


@pytest.mark.parametrize("name", ["nav", "find", "outcome", "episode", "success", "cause", "collisions_any"])
def test_a_metric_with_the_name_of_a_built_in_number_is_refused(name: str) -> None:
    plugins = Plugins.discover()
    plugins.add(plugin(metrics=[(name, lambda recorded: 1.0)]), "taker")
    with pytest.raises(PluginError, match=rf"metric '{name}' of plugin 'taker' has the name"):
        metrics_of(plugins)


def test_a_metric_that_raises_or_babbles_is_unknown_and_harmless(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    plugins = Plugins.discover()
    odd = {
        "raises": lambda recorded: 1 / 0,
        "leaves": lambda recorded: sys.exit(3),
        "babbles": lambda recorded: "much",
    }
    metrics = [*odd.items(), ("one", lambda recorded: 1.0)]
    plugins.add(plugin(metrics=metrics), "odd")
    ((scores, _),) = scored([rollout(tmp_path, SAT)], metrics_of(plugins))
    assert [str(scores.extra[name]) for name in odd] == ["nan"] * 3
    assert (scores.extra["one"], scores.interact) == (1.0, True)
    line = f"metric 'raises' of plugin 'odd' failed on episode {scores.episode}: ZeroDivisionError: division by zero"
    assert caplog.messages[0].startswith(f"{line} ({__file__}, line ")
    assert not any(record.exc_info for record in caplog.records)


@pytest.mark.parametrize(
    ("history", "text", "cut"), [("20", "short", True), ("20", "whole", False), ("0", "short", False)]
)
def test_a_row_says_whether_words_of_past_steps_were_cut(base: Scores, history: str, text: str, cut: bool) -> None:
    played = replace(base, conditions={"agent history": history, "agent history_text": text})
    (note,) = result_table("main", named({"run": [(played, None)]})).notes
    assert ("words cut" in note) == cut


def test_a_note_is_a_line_that_steers_no_terminal(base: Scores) -> None:
    broken = replace(base, outcome="plugin_error", error="x\x1b[31m\n\\evil")
    (note,) = {note for note in result_table("main", results_of(broken, "model")).notes if "plugin" in note}
    assert ("\x1b" in note, "\n" in note, "evil" in note) == (False, False, True)


def forget(recorded: Any) -> float:
    recorded.steps = ()
    recorded.record.skills.clear()
    return 1.0


def size(recorded: Any) -> int:
    return len(recorded.steps) + len(recorded.record.skills)


def test_a_metric_that_changes_its_record_changes_nothing_else(tmp_path: Path) -> None:
    plugins = Plugins.discover()
    plugins.add(plugin(metrics=[("forgets", forget), ("counts", size)]), "forgers")
    recorded = rollout(tmp_path, FAR)
    ((plain, why),) = scored([recorded])
    ((scores, cause),) = scored([recorded], metrics_of(plugins))
    assert scores.extra["counts"] == size(recorded) > 2
    assert (repr(replace(scores, extra={})), cause) == (repr(plain), why)
    assert why is not None


def test_the_papers_rows_say_why_they_are_no_comparison(base: Scores) -> None:
    table = result_table("main", results_of(base, "model"))
    paper = [row for row in table.rows if row.paper]
    assert len(paper) == 9
    assert all(row.name.endswith("\u2020") for row in paper)
    gemini = next(row for row in paper if row.name.startswith("Gemini-3.1"))
    values = [cell.value for cell in gemini.cells[:7]]
    unknown = float("nan")  # It has neither false claims nor ArriveSR.
    assert values == pytest.approx([0.649, unknown, 0.424, unknown, 0.168, 0.395, 1.50], nan_ok=True)
    assert any("other scenes" in note for note in table.all_notes)
    assert not any(
        "other scenes" in note for note in result_table("main", results_of(base, "model"), paper=False).all_notes
    )


def test_results_are_broken_down_by_difficulty_and_category(base: Scores) -> None:
    easy, hard = replace(base, tier="easy"), replace(base, tier="hard", nav=False, category="bed")
    tables = all_tables(named({"a": [(easy, None), (easy, None), (hard, None)]}))
    column = [c.name for c in tables["difficulty"].columns].index("NavSR")
    cells = {row.name.split(", ")[1]: row.cells[column] for row in tables["difficulty"].rows}
    assert {name: (cell.value, cell.count) for name, cell in cells.items()} == {"easy": (1.0, 2), "hard": (0.0, 1)}
    assert [row.name.split(", ")[1] for row in tables["category"].rows] == ["couch", "bed"]


def test_agents_that_repeat_are_told_apart_by_their_run(base: Scores) -> None:
    run = [(base, None)]
    assert [r.name for r in named({"x": run, "y": run})] == ["model (x)", "model (y)"]
    other = [(replace(base, verifier="geometry"), None)]
    assert [r.name for r in named({"x": run, "y": other})] == ["model", "model + geometry"]


def test_root_causes_are_shares_of_the_failures_of_their_stage(tmp_path: Path) -> None:
    episodes = [rollout(tmp_path, FAR, name=f"far{k}") for k in range(3)] + [rollout(tmp_path, SAT, name="sat")]
    episodes += [rollout(tmp_path, [FOUND, step(away=0.1)], name="arrived")]
    scored = [(score(episode), attribute(episode)) for episode in episodes]
    table = all_tables(named({"run": scored}), paper=False)["causes"]
    shares = {row.name: row.cells[0] for row in table.rows}
    assert shares["nav: stop while far"] == wilson(3, 4)
    assert shares["nav: unaware arrived/touch"] == wilson(1, 4)
    assert len(shares) == len(CAUSES)
    assert "Failures of model: find 0, nav 4, interact 0." in table.notes


@pytest.mark.parametrize(
    ("better", "value", "p", "words"),
    [
        ("higher", 0.3, 0.01, "B is better"),
        ("lower", 0.3, 0.01, "A is better"),
        ("lower", -0.3, 0.01, "B is better"),
        ("", -0.3, 0.01, "A is higher"),
    ],
)
def test_a_difference_is_told_in_words(better: str, value: float, p: float, words: str) -> None:
    column = Column("c", better=better)  # type: ignore[arg-type]
    assert verdict(column, Difference(0, 0, value, 0, 0, p, 9)) == words


@pytest.mark.parametrize(
    ("low", "high", "least", "words"),
    [
        (-0.09, 0.09, 0.01, "noise"),
        (-0.02, 0.11, 0.01, "too few to tell"),
        (-0.11, 0.02, 0.01, "too few to tell"),
        (0.01, 0.09, 0.01, "not significant"),
        (-0.145, -0.009, 0.01, "not significant"),
        (0.0, 0.0, 0.5, "too few to tell"),
        (float("nan"), float("nan"), 0.01, "too few to tell"),
    ],
)
def test_a_share_is_noise_only_where_its_interval_holds_0(low: float, high: float, least: float, words: str) -> None:
    difference = Difference(0.5, 0.5, 0.0, low, high, 0.9, 9, least)
    assert verdict(Column("NavSR", percent=True), difference) == words


@pytest.mark.parametrize(
    ("a", "b", "low", "high", "words"),
    [
        (20.0, 22.0, -1.9, 2.0, "noise"),  # The level is 21, a tenth of it 2.1.
        (20.0, 22.0, -1.9, 2.2, "too few to tell"),
        (20.0, 22.0, 0.1, 2.0, "not significant"),
        (0.19, 0.86, -0.09, 1.65, "too few to tell"),
        (-4.0, -4.0, -0.3, 0.3, "noise"),
    ],
)
def test_a_mean_is_noise_only_where_its_interval_holds_0(
    a: float, b: float, low: float, high: float, words: str
) -> None:
    assert verdict(Column("steps"), Difference(a, b, b - a, low, high, 0.9, 9)) == words


def test_what_differs_in_no_episode_is_the_same(base: Scores) -> None:
    a, b = ([replace(base, episode=f"e{k}", scene=f"house:{k}", find=k < 7) for k in range(14)] for _ in range(2))
    compared = compare(a, b)
    assert [verdict(Column(name), compared[name]) for name in ("in tok/step", "cost ($)", "steps")] == ["the same"] * 3
    # A rate has an interval that tells what fourteen episodes leave open: 1.96 / 16 either way.
    assert compared["FindSR"].high == pytest.approx(1.96 / 16, abs=1e-4)
    assert verdict(Column("FindSR", percent=True), compared["FindSR"]) == "too few to tell"


def test_a_p_below_a_thousandth_is_not_printed_as_0() -> None:
    printed = [compared(Column("c"), Difference(1, 2, 1, 0, 2, p, 9))[-2] for p in (0.0004, 0.0005, 0.0123)]
    assert printed == ["< 0.001", "0.001", "0.012"]


def test_a_comparison_tells_of_how_many_episodes_each_metric_is(base: Scores) -> None:
    a = [replace(base, episode=f"e{k}", jerk=9.0, spl=0.5, soft_spl=0.5, false_claims=0.0) for k in range(8)]
    still = dict.fromkeys(base.collisions, float("nan"))
    b = [replace(scores, collisions=still if k < 2 else scores.collisions) for k, scores in enumerate(a)]
    a = [replace(scores, jerk=float("nan") if k < 3 else 9.0) for k, scores in enumerate(a)]
    caption = str(compare_table(compare(a, b), ALL, "a", "b").caption)
    assert caption.startswith("Over the 8 episodes that both finished")
    assert "Fewer count for Coll., Arm/Hand, Torso, Leg/Foot, Head, Coll. fixed (6), Jerk (5)." in caption


def test_a_hundred_points_on_two_episodes_are_too_few_to_tell(tmp_path: Path) -> None:
    result = invoke("compare", write_run(tmp_path / "a", 0, 2), write_run(tmp_path / "b", 2, 0))
    words = {line.split()[0]: line.strip() for line in result.output.splitlines() if line.strip()}
    assert words["InteractSR"].endswith("too few to tell")


# -- the formats -------------------------------------------------------------------------------------------------------
@pytest.fixture
def table(base: Scores) -> ResultTable:
    return result_table("main", results_of(base, "a_b|c & 50%"))


def test_markdown_has_as_many_cells_in_every_line(table: ResultTable) -> None:
    lines = [line.replace("\\|", "") for line in markdown(table).splitlines() if line.startswith("|")]
    assert len(lines) == 2 + 10
    assert {line.count("|") for line in lines} == {len(MAIN) + 2}


def test_latex_escapes_names_and_rules_the_papers_rows_off(table: ResultTable) -> None:
    text = latex(table)
    assert r"a\_b|c \& 50\% & 100.0\%" in text
    assert text.count(r"\\") == 1 + 10
    assert {line.count(" & ") for line in text.splitlines() if line.endswith(r"\\")} == {len(MAIN)}
    assert text.count(r"\midrule") == 2
    assert r"\noindent\resizebox{\ifdim\width>\textwidth\textwidth" in text
    drawn = [line for line in text.splitlines() if not line.startswith("%")]
    assert sum(line.count("{") - line.count("}") for line in drawn) == 0
    assert "\u2020" not in text.split(r"\end{tabular}")[0]


def test_results_are_told_by_each_dimension_of_difficulty_apart(base: Scores) -> None:
    assert base.spec is not None
    far = base.spec.model_copy(update={"difficulty": Difficulty(distance=9.0, turns=0, rooms=1, obstacles=3.0)})
    near = base.spec.model_copy(update={"difficulty": Difficulty(distance=3.0, turns=2, rooms=1, obstacles=3.0)})
    scores = (replace(base, episode="far", spec=far, nav=False), replace(base, episode="near", spec=near, nav=True))
    table = factors_table([Scored("x", scores, (None, None))])
    nav = [column.name for column in table.columns].index("NavSR")
    assert {row.name: row.cells[nav].value for row in table.rows} == {
        "x, distance: easy": 1.0, "x, distance: hard": 0.0, "x, choice: easy": 0.0, "x, choice: medium": 1.0,
        "x, obstacle: medium": 0.5,
    }  # fmt: skip


def test_unknown_numbers_are_dashes() -> None:
    assert Column("x").number(float("nan")) == "\u2013"
    assert Column("x", percent=True).number(0.5) == "50.0%"


@pytest.mark.parametrize("width", [60, 80, 120, 240])
def test_a_terminal_shows_every_number_whatever_its_width(table: ResultTable, width: int) -> None:
    table = replace(table, rows=(replace(table.rows[0], name="provider/model-" * 8), *table.rows[1:]))
    console = Console(width=width, file=io.StringIO())
    console.print(terminal(table, width))
    shown = console.file.getvalue()  # type: ignore[attr-defined]
    assert max(len(line.rstrip()) for line in shown.splitlines()) <= width
    for column, cells in zip(table.columns, zip(*(row.cells for row in table.rows), strict=True), strict=True):
        assert column.head in shown
        assert all(column.number(cell.value) in shown for cell in cells)


# -- the commands ------------------------------------------------------------------------------------------------------
def test_a_table_and_a_comparison_as_json_have_every_number_in_full(tmp_path: Path) -> None:
    run = write_run(tmp_path, 3, 1, 1)
    (row,) = json.loads(invoke("table", run, "--json", "--no-paper", "--only", "main").output)["main"]["rows"]
    assert row["NavSR"]["value"] == 0.75
    assert row["NavSR"]["n"] == 4
    (nav,) = [row for row in json.loads(invoke("compare", run, run, "--json", "--partial").output)["metrics"]
               if row["metric"] == "NavSR"]  # fmt: skip
    assert (nav["a"], nav["b"], nav["difference"]["value"]) == (0.75, 0.75, 0.0)


def test_a_comparison_has_each_metric_once(tmp_path: Path) -> None:
    run = write_run(tmp_path, 3, 1, 1)
    names = [row["metric"] for row in json.loads(invoke("compare", run, run, "--json", "--partial").output)["metrics"]]
    assert "motion (s)" in names
    assert sorted(set(names)) == sorted(names)


def test_a_latex_table_has_the_chosen_columns_in_their_order(tmp_path: Path) -> None:
    run, height = write_run(tmp_path, 3, 1), tmp_path / "height.py"
    height.write_text(
        "from humanclaw import hookimpl\n\n\n@hookimpl(optionalhook=True)\n"
        "def humanclaw_metrics(register):\n    register('height', lambda recorded: 1.75)\n"
    )
    words = ("--column", "NavSR", "--column", "height", "--column", "GeoNavSR", "--format", "latex")
    result = invoke("table", run, *words, "--partial", "--plugin", height)
    text = result.output
    assert r"agent & NavSR $\uparrow$ & height & GeoNavSR $\uparrow$ \\" in text
    assert "75.0\\%" in text
    assert "1.750" in text
    assert r"GPT-5.5 $^\dagger$ & 13.9\% & -- & 27.7\% \\" in text
    refused = invoke("table", run, "--column", "NavSr", "--partial")
    assert (refused.exit_code, "there is no column 'NavSr'" in refused.output) == (2, True)
    assert invoke("table", run, "--column", "NavSR", "--only", "main").exit_code == 2


def test_episodes_without_a_target_are_said_to_be_unscored(tmp_path: Path) -> None:
    rollout(tmp_path, [step()], category="")
    shown = invoke("table", tmp_path)
    line = "Not scored: no episode has a target. `humanclaw bench table RUN --full` prints what the body did.\n"
    assert shown.output == line


def test_a_table_fits_a_screen_and_says_every_note_once(tmp_path: Path) -> None:
    shown = invoke("table", write_run(tmp_path, 3, 1, 1)).output
    assert len(shown.splitlines()) <= 50
    assert all(words in shown for words in ("75.0%", "ArriveSR", "Funnel", "nav: stop while far", "--full"))
    assert shown.count("Intervals: 95%") == 1


def test_table_prints_every_table_of_a_run(tmp_path: Path) -> None:
    result = invoke("table", write_run(tmp_path, 3, 1, 1), "--full")
    assert result.exit_code == 0
    for words in ("75.0%", "GeoNavSR", "Leg/Foot", "Funnel", "nav: stop while far", "1 infra_error", "GPT-5.5"):
        assert words in result.output


def test_table_prints_one_table_in_one_format(tmp_path: Path) -> None:
    result = invoke("table", write_run(tmp_path, 3, 1), "--only", "variants", "--format", "markdown", "--no-paper")
    rows = [line.split(" | ") for line in result.stdout.splitlines() if line.startswith("| ")]
    assert [row[0] for row in rows] == ["| agent", "| ---", "| model"]
    assert rows[2][rows[0].index("GeoInteractSR \u2191 |")] == "75.0% [30.1, 95.4] |"


def test_compare_says_which_run_is_better_and_what_is_noise(tmp_path: Path) -> None:
    result = invoke("compare", write_run(tmp_path / "a", 0, 14), write_run(tmp_path / "b", 14, 1))
    assert result.exit_code == 0
    words = {line.split()[0]: line.strip() for line in result.output.splitlines() if line.strip()}
    assert words["InteractSR"].endswith("B is better")
    assert words["FindSR"].endswith("too few to tell")  # Of 14 episodes, though all ended alike.
    assert "1 finished episode has no counterpart" in result.output


def test_rescore_writes_a_line_an_episode(tmp_path: Path) -> None:
    result = invoke("rescore", write_run(tmp_path, 1, 1))
    assert result.exit_code == 0
    first, second = (json.loads(line) for line in (tmp_path / "scores.jsonl").read_text().splitlines())
    assert (first["episode"], first["interact"], "cause" in first) == ("e00", True, False)
    assert (second["cause"], second["stage"], second["capability"]) == ("stop while far", "nav", "ego-spatial distance")
    assert first["jerk"] == pytest.approx(score(RecordedEpisode(tmp_path / "e00")).jerk)


def test_a_number_that_is_not_known_is_null(tmp_path: Path) -> None:
    rollout(tmp_path, [step("", away=None)])
    assert invoke("rescore", tmp_path).exit_code == 0
    line = json.loads((tmp_path / "scores.jsonl").read_text(), parse_constant=lambda word: pytest.fail(word))
    assert (line["jerk"], line["distance"], line["collisions_any"]) == (None, None, None)


@pytest.mark.parametrize("command", ["table", "rescore"])
def test_a_folder_without_records_is_an_error_with_a_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    result = invoke(command, Path())
    assert result.exit_code == 2
    assert f"no episode record in {tmp_path.resolve()}." in result.output.replace("\n", "")
    assert "there is no folder nowhere." in invoke(command, Path("nowhere")).output
    assert "`humanclaw bench run` wrote" in result.output.replace("\n", " ")


def test_a_run_named_twice_is_an_error(tmp_path: Path) -> None:
    write_run(tmp_path, 1, 0)
    result = invoke("table", tmp_path, tmp_path)
    assert result.exit_code == 2
    assert "named twice" in result.output


def test_comparing_a_folder_of_several_agents_is_an_error(tmp_path: Path) -> None:
    write_run(tmp_path / "a", 1, 0)
    write_run(tmp_path / "b", 1, 0, agent="other")
    result = invoke("compare", tmp_path, tmp_path / "a")
    assert result.exit_code == 2
    assert "several agents (model, other)" in result.output


# -- what a page shows -------------------------------------------------------------------------------------------------
class Shown:
    """The tables of a page by title: the heads, and the rows."""

    def __init__(self) -> None:
        self.tables: dict[str, tuple[list[str], list[list[str]]]] = {}
        self.notes: dict[str, str] = {}

    def table(
        self, title: str, head: list[str], rows: list[list[str]], notes: Sequence[str] = (), **more: object
    ) -> None:
        self.tables[title] = (list(head), [list(row) for row in rows])
        self.notes[title] = " ".join(notes)

    def episode(self, run: Path, name: str, **more: object) -> None: ...


def test_a_page_of_runs_without_models_speaks_of_no_tokens(tmp_path: Path) -> None:
    folders = write_run(tmp_path / "a", sat=3, far=1), write_run(tmp_path / "b", sat=1, far=3)
    page = Shown()
    overview({folder: load_run(folder) for folder in folders}, page, Plugins.discover())
    title = next(title for title in page.tables if title.startswith("Metrics that differ"))
    alike = page.notes[title].partition(": ")[2].partition(".")[0].split(", ")
    metrics = [row[0] for row in page.tables[title][1]] + alike
    assert "NavSR" in alike, "75 and 25 % of four episodes"
    assert not [name for name in metrics if "tok" in name or "cost" in name]


def test_a_page_says_what_each_short_name_over_its_main_table_means(tmp_path: Path) -> None:
    page = Shown()
    overview({tmp_path / "a": load_run(write_run(tmp_path / "a", sat=2, far=1))}, page, Plugins.discover())
    title, (head, _) = next(iter(page.tables.items()))
    names = {cell.rstrip(" \u2191\u2193") for cell in head[1:]}
    plain = {"false claims", "steps", "motion (s)"}
    assert names > plain
    assert [name for name in names - plain if f"{name}: " not in page.notes[title]] == []


# -- the paper's error analysis ----------------------------------------------------------------------------------------
def _failed(base: Scores, agent: str, *causes: str):
    by_label = {cause.label: cause for cause in CAUSES}
    lost = replace(base, agent=agent, nav=False, interact=False)
    return [(replace(lost, episode=f"e{k}"), by_label[label]) for k, label in enumerate(causes)]


def test_causes_are_pooled_over_runs_and_summed_by_faculty(base: Scores):
    """Of four failures to arrive, three of agent a and one of b: 2 of 4 stopped far, 1 was jammed and 1 arrived."""
    far, jam, arrived = "nav: stop while far", "nav: unaware jammed", "nav: unaware arrived/touch"
    results = named({"a": _failed(base, "a", far, jam, arrived), "b": _failed(base, "b", far)})
    tables = all_tables(results, paper=True)
    causes, faculties = (
        {row.name: [round(cell.value, 3) for cell in row.cells] for row in tables[name].rows}
        for name in ("causes", "faculties")
    )
    assert [column.name for column in tables["causes"].columns] == ["a", "b", "all runs", "nine models \u2020"]
    assert causes[far] == [0.333, 1.0, 0.5, 0.3]
    assert causes[jam] == [0.333, 0.0, 0.25, 0.14]
    assert faculties["nav: body awareness"] == [0.667, 0.0, 0.5, 0.34]
    assert faculties["nav: ego-spatial distance"] == causes[far]
    assert faculties["nav: mid-level reasoning"][-1] == 0.17  # As printed: 16, and below 1.
    assert len(faculties) == 12


@pytest.mark.parametrize("paper", [True, False])
def test_a_picture_draws_each_share_as_a_bar(base: Scores, paper: bool):
    """One of two failures to navigate is of each of two faculties; grey are the paper's shares."""
    far, jam = "nav: stop while far", "nav: unaware jammed"
    drawn = np.asarray(picture(named({"a": _failed(base, "a", far, jam)}), paper=paper))
    whole = WIDE - NAME - 60

    def bars(colour: str) -> list[int]:
        """The widths of the bars of a colour, without the legend's square."""
        mask = (drawn == ImageColor.getrgb(colour)).all(-1)
        widths = (np.ptp(np.flatnonzero(row)) for half in (mask[:, :WIDE], mask[:, WIDE:]) for row in half if row.any())
        return [int(width) for width in widths if width > 12]

    for faculty in ("ego-spatial distance", "body awareness"):
        assert max(bars(FACULTIES[faculty])) == pytest.approx(whole / 2, abs=2)
    assert bool(bars(GREY)) == paper


def test_the_papers_shares_of_each_stage_are_a_whole():
    """Rounded per cents: find 101, nav 99.5 (its "under 1 %" is .5 in the text), interact 100."""
    printed = paper_results()["causes"]
    assert set(printed) == {cause.label for cause in CAUSES}
    sums = {
        stage: sum(row["nine models"] for label, row in printed.items() if label.startswith(stage)) for stage in STAGES
    }
    assert sums == {"find": 101, "nav": 99.5, "interact": 100}


def test_the_funnel_pools_runs_beside_the_papers(base: Scores):
    """Of four episodes of each agent all were found; three of a and none of b were reached."""
    a, b = results_of(base, "a", "b")
    b = replace(b, scores=tuple(replace(scores, nav=False, interact=False) for scores in b.scores))
    rows = {row.name: [cell.value for cell in row.cells] for row in all_tables([a, b])["funnel"].rows}
    assert rows["all runs"][:3] == [1.0, 1.0, 3 / 8]
    assert rows["nine models \u2020"] == pytest.approx([0.614, 5473 / 10962, 1767 / 10962, 213 / 726], abs=1e-3)


def test_the_best_and_second_best_of_three_runs_are_marked(base: Scores):
    """NavSR 3, 2 and 1 of 4; all print the same FindSR, so there is no best."""
    results = results_of(base, "a", "b", "c")
    less = [
        replace(r, scores=tuple(replace(s, nav=k < 3 - index) for k, s in enumerate(r.scores)))
        for index, r in enumerate(results)
    ]
    table = result_table("variants", less, paper=False)
    at = {column.name: index for index, column in enumerate(table.columns)}
    assert [row.ranks[at["NavSR"]] for row in table.rows] == [1, 2, 0]
    assert [row.ranks[at["FindSR"]] for row in table.rows] == [0, 0, 0]
    assert "75.0%\u00b9 [" in markdown(table)
    assert r"\textbf{75.0\%}" in latex(table)
    assert result_table("variants", less[:2], paper=False).rows[0].ranks == ()


@pytest.mark.parametrize(("passed", "ranks"), [((4, 0, 0), [1, 0, 0]), ((4, 4, 0), [1, 1, 0]), ((4, 0, 2), [1, 0, 2])])
def test_the_worst_value_of_a_column_has_no_mark(base: Scores, passed, ranks):
    runs = [
        replace(run, scores=tuple(replace(scores, nav=index < count) for index, scores in enumerate(run.scores)))
        for run, count in zip(results_of(base, "a", "b", "c"), passed, strict=True)
    ]
    table = result_table("variants", runs, paper=False)
    at = [column.name for column in table.columns].index("NavSR")
    assert [row.ranks[at] for row in table.rows] == ranks
