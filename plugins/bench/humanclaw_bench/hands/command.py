"""`humanclaw bench hands`: the table of runs of tasks for hands."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import click
import numpy as np

from humanclaw import RecordedEpisode, RecordError, load_run
from humanclaw.cli import show_markdown
from humanclaw_bench.disturbance import collisions
from humanclaw_bench.hands.scores import HandScores, Stage, hand_scores
from humanclaw_bench.scores import ended
from humanclaw_bench.statistics import rate

_STAGES: Final[tuple[Stage, ...]] = ("Find", "Nav", "Reach", "Hold", "Place", "Open", "Answer")


@click.command("hands")
@click.argument("runs", type=click.Path(path_type=Path), nargs=-1, required=True, metavar="RUN...")
@click.option("--geo", is_flag=True, help="Each stage by itself, without those before it, words and the stop.")
@click.option("--json", "as_json", is_flag=True, help="Print a line of JSON for each episode.")
def hands(runs: tuple[Path, ...], geo: bool, as_json: bool) -> None:
    """Score runs of the splits for hands: stages, drops, collisions, root causes.

    A stage counts only if those before it were passed.
    """
    found = {run: _episodes(run) for run in runs}
    if as_json:
        for episodes in found.values():
            for recorded, scores in episodes:
                click.echo(json.dumps({"episode": recorded.record.spec.id, **row(scores)}))
        return
    head = [
        "run",
        "episodes",
        *(f"{'Geo' if geo else ''}{stage}SR" for stage in _STAGES),
        "success",
        "dropped",
        "Coll.",
    ]
    lines = [head, ["---", *["---:"] * (len(head) - 1)]]
    lines += [[run.name, *_cells(episodes, geo)] for run, episodes in found.items()]
    show_markdown("\n".join(f"| {' | '.join(line)} |" for line in lines))
    for run, episodes in found.items():
        causes = Counter(scores.cause.label for _, scores in episodes if scores.cause)
        told = ", ".join(f"{label} {count}" for label, count in causes.most_common())
        click.echo(f"Root causes of {run.name}: {told or 'no failure'}.")


def row(scores: HandScores) -> dict[str, object]:
    """Return the scores of an episode as plain values."""
    stages = {f"{stage}SR": met for stage, met in scores.passed.items()}
    twins = {f"Geo{stage}SR": met for stage, met in scores.twins.items()}
    cause = scores.cause.label if scores.cause else ""
    return {"family": scores.family, "success": scores.success, **stages, **twins, "dropped": scores.dropped,
            "cause": cause}  # fmt: skip


def _episodes(run: Path) -> list[tuple[RecordedEpisode, HandScores]]:
    """Return the ended episodes of a run. Raises RecordError if one has no goal for hands."""
    episodes = [one for one in load_run(run) if ended(one.record.outcome, one.record.limit)]
    if any(one.record.spec.goal is None for one in episodes):
        raise RecordError(f"{run} holds tasks without hands.", "Score them with `humanclaw bench table`.")
    return [(one, hand_scores(one)) for one in episodes]


def _cells(episodes: Sequence[tuple[RecordedEpisode, HandScores]], geo: bool) -> Iterator[str]:
    houses = [one.record.spec.scene for one, _ in episodes]
    yield str(len(episodes))
    for stage in _STAGES:
        of = [
            (scores.twins if geo else scores.passed, house) for (_, scores), house in zip(episodes, houses, strict=True)
        ]
        known = [(met[stage], house) for met, house in of if stage in met]
        yield _percent(known)
    yield _percent([(scores.success, house) for (_, scores), house in zip(episodes, houses, strict=True)])
    yield f"{np.mean([scores.dropped for _, scores in episodes]):.2f}" if episodes else "-"
    yield f"{100 * np.nanmean([collisions(one)['any'] for one, _ in episodes]):.1f}" if episodes else "-"


def _percent(known: Sequence[tuple[bool, str]]) -> str:
    if not known:
        return "-"
    found = rate([met for met, _ in known], [house for _, house in known])
    return f"{100 * found.value:.1f} [{100 * found.low:.0f}, {100 * found.high:.0f}]"
