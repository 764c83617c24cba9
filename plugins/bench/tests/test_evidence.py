"""Ablation and repair, with constructed scores whose results are known."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

from humanclaw import EpisodeSpec, Plugins
from humanclaw_bench import ablation, repair
from humanclaw_bench.attribution import CAUSES
from humanclaw_bench.repair import drawn
from humanclaw_bench.scores import Scores

FAULTS = repair.known_faults(Plugins.discover())
BY_LABEL = {cause.label: cause for cause in CAUSES}


def scores(number: int, nav: bool, interact: bool | None = None) -> Scores:
    return Scores(
        f"e{number}", "faulty", "", "house:0", "abc", "couch", "stopped", True, True, 0.0, nav, nav, nav, nav, nav,
        interact, interact, 0.1, {}, 0, 0.0, 0, 0.0, 5.0, 5.0, 0.0, 10, 0, 0, 0, 0.0,
    )  # fmt: skip


def run(successes: int, total: int = 40) -> list[Scores]:
    """The first episodes succeed in both rates, the rest in none."""
    return [scores(k, k < successes, k < successes) for k in range(total)]


def test_a_rate_that_collapses_is_a_direction_reproduced():
    """20 episodes lost and none won: McNemar's exact p is 2 / 2^20."""
    runs = {setting.name: run(30) for setting in ablation.SETTINGS} | {"no-verifier": run(10)}
    found = {(f.setting, f.metric): f for f in ablation.findings(runs)}
    assert found["no-verifier", "NavSR"].reproduced
    assert found["no-verifier", "NavSR"].difference.p < 1e-4
    assert not found["history-0", "NavSR"].reproduced


def test_a_rate_that_rises_reproduces_nothing():
    runs = {setting.name: run(10) for setting in ablation.SETTINGS} | {"images-10": run(35)}
    assert not any(f.reproduced for f in ablation.findings(runs))


def test_the_ablation_table_tells_rates_and_directions():
    runs = {setting.name: run(30) for setting in ablation.SETTINGS} | {"no-mid-level": run(5)}
    text = ablation.markdown(runs)
    # Wilson's interval of 30 of 40, from its formula: (0.75 + z2/80 -+ z sqrt(0.1875/40 + z2/6400)) / (1 + z2/40) with
    # z = 1.96.
    assert "| baseline | 40 | 100.0 % [91, 100] | 75.0 % [60, 86] | 75.0 % [60, 86] |" in text
    assert "| no-mid-level: InteractSR falls | 75.0 % | 12.5 % |" in text


def test_the_settings_differ_from_the_baseline_in_one_field_each():
    base = ablation.BASELINE.job(ablation.Backends())
    for setting in ablation.SETTINGS[1:]:
        job = setting.job(ablation.Backends())
        changed = dict(job.options.items() - base.options.items())
        assert len(changed) + (job.verifier != base.verifier) == 1


def test_repair_counts_by_label_who_is_saved_by_the_blamed_capability():
    far, blind = BY_LABEL["nav: stop while far"], BY_LABEL["find: target in view but not seen"]
    causes = {"e0": far, "e1": far, "e2": far, "e3": blind, "e4": None}
    right = {f"e{k}": scores(k, nav=k != 1) for k in range(4)}
    rows = repair.repaired(causes, right, second={"e0", "e1"})
    assert [row.second for row in rows] == [0, 1]  # e0 was mended.
    assert [row.label for row in rows] == [blind.label, far.label]
    assert [(row.count, row.repaired) for row in rows] == [(1, 1), (3, 2)]
    assert "| nav: stop while far | ego-spatial distance | 3 | 2 (67 %) |" in repair.markdown(rows)


def test_a_second_label_can_blame_the_missing_capability():
    hidden = replace(scores(0, nav=False), also="find: ineffective actions; nav: turned to sit")
    assert repair.second_blames(hidden, "action")
    assert repair.second_blames(hidden, "body awareness")
    assert not repair.second_blames(hidden, "perception")
    assert not repair.second_blames(scores(0, nav=False), "action")


def test_of_two_faults_at_once_the_failure_goes_with_the_blamed_one_and_stays_with_the_other():
    far, blind, lost = (BY_LABEL[label] for label in (
        "nav: stop while far", "find: target in view but not seen", "nav: lost target",
    ))  # fmt: skip
    named = {fault.name: fault for fault in FAULTS}
    two = {f"e{k}": (named["distance"], named["blindness"]) for k in range(4)}
    causes = {"e0": far, "e1": far, "e2": far, "e3": lost, "e4": None}
    # e0 as it should be; e1 stays whatever is put right; e2 goes with the other; e3 is blamed on neither fault.
    mended = {
        "ego-spatial distance": {"e0": blind, "e1": far, "e2": None, "e3": None},
        "perception": {"e0": far, "e1": far, "e2": blind, "e3": lost},
    }
    rows = repair.paired(causes, mended, two)
    assert [(row.label, row.count, row.astray, row.gone, row.gone_by_other) for row in rows] == [
        ("nav: stop while far", 3, 0, 2, 1), ("nav: lost target", 1, 1, 0, 0),
    ]  # fmt: skip
    assert "| nav: stop while far | ego-spatial distance | 3 | 0 | 2 (67 %) | 1 (33 %) |" in repair.pairs_markdown(rows)


def test_a_fault_is_joined_with_one_of_another_capability():
    joined = [(drawn(spec, FAULTS), repair.companion(spec, FAULTS)) for spec in specs(60)]
    assert all(one.capability != other.capability for one, other in joined)
    assert all(not (one.standing and other.standing) for one, other in joined)
    assert len({other.name for _, other in joined}) > 8


def specs(count: int) -> list[EpisodeSpec]:
    return [EpisodeSpec(id=f"e{k}", instruction="find", scene="house:0", interact=True, seed=k) for k in range(count)]


def test_episodes_are_played_until_every_fault_has_led_to_its_root_cause_often_enough():
    everything, causes = specs(500), {}
    first = repair.wanting(everything, causes, 3, FAULTS)
    assert len(first) == 3 * len(FAULTS)
    causes = {spec.id: BY_LABEL[drawn(spec, FAULTS).cause] for spec in first}
    spoilt = next(spec for spec in first if drawn(spec, FAULTS).name == "jam")
    causes[spoilt.id] = None
    (another,) = repair.wanting(everything, causes, 3, FAULTS)
    assert drawn(another, FAULTS).name == "jam"
    assert another not in first


def test_what_is_played_ends_with_the_episodes():
    everything = specs(10)
    assert repair.wanting(everything, {spec.id: None for spec in everything}, 3, FAULTS) == []


def test_a_fault_that_shows_nothing_is_tried_three_times_as_often_and_then_left():
    everything, causes = specs(500), {}
    while todo := repair.wanting(everything, causes, 2, FAULTS):
        causes |= {spec.id: None for spec in todo}
    assert Counter(drawn(spec, FAULTS).name for spec in everything if spec.id in causes) == dict.fromkeys(
        (fault.name for fault in FAULTS), 6
    )


def test_the_blamed_of_a_capability_are_at_most_so_many_of_each_label():
    arrived, jammed = BY_LABEL["nav: unaware arrived/touch"], BY_LABEL["nav: unaware jammed"]
    causes = {f"e{k}": arrived if k < 4 else jammed for k in range(5)} | {"e5": BY_LABEL["nav: lost target"]}
    assert len(repair.blamed(specs(6), causes, "body awareness")) == 5
    assert [spec.id for spec in repair.blamed(specs(6), causes, "body awareness", 2)] == ["e0", "e1", "e4"]


def test_every_fault_leads_to_a_root_cause_of_its_own_that_blames_its_capability():
    assert {BY_LABEL[fault.cause].capability == fault.capability for fault in FAULTS} == {True}
    assert {cause.label for cause in CAUSES} - {fault.cause for fault in FAULTS} == {"find: too far"}


def test_the_page_of_the_benchmark_lists_every_root_cause_with_its_rule_capability_and_fault():
    page = (Path(__file__).parents[1] / "README.md").read_text("utf-8")
    rows = [line for line in page.splitlines() if re.match(r"\| \d+ \|", line)]
    fault = {one.cause: f"`{one.name}`" for one in FAULTS}
    assert rows == [
        f"| {number} | {cause.label} | {cause.meaning} | {cause.capability} | {fault.get(cause.label, 'none')} |"
        for number, cause in enumerate(CAUSES, 1)
    ]
