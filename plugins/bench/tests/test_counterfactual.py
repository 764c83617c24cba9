"""Repair, with constructed scores whose results are known."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

from humanclaw import EpisodeSpec, Plugins
from humanclaw_bench import counterfactual
from humanclaw_bench.attribution import CAUSES
from humanclaw_bench.counterfactual import drawn
from humanclaw_bench.scores import Scores

FAULTS = counterfactual.known_faults(Plugins.discover())
BY_LABEL = {cause.label: cause for cause in CAUSES}


def scores(number: int, nav: bool, interact: bool | None = None) -> Scores:
    return Scores(
        f"e{number}", "faulty", "", "house:0", "abc", "couch", "stopped", True, True, 0.0, nav, nav, nav, nav, nav,
        interact, interact, 0.1, {}, 0, 0.0, 0, 0.0, 5.0, 5.0, 0.0, 10, 0, 0, 0, 0.0,
    )  # fmt: skip


def test_repair_counts_by_label_who_is_saved_by_the_blamed_capability():
    far, blind = BY_LABEL["nav: stop while far"], BY_LABEL["find: target in view but not seen"]
    causes = {"e0": far, "e1": far, "e2": far, "e3": blind, "e4": None}
    right = {f"e{k}": scores(k, nav=k != 1) for k in range(4)}
    rows = counterfactual.repaired(causes, right, second={"e0", "e1"})
    assert [row.second for row in rows] == [0, 1]  # e0 was mended.
    assert [row.label for row in rows] == [blind.label, far.label]
    assert [(row.count, row.repaired) for row in rows] == [(1, 1), (3, 2)]
    assert "| nav: stop while far | ego-spatial distance | 3 | 2 (67 %) |" in counterfactual.markdown(rows)


def test_a_second_label_can_blame_the_missing_capability():
    hidden = replace(scores(0, nav=False), also="find: ineffective actions; nav: turned to sit")
    assert counterfactual.second_blames(hidden, "action")
    assert counterfactual.second_blames(hidden, "body awareness")
    assert not counterfactual.second_blames(hidden, "perception")
    assert not counterfactual.second_blames(scores(0, nav=False), "action")


def specs(count: int) -> list[EpisodeSpec]:
    return [EpisodeSpec(id=f"e{k}", instruction="find", scene="house:0", interact=True, seed=k) for k in range(count)]


def test_episodes_are_played_until_every_fault_led_to_its_cause():
    everything, causes = specs(500), {}
    first = counterfactual.wanting(everything, causes, 3, FAULTS)
    assert len(first) == 3 * len(FAULTS)
    causes = {spec.id: BY_LABEL[drawn(spec, FAULTS).cause] for spec in first}
    spoilt = next(spec for spec in first if drawn(spec, FAULTS).name == "jam")
    causes[spoilt.id] = None
    (another,) = counterfactual.wanting(everything, causes, 3, FAULTS)
    assert drawn(another, FAULTS).name == "jam"
    assert another not in first


def test_what_is_played_ends_with_the_episodes():
    everything = specs(10)
    assert counterfactual.wanting(everything, {spec.id: None for spec in everything}, 3, FAULTS) == []


def test_a_fault_that_shows_nothing_is_tried_three_times_as_often():
    everything, causes = specs(500), {}
    while todo := counterfactual.wanting(everything, causes, 2, FAULTS):
        causes |= {spec.id: None for spec in todo}
    assert Counter(drawn(spec, FAULTS).name for spec in everything if spec.id in causes) == dict.fromkeys(
        (fault.name for fault in FAULTS), 6
    )


def test_every_fault_leads_to_a_root_cause_of_its_own():
    assert {BY_LABEL[fault.cause].capability == fault.capability for fault in FAULTS} == {True}
    assert {cause.label for cause in CAUSES} - {fault.cause for fault in FAULTS} == {"find: too far"}


def test_the_benchmarks_page_lists_every_root_cause_with_its_rule():
    page = (Path(__file__).parents[1] / "README.md").read_text("utf-8")
    rows = [line for line in page.splitlines() if re.match(r"\d+\. ", line)]
    fault = {entry.cause: f"`{entry.name}`" for entry in FAULTS}
    assert rows == [
        f"{number}. {cause.label}: {cause.meaning} ({cause.capability}; {fault.get(cause.label, 'none')})"
        for number, cause in enumerate(CAUSES, 1)
    ]
