"""The leaderboard: submitted runs of a folder, scored from their records and ranked on a page."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cache, cached_property
from pathlib import Path
from typing import Final
from urllib.parse import quote

import jinja2
import numpy as np

from humanclaw import RecordError
from humanclaw.cli import counted, legible
from humanclaw.records import REPORT
from humanclaw.storage import Folder, lacking
from humanclaw_bench.conditions import labels, summary
from humanclaw_bench.metrics import ARRIVE, FALSE_CLAIMS, FIND, INTERACT, NAV, SOLVED, estimate
from humanclaw_bench.replay import Replayed
from humanclaw_bench.scoring import Extra
from humanclaw_bench.statistics import Estimate
from humanclaw_bench.submission import NAME, ScoredRun, Submission, read
from humanclaw_bench.verification import known_split

RATES: Final = (SOLVED, INTERACT, ARRIVE, NAV, FIND)
"""The ranked rates, from last to first stage: the first one ranks, of those that a table has. Only own tasks, hands,
questions and partners have SOLVED; elsewhere its column is hidden."""
WHOLE: Final = "whole"
"""Result of records that are what run.json and submission.json say."""
_INDEX: Final = "index.html"


Again = Callable[[Path], Sequence[Replayed]]
"""Plays episodes of a run again."""


@dataclass(frozen=True)
class Checks:
    """How the submitted runs are checked."""

    any_pace: bool = False
    """Whether to rank runs whose calls move longer or faster than the paper's skills too."""
    again: Again | None = None
    """Plays recorded calls again; None plays none."""
    by: str = ""
    """Who plays them again, as the page names it."""
    hidden: str = ""
    """Digest of the hidden test; empty for none."""
    pages: Callable[[Path, Path], None] | None = None
    """Writes the page of a run into another folder; None links to none."""
    out: Path | None = None
    """Folder to publish: of what submitters sent it holds records alone. None writes index.html beside them."""
    extra: Extra = field(default_factory=dict)
    """Metrics of plugins, and the functions that decide success."""


@dataclass(frozen=True)
class Entry:
    """A submitted run on the page."""

    run: Path
    scored: ScoredRun
    submission: Submission
    records: str = WHOLE
    """Result of the checks of its records."""
    apart: str = ""
    """Reason why it is not ranked; empty if it is."""
    replayed: bool = False
    """Whether its calls were played again, and did the same."""
    page: str = ""
    """Address of the run's page beside this one; empty if there is none."""
    label: str = ""
    """Settings in which it differs from the others of its table."""

    @property
    def table(self) -> tuple[str, int]:
        """Digest of its split and number of its episodes: equal for rows that may be compared."""
        return self.scored.manifest.split, self.scored.manifest.episodes

    @property
    def agent(self) -> str:
        result = self.scored.result
        privileged = any(scores.privileged for scores in result.scores)
        return result.name + " (privileged)" * privileged + " (in process)" * result.known.in_process

    @cached_property
    def rates(self) -> tuple[Estimate, ...]:
        """One for each of RATES."""
        return tuple(estimate(metric, self.scored.result.scores) for metric in RATES)

    @property
    def title(self) -> str:
        """Engine, and the settings in which it differs."""
        return self.scored.result.scores[0].simulator + self.label

    @property
    def facts(self) -> dict[str, str]:
        """Return what a row folds, by its name."""
        result = self.scored.result
        return {
            "date of the model": self.submission.model_date or "-",
            FALSE_CLAIMS.name: FALSE_CLAIMS.number(estimate(FALSE_CLAIMS, result.scores).value),
            "episodes": f"{len(result.finished)} of {result.total}",
            "motion (s)": _motion(self),
            "cost ($)": f"{sum(scores.cost for scores in result.scores):.2f}",
            "temperature": _temperature(self),
            "verifier": result.scores[0].verifier or "-",
            "engine": result.scores[0].simulator,
            "settings": _settings(self),
            "date of the submission": self.submission.made.isoformat(),
        }


def leaderboard(folder: Path, checks: Checks = Checks()) -> Path:
    """Write index.html of all submitted runs in a folder, the best InteractSR first, and return its path.

    Every number is computed from the records. Each split has a table. Partial and damaged runs, runs that differ when
    they are played again, and runs that are not at the paper's pace are listed apart.

    Raises RecordError if there is no submission.
    """
    submitted, unread = _entries(folder, checks)
    if not (submitted or unread):
        remedy = "Put a run's folder there and call `humanclaw bench submit RUN --who NAME`."
        raise lacking(folder, "submitted run", remedy)
    ranked: dict[tuple[str, int], list[Entry]] = defaultdict(list)
    for entry in submitted:
        if not entry.apart:
            ranked[entry.table].append(entry)
    tables = {table: sorted(_labelled(entries), key=_rank, reverse=True) for table, entries in sorted(ranked.items())}
    names = {table: _split(rows[0], checks.hidden) for table, rows in tables.items()}
    page = _template().render(
        splits=", ".join(dict.fromkeys(names.values())) or "no ranked run",
        sections=[
            (f"{names[split, count]}: {counted(count, 'episode')}, digest {split[:12]}", rows)
            for (split, count), rows in tables.items()
        ],
        apart=_labelled([entry for entry in submitted if entry.apart]),
        unread=unread,
        rates=RATES,
        meanings=RATES[not any(entry.rates[0].count for entry in submitted) :],
        made=datetime.now(UTC).date().isoformat(),
    )
    out = checks.out or folder
    out.mkdir(parents=True, exist_ok=True)
    if (out / _INDEX).is_dir():
        raise RecordError(f"{out / _INDEX} is a folder, not a file.", "Name another folder with --pages.")
    Folder(out).write(_INDEX, page.encode())
    return out / _INDEX


def _entries(folder: Path, checks: Checks) -> tuple[list[Entry], list[str]]:
    """Return the submitted runs of a folder, and the errors of those that could not be read."""
    submitted, unread = [], []
    for run in map(folder.joinpath, Folder(folder).names()):
        if run.is_symlink() or not (run / NAME).exists():
            continue
        try:
            submitted.append(_with_page(_checked(_entry(run, checks.extra), checks), checks))
        except RecordError as error:
            unread.append(str(error))
        except Exception as error:  # A stranger's broken file must not hide the others.
            unread.append(f"{run} cannot be scored: {type(error).__name__}.")
    return submitted, unread


def _entry(run: Path, extra: Extra) -> Entry:
    if run.name.lower() == _INDEX:
        raise RecordError(f"{run} has the name of the board's own page.", "Rename it, such as to mine.")
    scored = ScoredRun.read(run, extra)
    return Entry(run, scored, read(run, scored.episodes))


def _checked(entry: Entry, checks: Checks) -> Entry:
    """Say why a run is not ranked, if it is not, and play its calls again if the host wishes."""
    result = entry.scored.result
    missing = result.total - len(result.finished)
    apart = f"partial: {counted(missing, 'episode')} missing" if missing else ""
    if not (apart or checks.any_pace or all(scores.in_pace for scores in result.scores)):
        apart = f"not at the paper's pace ({_motion(entry)}); --any-pace ranks it"
    if checks.again is None:
        return replace(entry, apart=apart)
    played = checks.again(entry.run)
    differing = [f"{each.episode}: {each.differing[0]}" for each in played if each.differing]
    apart = f"differs when played again: {differing[0]}" if differing else apart
    same = bool(played) and all(map(Replayed.same, played))
    return replace(entry, records=_replayed(played, checks.by), apart=apart, replayed=same)


def _with_page(entry: Entry, checks: Checks) -> Entry:
    """Write the page of a run into the folder to publish, and link to it."""
    if not (checks.pages and checks.out):
        return entry
    with suppress(OSError, RecordError):
        checks.pages(entry.run, checks.out / entry.run.name)
        if Folder(checks.out).has(f"{entry.run.name}/{REPORT}"):
            return replace(entry, page=quote(f"{entry.run.name}/{REPORT}"))
    return replace(entry, records=f"{entry.records}; page not written")


def _replayed(played: Sequence[Replayed], by: str) -> str:
    """Return the result of records that were played again. by: who did that."""
    same = f"{sum(map(Replayed.same, played))} of {counted(len(played), 'episode')} played again the same"
    same += f" by {by}" if by else ""
    unknown = [f"{each.episode}: {each.incomparable}" for each in played if each.incomparable]
    return f"{WHOLE}, but only {same}: {unknown[0]}" if unknown else f"{WHOLE}; {same}"


def _split(entry: Entry, hidden: str) -> str:
    """Return the name of an entry's split: the benchmark's, or those of the functions that decide its tasks."""
    split = entry.scored.manifest.split
    own = dict.fromkeys(scores.spec.success for scores in entry.scored.result.scores if scores.spec)
    other = ", ".join([*filter(None, own), "not one of the benchmark's"])
    return "hidden test" if hidden and split == hidden else known_split(split)[0] or other


def _labelled(entries: Sequence[Entry]) -> list[Entry]:
    results = [entry.scored.result for entry in entries]
    differing = labels([(result.name, result.conditions) for result in results])
    return [replace(entry, label=label) for entry, label in zip(entries, differing, strict=True)]


def _rank(entry: Entry) -> tuple[float, ...]:
    return tuple(rate.value if rate.count else -1.0 for rate in entry.rates)


def _temperature(entry: Entry) -> str:
    """Return the temperature of the agent's model. An agent that could not be made has no settings."""
    settings = (episode.record.settings.get("agent", {}) for episode in entry.scored.episodes)
    return next((f"{agent['temperature']!s:.20}" for agent in settings if agent.get("temperature") is not None), "-")


def _settings(entry: Entry) -> str:
    """Return the settings in which rows may differ."""
    run = entry.scored.manifest.content
    unusual = {key: run[key] for key in ("options", "plugin files", "in process") if run.get(key)}
    if unusual.get("options") == {"profile": "default"}:
        del unusual["options"]
    given = [f"{key} {json.dumps(value, ensure_ascii=False)}" for key, value in unusual.items()]
    return "; ".join([*given, summary(entry.scored.result.conditions)])


def _motion(entry: Entry) -> str:
    """Return the mean seconds of motion of an episode, and the longest and fastest call."""
    known = entry.scored.result.finished
    mean = float(np.mean([scores.motion for scores in known] or [np.nan]))
    longest, fastest = (
        max((getattr(scores, name) for scores in known), default=0.0) for name in ("longest", "fastest")
    )
    return f"{mean:.1f}, at most {longest:.1f} a call, {fastest:.2f} m in half a second"


@cache
def _template() -> jinja2.Template:
    made = jinja2.Environment(
        loader=jinja2.PackageLoader("humanclaw_bench", "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,  # A misspelt name in a template is an error, not an empty text.
        # Submitters write names, which must not reorder the page's letters.
        finalize=lambda value: legible(value) if type(value) is str else value,
    )
    return made.get_template("leaderboard.html")
