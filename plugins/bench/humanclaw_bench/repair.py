"""Counterfactual repair: check root causes by repairing the blamed capability and playing again.

An agent with a known fault, drawn by the episode's seed, plays episodes until every root cause of the faults occurred
often enough. The benchmark blames a capability for each failure, from the record alone. Then the episode is played
again with the blamed capability repaired.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from humanclaw import EpisodeSpec, HumanclawError, Plugins
from humanclaw.plugins import install
from humanclaw_bench.attribution import CAUSES, FURTHER
from humanclaw_bench.causes import Cause
from humanclaw_bench.hookspecs import Fault
from humanclaw_bench.scores import Scores
from humanclaw_bench.worker import Job

PATIENCE: Final = 3
"""Number of episodes tried per wanted root cause, because not every episode shows every fault."""
Causes = Mapping[str, Cause | None]
"""Episode id to root cause; None if the episode did not fail."""


def known_faults(plugins: Plugins) -> tuple[Fault, ...]:
    """Return the faults of plugins. Raises HumanclawError if there are none."""
    faults = tuple(one.value for one in plugins.registered("faults"))
    if not faults:
        raise HumanclawError("no plugin has an agent with a known fault.", f"Run `{install(['humanclaw-scripted'])}`.")
    return faults


def capabilities(faults: Sequence[Fault]) -> tuple[str, ...]:
    """Return the names of the capabilities that the faults remove."""
    return tuple(sorted({fault.capability for fault in faults}))


def drawn(spec: EpisodeSpec, faults: Sequence[Fault]) -> Fault | None:
    """Return the fault with which an episode is played, drawn by its seed from those that it can show."""
    fitting = [fault for fault in faults if fault.fits(spec)]
    return fitting[int(np.random.default_rng([spec.seed, 77]).integers(len(fitting)))] if fitting else None


def by_fault(specs: Sequence[EpisodeSpec], faults: Sequence[Fault]) -> Iterator[tuple[Fault, list[EpisodeSpec]]]:
    """Yield each fault with the episodes that are played with it."""
    for fault in faults:
        if mine := [spec for spec in specs if drawn(spec, faults) is fault]:
            yield fault, mine


def job(fault: Fault, repair: str = "") -> Job:
    """Return the job for a fault. repair: a capability to repair."""
    return Job(fault.agent, {**fault.options, **({"repair": repair} if repair else {})})


def wanting(specs: Sequence[EpisodeSpec], causes: Causes, each: int, faults: Sequence[Fault]) -> list[EpisodeSpec]:
    """Return the episodes to play next: for every fault as many as its root cause occurred too rarely.

    At most PATIENCE * each episodes per fault. causes: of the played episodes.
    """
    todo: list[EpisodeSpec] = []
    for fault, mine in by_fault(specs, faults):
        fresh = [spec for spec in mine[: PATIENCE * each] if spec.id not in causes]
        lacking = each - sum(_label(causes.get(spec.id)) == fault.cause for spec in mine)
        todo += fresh[: max(lacking, each // 3)] if lacking > 0 else []  # A third at least: few rounds.
    return todo


def _label(cause: Cause | None) -> str:
    return cause.label if cause else ""


def blamed(specs: Sequence[EpisodeSpec], causes: Causes, capability: str) -> list[EpisodeSpec]:
    """Return the episodes whose failure is blamed on a capability."""
    return [spec for spec in specs if (cause := causes.get(spec.id)) and cause.capability == capability]


@dataclass(frozen=True)
class Repaired:
    """The episodes with one label, and how many succeed after the blamed capability is repaired."""

    label: str
    capability: str
    count: int
    repaired: int
    second: int = 0
    """Number of the others with a second label that blames the missing capability."""


def repaired(causes: Causes, right: Mapping[str, Scores], second: Container[str] = ()) -> tuple[Repaired, ...]:
    """Check every label, in the order of the rules.

    right: episode id to scores with the blamed capability repaired. second: episodes with a second label that blames
    the missing capability.
    """
    played = {cause for episode, cause in causes.items() if episode in right}
    return tuple(_repaired(cause, causes, right, second) for cause in CAUSES if cause in played)


def _repaired(cause: Cause, causes: Causes, right: Mapping[str, Scores], second: Container[str]) -> Repaired:
    mine = [episode for episode, found in causes.items() if found is cause]
    others = [episode for episode in mine if not right[episode].success]
    hidden = sum(episode in second for episode in others)
    return Repaired(cause.label, cause.capability, len(mine), len(mine) - len(others), hidden)


def second_blames(scores: Scores, capability: str) -> bool:
    """Tell whether a second label of a failure blames a capability."""
    further = scores.also.split("; ")
    return any(cause.label in further and cause.capability == capability for cause in (*CAUSES, *FURTHER))


def markdown(rows: Sequence[Repaired]) -> str:
    lines = [
        "| label | capability | episodes | mended by that capability | others: a second label blames the missing one |",
        "| --- | --- | ---: | ---: | ---: |",
    ]
    lines += [
        f"| {r.label} | {r.capability} | {r.count} | {_share(r.repaired, r.count)} | "
        f"{_share(r.second, r.count - r.repaired)} |"
        for r in rows
    ]
    return "\n".join(lines)


def _share(part: int, whole: int) -> str:
    return f"{part} ({100 * part / whole:.0f} %)" if whole else "-"
