"""Does a root cause name what is wrong? Put the blamed faculty right and see whether the episode is rescued.

Every episode is played by the oracle with one faculty missing, drawn by the episode's seed, until every root cause that faults lead
to has come up often enough. The benchmark blames a faculty for each failure, from the record alone. Then the episode is played
again with the blamed faculty put right. Some are played once more with another one put right; since only one is missing, those
go as they went before.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from humanclaw.records import EpisodeSpec
from humanclaw_bench.attribution import CAUSES, Cause
from humanclaw_bench.metrics import Scores
from humanclaw_scripted.faults import FAULTS, drawn

AGENT: Final = "faulty"
FACULTIES: Final = tuple(sorted({fault.faculty for fault in FAULTS.values()}))


PATIENCE: Final = 3
"""So many times as many episodes are tried as root causes are wanted: not every episode shows every fault."""


def options(repair: str = "") -> dict[str, Any]:
    """Of the agent whose faculties fail, with one of them put right."""
    return {"fault": "any"} | ({"repair": repair} if repair else {})


def another(faculty: str) -> str:
    """A faculty that was not blamed: the next by name."""
    others = [name for name in FACULTIES if name != faculty]
    later = [name for name in others if name > faculty]
    return (later or others)[0]


Causes = Mapping[str, Cause | None]
"""Why each episode failed, by its id; None for one that did not."""


def wanting(specs: Sequence[EpisodeSpec], causes: Causes, each: int) -> list[EpisodeSpec]:
    """What to play next: of every fault so many episodes as its root cause has come up too rarely, up to PATIENCE times each.

    causes: of those played.
    """
    by_fault: dict[str, list[EpisodeSpec]] = {name: [] for name in FAULTS}
    found: Counter[tuple[str, str]] = Counter()
    for spec in specs:
        name, cause = drawn(spec), causes.get(spec.id)
        by_fault[name].append(spec)
        found[name, cause.label if cause else ""] += 1
    todo: list[EpisodeSpec] = []
    for name, fault in FAULTS.items():
        fresh = [spec for spec in by_fault[name][: PATIENCE * each] if spec.id not in causes]
        lacking = each - found[name, fault.label]
        todo += fresh[: max(lacking, each // 3)] if lacking > 0 else []  # Few at a time would be many sittings.
    return todo


def blamed(specs: Sequence[EpisodeSpec], causes: Causes, faculty: str, most: int = 0) -> list[EpisodeSpec]:
    """The episodes whose failure is put down to a faculty; most: at most so many of each label, if given."""
    by_label: dict[str, list[EpisodeSpec]] = {}
    for spec in specs:
        if (cause := causes.get(spec.id)) and cause.faculty == faculty:
            by_label.setdefault(cause.label, []).append(spec)
    return [spec for mine in by_label.values() for spec in mine[: most or None]]


@dataclass(frozen=True)
class Rescued:
    """Of the episodes with one label: how many succeed once the blamed faculty is put right, and how many once another is."""

    label: str
    faculty: str
    count: int
    rescued: int
    others: int
    """How many were played with another faculty put right."""
    rescued_by_others: int


def rescued(causes: Causes, right: Mapping[str, Scores], other: Mapping[str, Scores]) -> tuple[Rescued, ...]:
    """The check, label by label in the order of the rules. right, other: scores by episode id with that faculty put right."""
    labels = [cause for cause in CAUSES if cause.faculty in FACULTIES and cause in causes.values()]
    return tuple(_rescued(cause, causes, right, other) for cause in labels)


def _rescued(cause: Cause, causes: Causes, right: Mapping[str, Scores], other: Mapping[str, Scores]) -> Rescued:
    mine = [episode for episode, found in causes.items() if found is cause]
    tried = [episode for episode in mine if episode in other]
    saved, saved_by_others = (
        sum(bool(scores[episode].success) for episode in episodes)
        for scores, episodes in ((right, mine), (other, tried))
    )
    return Rescued(cause.label, cause.faculty, len(mine), saved, len(tried), saved_by_others)


def markdown(rows: Sequence[Rescued]) -> str:
    lines = [
        "| label | faculty | episodes | rescued by that faculty | by another |",
        "| --- | --- | ---: | ---: | ---: |",
    ]
    lines += [
        f"| {row.label} | {row.faculty} | {row.count} | {_share(row.rescued, row.count)} | "
        f"{row.rescued_by_others} of {row.others} |"
        for row in rows
    ]
    return "\n".join(lines)


def _share(part: int, whole: int) -> str:
    return f"{part} ({100 * part / whole:.0f} %)" if whole else "-"
