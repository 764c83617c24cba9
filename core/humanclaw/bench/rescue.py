"""Does a root cause name what is wrong? Put the blamed faculty right and see whether the episode is rescued.

Every episode is played by the oracle with one faculty missing, drawn by the episode's seed. The benchmark blames a faculty for each
failure, from the record alone. Then the episode is played again twice: with the blamed faculty put right, and with another one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from humanclaw.bench.attribution import Cause
from humanclaw.bench.faulty import FAULTS
from humanclaw.bench.metrics import Scores

AGENT: Final = "faulty"
FACULTIES: Final = tuple(sorted({fault.faculty for fault in FAULTS.values()}))


def options(repair: str = "") -> dict[str, Any]:
    """Of the agent whose faculties fail, with one of them put right."""
    return {"fault": "any"} | ({"repair": repair} if repair else {})


def another(faculty: str) -> str:
    """A faculty that was not blamed: the next by name."""
    others = [name for name in FACULTIES if name != faculty]
    later = [name for name in others if name > faculty]
    return (later or others)[0]


@dataclass(frozen=True)
class Rescued:
    """Of the episodes with one label: how many there were, and how many succeed once a faculty is put right."""

    label: str
    faculty: str
    count: int
    by_blamed: int
    by_another: int


Causes = Mapping[str, Cause | None]
"""Why each episode failed, by its id; None for one that did not."""


def rescued(causes: Causes, blamed: Mapping[str, Scores], other: Mapping[str, Scores]) -> tuple[Rescued, ...]:
    """The check, label by label. blamed, other: scores by episode id with that faculty put right."""
    failed = {episode: cause for episode, cause in causes.items() if cause is not None and cause.faculty in FACULTIES}
    labels = {cause.label: cause for cause in failed.values()}
    return tuple(_rescued(cause, failed, blamed, other) for _, cause in sorted(labels.items()))


def _rescued(cause: Cause, failed: Causes, blamed: Mapping[str, Scores], other: Mapping[str, Scores]) -> Rescued:
    mine = [episode for episode, found in failed.items() if found is not None and found.label == cause.label]
    won = [sum(bool(scores[episode].success) for episode in mine) for scores in (blamed, other)]
    return Rescued(cause.label, cause.faculty, len(mine), *won)


def markdown(rows: Sequence[Rescued]) -> str:
    lines = [
        "| label | faculty | episodes | rescued by that faculty | by another |",
        "| --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| {row.label} | {row.faculty} | {row.count} | {_share(row.by_blamed, row.count)} | "
        f"{_share(row.by_another, row.count)} |"
        for row in rows
    ]
    return "\n".join(lines)


def _share(part: int, whole: int) -> str:
    return f"{part} ({100 * part / whole:.0f} %)" if whole else "-"
