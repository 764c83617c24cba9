"""`humanclaw bench`: make and run splits; tables, comparisons and scores of recorded runs."""

from __future__ import annotations

from pathlib import Path

import click

from humanclaw.cli import LazyCommand

RUN = click.Path(path_type=Path)
PARTIAL = click.option("--partial", is_flag=True, help="Accept a run in which episodes are, or may be, missing.")


@click.group()
def bench() -> None:
    """Run the benchmark and score it."""


for _name, _target, _told in (
    ("run", "run_cli:run_command", "Run a split, or resume it."),
    ("table", "tables_cli:table", "Print the tables of one or more runs, one row per agent."),
    ("compare", "tables_cli:compare_command", "Compare two runs over the episodes that both finished."),
    ("rescore", "tables_cli:rescore", "Score a run again from its records."),
    ("export", "tables_cli:export_command", "Convert a run for other tools."),
    ("counterfactual", "counterfactual:counterfactual", "Check root causes with failures of known origin."),
    ("generate", "generate:generate", "Make splits from seeds, a hidden test, or training tasks."),
    ("rollouts", "rollouts:rollouts", "Write recorded runs as conversations to train on."),
    ("reproduce", "reproduce:reproduce", "Play the paper's tables 2 and 3 for some models."),
    ("power", "power_analysis:power_command", "Simulate which difference of two runs a split can show."),
    ("difficulty", "difficulty_cli:difficulty", "Print and draw how hard the episodes of a split are."),
    ("failures", "failures:failures", "Draw where episodes fail, and why."),
    ("verify", "submission_cli:verify", "Check every file of a run against its digest."),
    ("submit", "submission_cli:submit", "Write submission.json into a run, for a leaderboard."),
    ("leaderboard", "submission_cli:leaderboard", "Make index.html from a folder of submitted runs."),
):
    bench.add_command(LazyCommand(_name, f"humanclaw_bench.{_target}", _told))
