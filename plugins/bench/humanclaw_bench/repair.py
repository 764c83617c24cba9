"""Counterfactual repair: does a root cause name what is wrong? Put the blamed capability right, and see whether that
mends it.

Every episode is played by an agent with a known fault, drawn by the episode's seed, until every root cause that faults
lead to has come up often enough. The benchmark blames a capability for each failure, from the record alone. Then the
episode is played again with the blamed capability put right. Some are played once more with another one put right;
since only one is missing, those go as they went before.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from humanclaw import EpisodeSpec, HumanclawError, Plugins
from humanclaw_bench.attribution import CAUSES, Cause
from humanclaw_bench.hookspecs import Fault
from humanclaw_bench.metrics import Scores
from humanclaw_bench.worker import Job

PATIENCE: Final = 3
"""So many times as many episodes are tried as root causes are wanted: not every episode shows every fault."""
Causes = Mapping[str, Cause | None]
"""Why each episode failed, by its id; None for one that did not."""


def known_faults(plugins: Plugins) -> tuple[Fault, ...]:
    """Return the faults that plugins brought. Raises HumanclawError if there are none."""
    faults = tuple(one.value for one in plugins.registered("faults"))
    if not faults:
        raise HumanclawError("no plugin brings an agent with a known fault.", "Run `pip install humanclaw-scripted`.")
    return faults


def capabilities(faults: Sequence[Fault]) -> tuple[str, ...]:
    """Return what the faults take away, by name."""
    return tuple(sorted({fault.capability for fault in faults}))


def another(capability: str, faults: Sequence[Fault]) -> str:
    """Return a capability that was not blamed: the next by name."""
    others = [name for name in capabilities(faults) if name != capability]
    later = [name for name in others if name > capability]
    return (later or others)[0]


def drawn(spec: EpisodeSpec, faults: Sequence[Fault]) -> Fault | None:
    """Return the fault with which an episode is played: by its seed, among those that it can show."""
    fitting = [fault for fault in faults if fault.fits(spec)]
    return fitting[int(np.random.default_rng([spec.seed, 77]).integers(len(fitting)))] if fitting else None


def by_fault(specs: Sequence[EpisodeSpec], faults: Sequence[Fault]) -> Iterator[tuple[Fault, list[EpisodeSpec]]]:
    """Yield the episodes by the fault with which they are played."""
    for fault in faults:
        if mine := [spec for spec in specs if drawn(spec, faults) is fault]:
            yield fault, mine


def job(fault: Fault, repair: str = "") -> Job:
    """Return what to run for a fault. repair: a capability that is put right."""
    return Job(fault.agent, {**fault.options, **({"repair": repair} if repair else {})})


def wanting(specs: Sequence[EpisodeSpec], causes: Causes, each: int, faults: Sequence[Fault]) -> list[EpisodeSpec]:
    """Return what to play next: of every fault so many episodes as its root cause has come up too rarely, up to
    PATIENCE times each.

    causes: of those played.
    """
    todo: list[EpisodeSpec] = []
    for fault, mine in by_fault(specs, faults):
        fresh = [spec for spec in mine[: PATIENCE * each] if spec.id not in causes]
        lacking = each - sum(_label(causes.get(spec.id)) == fault.cause for spec in mine)
        todo += fresh[: max(lacking, each // 3)] if lacking > 0 else []  # Few at a time would be many rounds.
    return todo


def _label(cause: Cause | None) -> str:
    return cause.label if cause else ""


def blamed(specs: Sequence[EpisodeSpec], causes: Causes, capability: str, most: int = 0) -> list[EpisodeSpec]:
    """Return the episodes whose failure is put down to a capability; most: at most so many of each label, if given."""
    by_label: dict[str, list[EpisodeSpec]] = {}
    for spec in specs:
        if (cause := causes.get(spec.id)) and cause.capability == capability:
            by_label.setdefault(cause.label, []).append(spec)
    return [spec for mine in by_label.values() for spec in mine[: most or None]]


@dataclass(frozen=True)
class Repaired:
    """Of the episodes with one label: how many succeed once the blamed capability is put right, and how many once
    another is."""

    label: str
    capability: str
    count: int
    repaired: int
    others: int
    """How many were played with another capability put right."""
    repaired_by_others: int


def repaired(causes: Causes, right: Mapping[str, Scores], other: Mapping[str, Scores]) -> tuple[Repaired, ...]:
    """Return the check, label by label in the order of the rules. right, other: scores by episode id with that
    capability put right."""
    played = {cause for episode, cause in causes.items() if episode in right}
    return tuple(_repaired(cause, causes, right, other) for cause in CAUSES if cause in played)


def _repaired(cause: Cause, causes: Causes, right: Mapping[str, Scores], other: Mapping[str, Scores]) -> Repaired:
    mine = [episode for episode, found in causes.items() if found is cause]
    tried = [episode for episode in mine if episode in other]
    saved, saved_by_others = (
        sum(bool(scores[episode].success) for episode in episodes)
        for scores, episodes in ((right, mine), (other, tried))
    )
    return Repaired(cause.label, cause.capability, len(mine), saved, len(tried), saved_by_others)


def markdown(rows: Sequence[Repaired]) -> str:
    lines = [
        "| label | capability | episodes | mended by that capability | by another |",
        "| --- | --- | ---: | ---: | ---: |",
    ]
    lines += [
        f"| {row.label} | {row.capability} | {row.count} | {_share(row.repaired, row.count)} | "
        f"{row.repaired_by_others} of {row.others} |"
        for row in rows
    ]
    return "\n".join(lines)


def _share(part: int, whole: int) -> str:
    return f"{part} ({100 * part / whole:.0f} %)" if whole else "-"
