"""Score recorded runs: the numbers and the root cause of every episode, and metrics of plugins."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import fields, replace
from functools import lru_cache, partial
from pathlib import Path
from traceback import format_exception_only
from typing import Final

from tqdm import tqdm

from humanclaw import PluginError, Plugins, RecordedEpisode, RecordError, load_run
from humanclaw_bench.attribution import also, attribute
from humanclaw_bench.failure_modes import Cause
from humanclaw_bench.results import Result, named
from humanclaw_bench.scores import Scores, score
from humanclaw_bench.verification import standing

Scored = tuple[Scores, Cause | None]
Runs = Mapping[Path, Sequence[RecordedEpisode]]
Extra = Mapping[str, Callable[[RecordedEpisode], float]]
"""Metrics of plugins by name. Each returns a number, NaN if it does not apply."""
OWN: Final = frozenset({field.name for field in fields(Scores)} | {"success", "stage", "cause", "capability"})
"""Names of the numbers in a row of scores."""
COLLISIONS: Final = "collisions_"
_LOG: Final = logging.getLogger("humanclaw")


def metrics_of(plugins: Plugins) -> Extra:
    """Return the metrics of plugins by name.

    Raises PluginError for a metric with the name of one of the benchmark's own numbers, which it would replace.
    """
    metrics = plugins.registered("metrics")
    for metric in metrics:
        refuse_taken_name(metric.name, metric.owner)
    return {metric.name: partial(_measured, metric.name, metric.owner, metric.value) for metric in metrics}


def refuse_taken_name(name: str, owner: str) -> None:
    """Raise PluginError if a metric of a plugin has the name of one of the benchmark's own numbers."""
    if name in OWN or name.startswith(COLLISIONS):
        problem = f"metric {name!r} of plugin {owner!r} has the name of one of the benchmark's own numbers."
        raise PluginError(problem, "Register it under another name, or leave the plugin out.")


def scored(episodes: Sequence[RecordedEpisode], extra: Extra | None = None, name: str = "") -> list[Scored]:
    """Return every episode's scores and, if it failed, its root cause. Shows progress for 50 episodes or more."""
    pairs = zip(episodes, _scored(tuple(episodes), name), strict=True)
    metrics = (extra or {}).items()
    return [
        (replace(scores, extra={name: measure(recorded) for name, measure in metrics}), cause)
        for recorded, (scores, cause) in pairs
    ]


# Scoring takes a minute a thousand episodes; the tables of a run and its page need the same.
@lru_cache(2)
def _scored(episodes: tuple[RecordedEpisode, ...], name: str) -> tuple[Scored, ...]:
    pairs = []
    for recorded in with_progress(episodes, f"scoring {name}"):
        scores = score(recorded)
        cause = attribute(recorded, scores)
        further = "; ".join(other.label for other in also(recorded, cause, scores))
        pairs.append((replace(scores, also=further), cause))
    return tuple(pairs)


def _measured(name: str, owner: str, measure: Callable[[RecordedEpisode], float], recorded: RecordedEpisode) -> float:
    """Return a metric of a plugin; NaN if it raises or returns no number.

    It gets a copy of the record, so it cannot alter the scores.
    """
    try:
        return float(measure(deepcopy(recorded)))
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        reason = format_exception_only(error)[-1].strip()
        _LOG.error("metric %r of plugin %r failed on episode %s: %s", name, owner, recorded.record.spec.id, reason)
    return float("nan")


def results_of(runs: Sequence[Path], files: Sequence[Path] = ()) -> tuple[Result, ...]:
    """Score runs. files: plugins with further metrics. Raises RecordError if a run is named twice."""
    if len({run.resolve() for run in runs}) < len(runs):
        raise RecordError("a run is named twice.", "Name each folder once.")
    return results({run: load_run(run) for run in runs}, metrics_of(Plugins.discover(files)))


def results(runs: Runs, extra: Extra) -> tuple[Result, ...]:
    """Score runs that are read already."""
    pairs = {str(run): scored(episodes, extra, run.name) for run, episodes in runs.items()}
    return named(pairs, {str(run): standing(run, episodes) for run, episodes in runs.items()})


def with_progress(episodes: Sequence[RecordedEpisode], doing: str) -> Iterable[RecordedEpisode]:
    """Wrap episodes in a progress bar if there are 50 or more, which take seconds."""
    return tqdm(episodes, desc=doing, disable=None if len(episodes) >= 50 else True, leave=False)
