"""Ablation and rescue, from made-up scores whose answers are known."""

from __future__ import annotations

from humanclaw.bench import ablation, rescue
from humanclaw.bench.attribution import CAUSES
from humanclaw.bench.metrics import Scores

BY_LABEL = {cause.label: cause for cause in CAUSES}


def scores(number: int, nav: bool, interact: bool | None = None) -> Scores:
    return Scores(
        f"e{number}", "faulty", "", "house:0", "abc", "couch", "stopped", True, True, nav, nav, nav, interact, interact, 0.1,
        {}, 0, 0.0, 5.0, 10, 0, 0, 0, 0.0,
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
    assert "| baseline | 40 | 100.0 % | 75.0 % | 75.0 % |" in text
    assert "| no-mid-level: InteractSR falls | 75.0 % | 12.5 % |" in text


def test_the_settings_differ_from_the_baseline_in_one_thing_each():
    base = ablation.BASELINE.job(ablation.Engines())
    for setting in ablation.SETTINGS[1:]:
        job = setting.job(ablation.Engines())
        changed = dict(job.options.items() - base.options.items())
        assert len(changed) + (job.verifier != base.verifier) == 1


def test_rescue_counts_by_label_who_is_saved_by_the_blamed_faculty():
    far, blind = BY_LABEL["nav: stop while far"], BY_LABEL["find: target in view but not seen"]
    causes = {"e0": far, "e1": far, "e2": far, "e3": blind, "e4": None}
    blamed = {f"e{k}": scores(k, nav=k != 1) for k in range(4)}
    other = {f"e{k}": scores(k, nav=k == 2) for k in range(4)}
    rows = {row.label: row for row in rescue.rescued(causes, blamed, other)}
    assert (rows[far.label].count, rows[far.label].by_blamed, rows[far.label].by_another) == (3, 2, 1)
    assert (rows[blind.label].count, rows[blind.label].by_blamed, rows[blind.label].by_another) == (1, 1, 0)
    assert "| nav: stop while far | ego-spatial distance | 3 | 2 (67 %) | 1 (33 %) |" in rescue.markdown(
        [*rows.values()]
    )


def test_the_faculty_put_right_for_comparison_is_another_one():
    assert all(rescue.another(faculty) in set(rescue.FACULTIES) - {faculty} for faculty in rescue.FACULTIES)
