"""Counterfactual repair: does a root cause name what is wrong? Put the blamed capability right, and see whether that
mends it.

Every episode is played by an agent with a known fault, drawn by the episode's seed, until every root cause that faults
lead to has come up often enough. The benchmark blames a capability for each failure, from the record alone. Then the
episode is played again with the blamed capability put right.

That this and no other would have helped is asked of agents with two faults at once: the one that is blamed is put
right, and then, instead, the other, which is as real. The failure is to go in the first case and to stay in the second.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from humanclaw import EpisodeSpec, HumanclawError, Plugins
from humanclaw_bench.attribution import CAUSES, Cause
from humanclaw_bench.hookspecs import Fault
from humanclaw_bench.scores import Scores
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


def drawn(spec: EpisodeSpec, faults: Sequence[Fault]) -> Fault | None:
    """Return the fault with which an episode is played: by its seed, among those that it can show."""
    fitting = [fault for fault in faults if fault.fits(spec)]
    return fitting[int(np.random.default_rng([spec.seed, 77]).integers(len(fitting)))] if fitting else None


def companion(spec: EpisodeSpec, faults: Sequence[Fault]) -> Fault | None:
    """Return the fault that an episode's own is joined with: by its seed, among those that go with it."""
    own = drawn(spec, faults)
    fitting = [fault for fault in faults if own and fault.fits(spec) and own.goes_with(fault)]
    return fitting[int(np.random.default_rng([spec.seed, 78]).integers(len(fitting)))] if fitting else None


def by_fault(specs: Sequence[EpisodeSpec], faults: Sequence[Fault]) -> Iterator[tuple[Fault, list[EpisodeSpec]]]:
    """Yield the episodes by the fault with which they are played."""
    for fault in faults:
        if mine := [spec for spec in specs if drawn(spec, faults) is fault]:
            yield fault, mine


def job(fault: Fault, repair: str = "") -> Job:
    """Return what to run for a fault. repair: a capability that is put right."""
    return Job(fault.agent, {**fault.options, **({"repair": repair} if repair else {})})


def pair_job(own: Fault, other: Fault, repair: str = "") -> Job:
    """Return what to run for two faults at once. repair: a capability that is put right."""
    return Job(own.agent, {**own.with_another(other), **({"repair": repair} if repair else {})})


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
    """Of the episodes with one label: how many succeed once the blamed capability is put right."""

    label: str
    capability: str
    count: int
    repaired: int


def repaired(causes: Causes, right: Mapping[str, Scores]) -> tuple[Repaired, ...]:
    """Check label by label, in the order of the rules. right: scores by episode id with the blamed one put right."""
    played = {cause for episode, cause in causes.items() if episode in right}
    return tuple(_repaired(cause, causes, right) for cause in CAUSES if cause in played)


def _repaired(cause: Cause, causes: Causes, right: Mapping[str, Scores]) -> Repaired:
    mine = [episode for episode, found in causes.items() if found is cause]
    return Repaired(cause.label, cause.capability, len(mine), sum(bool(right[episode].success) for episode in mine))


@dataclass(frozen=True)
class Paired:
    """Of the failures of agents with two faults at once that got one label: whether it goes with either put right."""

    label: str
    capability: str
    count: int
    astray: int = 0
    """Blamed on a capability that neither fault takes away."""
    gone: int = 0
    """Without that failure once the blamed capability is put right."""
    gone_by_other: int = 0
    """Without it once the other is."""

    @property
    def tried(self) -> int:
        """Of count those that were blamed on one of the two."""
        return self.count - self.astray


def paired(
    causes: Causes, mended: Mapping[str, Causes], faults: Mapping[str, tuple[Fault, Fault]]
) -> tuple[Paired, ...]:
    """Check two faults at once, label by label in the order of the rules.

    causes: of the episodes with both. mended: the same with a capability put right, by its name. faults: the two of
    each episode.
    """
    return tuple(
        _paired(cause, [episode for episode, found in causes.items() if found is cause], mended, faults)
        for cause in CAUSES
        if cause in causes.values()
    )


def _paired(
    cause: Cause, mine: Sequence[str], mended: Mapping[str, Causes], faults: Mapping[str, tuple[Fault, Fault]]
) -> Paired:
    found = Paired(cause.label, cause.capability, len(mine))
    for episode in mine:
        missing = {fault.capability for fault in faults[episode]}
        if cause.capability not in missing:
            found = replace(found, astray=found.astray + 1)
            continue
        (other,) = missing - {cause.capability}
        gone, gone_by_other = (mended[name][episode] is not cause for name in (cause.capability, other))
        found = replace(found, gone=found.gone + gone, gone_by_other=found.gone_by_other + gone_by_other)
    return found


def markdown(rows: Sequence[Repaired]) -> str:
    lines = ["| label | capability | episodes | mended by that capability |", "| --- | --- | ---: | ---: |"]
    lines += [f"| {r.label} | {r.capability} | {r.count} | {_share(r.repaired, r.count)} |" for r in rows]
    return "\n".join(lines)


def pairs_markdown(rows: Sequence[Paired]) -> str:
    """Tell of two faults at once whether the failure goes."""
    lines = [
        "| two faults at once, label | blamed | episodes | neither of the two | gone with it | gone with the other |",
        "| --- | --- | ---: | ---: | ---: | ---: |",
    ]
    lines += [
        f"| {r.label} | {r.capability} | {r.count} | {r.astray} | {_share(r.gone, r.tried)} | "
        f"{_share(r.gone_by_other, r.tried)} |"
        for r in rows
    ]
    return "\n".join(lines)


def _share(part: int, whole: int) -> str:
    return f"{part} ({100 * part / whole:.0f} %)" if whole else "-"
