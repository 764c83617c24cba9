"""Score recorded runs: the numbers and the root cause of every episode, and metrics of plugins."""

from __future__ import annotations

import hashlib
import logging
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from inspect import unwrap
from pathlib import Path
from traceback import extract_tb, format_exception_only
from typing import Final, TypeAlias

from pydantic import ConfigDict, TypeAdapter
from tqdm import tqdm

from humanclaw import EpisodeSpec, HumanclawError, PluginError, Plugins, RecordedEpisode, RecordError, load_run
from humanclaw.storage import Cache, source_digest
from humanclaw.testing import OverdueError, bounded
from humanclaw_bench import own
from humanclaw_bench.attribution import also, attribute
from humanclaw_bench.failure_modes import Cause
from humanclaw_bench.own import Task
from humanclaw_bench.results import Result, named
from humanclaw_bench.scores import Scores, brier, score
from humanclaw_bench.settings import played_with_another
from humanclaw_bench.verification import standing

Scored = tuple[Scores, Cause | None]
Runs = Mapping[Path, Sequence[RecordedEpisode]]
Extra: TypeAlias = "Mapping[str, Measured]"
"""Metrics of plugins and successes of their tasks by name. Each returns a number, NaN if it does not apply."""
OWN: Final = frozenset({field.name for field in fields(Scores)} | {"success", "stage", "cause", "capability"})
"""Names of the numbers in a row of scores."""
COLLISIONS: Final = "collisions_"
_SECONDS: Final = 60.0
"""Time that a function of a plugin has for an episode: a loop without end must not hold up a run for ever."""
_REMEDY: Final = "Mend it, then score the run again."
_KEPT: Final = TypeAdapter(dict[str, Scores], config=ConfigDict(ser_json_inf_nan="constants"))
"""Scores by the seal of their record."""
_LOG: Final = logging.getLogger("humanclaw")


def metrics_of(plugins: Plugins) -> Extra:
    """Return the metrics of plugins and the successes of their tasks, by name.

    Raises PluginError for one with the name of one of the benchmark's own numbers, which it would replace.
    """
    items = (*plugins.registered("metrics"), *plugins.registered("splits"))
    for item in items:
        refuse_taken_name(item.name, item.owner)
    origins = {info.name: info.origin for info in plugins.infos}
    return {
        item.name: Measured(item.name, item.owner, item.value, item.description, origins.get(item.owner, ""))
        for item in items
    }


def refuse_taken_name(name: str, owner: str) -> None:
    """Raise PluginError if a metric of a plugin has the name of one of the benchmark's own numbers."""
    if name in OWN or name.startswith(COLLISIONS):
        problem = f"metric {name!r} of plugin {owner!r} has the name of one of the benchmark's own numbers."
        raise PluginError(problem, "Register it under another name, or leave the plugin out.")


def scored(episodes: Sequence[RecordedEpisode], extra: Extra | None = None, name: str = "") -> list[Scored]:
    """Return every episode's scores and, if it failed, its root cause. Shows progress for 50 episodes or more."""
    extra = extra or {}
    pairs = zip(episodes, _scored(tuple(episodes), name), strict=True)
    if unknown := unjudged([recorded.record.spec for recorded in episodes], extra):
        _LOG.warning("%s %s", *unknown)
    return [_with_extra(recorded, *pair, extra) for recorded, pair in pairs]


def unjudged(specs: Sequence[EpisodeSpec], extra: Extra) -> tuple[str, str] | None:
    """Return a problem and its remedy if a function decides the success of an episode and is not among these."""
    spec = next((spec for spec in specs if spec.success and spec.success not in extra), None)
    if spec is None:
        return None
    problem = f"the success of episode {spec.id!r} is decided by {spec.success!r}, which no plugin here brings."
    return problem, "Give its file: --plugin FILE."


def _with_extra(recorded: RecordedEpisode, scores: Scores, cause: Cause | None, extra: Extra) -> Scored:
    """Add the metrics of plugins, and judge an episode whose success a plugin's function decides."""
    scores = replace(scores, extra={name: measure(recorded) for name, measure in extra.items()})
    if not (judge := recorded.record.spec.success):
        return scores, cause
    value = scores.extra.get(judge, float("nan"))
    done = None if value != value else bool(value)
    scores = replace(scores, done=done, brier=brier(recorded, done), also="")
    if done is not False or not scores.finished or scores.outcome == "plugin_error":
        return scores, None
    about = extra[judge].description or judge
    return scores, Cause("task", f"not met: {about}", "task")


# The tables of a run and its page need the same.
@lru_cache(2)
def _scored(episodes: tuple[RecordedEpisode, ...], name: str) -> tuple[Scored, ...]:
    """Score records, but for those that this code scored before. Causes follow from the scores in no time."""
    cache, key, now, pairs = Cache("scores", limit=1 << 26), _kept_as(episodes), dict[str, Scores](), []
    before = _KEPT.validate_json(cache.get(key) or b"{}")
    for recorded in with_progress(episodes, f"scoring {name}"):
        seal = _seal(recorded)
        scores = before.get(seal) or score(recorded)
        if seal:
            now[seal] = scores
        cause = attribute(recorded, scores)
        further = "; ".join(other.label for other in also(recorded, cause, scores))
        pairs.append((replace(scores, also=further), cause))
    if now.keys() - before.keys():
        cache.put(key, _KEPT.dump_json(now))
    return tuple(pairs)


def _kept_as(episodes: Sequence[RecordedEpisode]) -> str:
    """Return the key of the scores of a run: its folder and the code, so that changed code scores anew."""
    homes = sorted({os.path.realpath(recorded.folder.parent) for recorded in episodes})
    code = source_digest(("humanclaw", "humanclaw_bench"), ("numpy",))
    return hashlib.sha256(os.fsencode("\n".join([code, *homes]))).hexdigest()


def _seal(recorded: RecordedEpisode) -> str:
    """Return what tells an episode from any other; empty if its scores follow from files that its seal misses."""
    record = recorded.record
    whole = "motion.npz" in record.files and not record.company and record.spec.partner is None
    return record.seal if whole else ""


@dataclass(frozen=True)
class Measured:
    """A function of a plugin. Calling it returns NaN if that raises or returns no number.

    The function gets a copy of the record, so it cannot alter the scores.
    """

    name: str
    owner: str
    measure: Callable[[RecordedEpisode], float]
    description: str = ""
    origin: str = ""
    """Its plugin's file or distribution."""

    def __call__(self, recorded: RecordedEpisode) -> float:
        try:
            return bounded(_SECONDS, lambda: float(self.measure(deepcopy(recorded))))
        except KeyboardInterrupt:
            raise
        except OverdueError as error:  # It still runs, and would do so for each further episode.
            stood = _stood(self.measure, error)
            raise HumanclawError(f"{self._failed_on(recorded)}: {error}{stood}.", _REMEDY) from None
        except BaseException as error:
            reason = format_exception_only(error)[-1].strip()
            _LOG.error("%s: %s%s. %s", self._failed_on(recorded), reason, _place(error), _REMEDY)
        return float("nan")

    def _failed_on(self, recorded: RecordedEpisode) -> str:
        kind = "the success function of task" if isinstance(self.measure, Task) else "metric"
        return f"{kind} {self.name!r} of plugin {self.owner!r} failed on episode {recorded.record.spec.id}"


def _place(error: BaseException) -> str:
    """Return where a plugin's function raised, such as ' (mine.py, line 9)'; empty if it raised nothing itself."""
    frames = extract_tb(error.__traceback__)
    last = max(place for place, frame in enumerate(frames) if frame.filename in (__file__, own.__file__))
    return "".join(f" ({frame.filename}, line {frame.lineno})" for frame in frames[last + 1 : last + 2])


def _stood(measure: Callable[..., object], error: OverdueError) -> str:
    """Return the file of an overdue function and the line that it had reached, as _place does."""
    code = getattr(unwrap(measure), "__code__", None)
    lines = [line for file, line in error.stood if code and file == code.co_filename]
    return f" ({code.co_filename}, line {lines[0]})" if code and lines else ""


def results_of(runs: Sequence[Path], files: Sequence[Path] = ()) -> tuple[Result, ...]:
    """Score runs. files: plugins with further metrics. Raises RecordError if a run is named twice."""
    if len({run.resolve() for run in runs}) < len(runs):
        raise RecordError("a run is named twice.", "Name each folder once.")
    return results({run: load_run(run) for run in runs}, metrics_of(Plugins.discover(files)))


def results(runs: Runs, extra: Extra) -> tuple[Result, ...]:
    """Score runs that are read already."""
    return results_from(runs, scored_runs(runs, extra))


def scored_runs(runs: Runs, extra: Extra) -> dict[Path, list[Scored]]:
    """Score the episodes of runs. Warns of a file that judges success and differs from the one of the run."""
    for run, episodes in runs.items():
        _warn_of_another_judge(run, episodes, extra)
    return {run: scored(episodes, extra, run.name) for run, episodes in runs.items()}


def results_from(runs: Runs, pairs: Mapping[Path, Sequence[Scored]]) -> tuple[Result, ...]:
    """Return the results of runs whose episodes are scored already."""
    known = {str(run): standing(run, episodes) for run, episodes in runs.items()}
    return named({str(run): scores for run, scores in pairs.items()}, known)


def _warn_of_another_judge(run: Path, episodes: Sequence[RecordedEpisode], extra: Extra) -> None:
    """Warn if the file that decides success differs from the one that a run was played with."""
    judges = {recorded.record.spec.success for recorded in episodes} & extra.keys()
    for file in sorted({Path(extra[judge].origin) for judge in judges}):
        if file.is_file() and played_with_another(run, file):
            _LOG.warning("%s differs from the plugin file that %s was played with: success is judged anew.", file, run)


def with_progress(episodes: Sequence[RecordedEpisode], doing: str) -> Iterable[RecordedEpisode]:
    """Wrap episodes in a progress bar if there are 50 or more, which take seconds."""
    return tqdm(episodes, desc=doing, disable=None if len(episodes) >= 50 else True, leave=False)
