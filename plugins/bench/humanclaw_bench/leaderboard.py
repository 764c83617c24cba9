"""The leaderboard: submitted runs of a folder, scored from their records and ranked on a page."""

from __future__ import annotations

import html
import json
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Final
from urllib.parse import quote

import numpy as np

from humanclaw import RecordError
from humanclaw.cli import counted, legible
from humanclaw.records import REPORT
from humanclaw.storage import Folder, lacking
from humanclaw_bench.conditions import labels, summary
from humanclaw_bench.metrics import ARRIVE, FALSE_CLAIMS, FIND, INTERACT, NAV, Metric, estimate
from humanclaw_bench.replay import Replayed
from humanclaw_bench.submission import NAME, ScoredRun, Submission, read
from humanclaw_bench.verification import known_split

RATES: Final = (FIND, NAV, ARRIVE, INTERACT)
"""The ranked rates, from first to last stage."""
WHOLE: Final = "whole"
"""Result of records that are what run.json and submission.json say."""
_INDEX: Final = "index.html"


class Markup(str):
    """Text of a page whose parts are escaped already."""


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

    @property
    def table(self) -> tuple[str, int]:
        """Digest of its split and number of its episodes: equal for rows that may be compared."""
        return self.scored.manifest.split, self.scored.manifest.episodes


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
    sections = sorted(ranked.items())
    splits = [_split(split, checks.hidden) for (split, _), _ in sections]
    body = "".join(_section(*table, entries, checks.hidden) for table, entries in sections)
    body += _unranked([entry for entry in submitted if entry.apart], unread)
    page = _PAGE.format(
        splits=html.escape(", ".join(dict.fromkeys(splits)) or "no ranked run"),
        meanings="; ".join(f"{metric.name}: {metric.meaning}" for metric in RATES),
        body=body,
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
            submitted.append(_with_page(_checked(_entry(run), checks), checks))
        except RecordError as error:
            unread.append(str(error))
        except Exception as error:  # A stranger's broken file must not hide the others.
            unread.append(f"{run} cannot be scored: {type(error).__name__}.")
    return _with_twins(submitted), unread


def _entry(run: Path) -> Entry:
    if run.name.lower() == _INDEX:
        raise RecordError(f"{run} has the name of the board's own page.", "Rename it, such as to mine.")
    scored = ScoredRun.read(run)
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


def _with_twins(entries: Sequence[Entry]) -> list[Entry]:
    """Name the runs that hold the same records. Who copied whom cannot be told."""
    runs = defaultdict[frozenset[str], list[str]](list)
    for entry in entries:
        runs[_digests(entry)].append(entry.run.name)

    def noted(entry: Entry) -> str:
        others = [name for name in runs[_digests(entry)] if name != entry.run.name]
        return f"{entry.records}; the same records as {', '.join(others)}" if others else entry.records

    return [replace(entry, records=noted(entry)) for entry in entries]


def _digests(entry: Entry) -> frozenset[str]:
    return frozenset(episode.digest for episode in entry.scored.episodes)


def _replayed(played: Sequence[Replayed], by: str) -> str:
    """Return the result of records that were played again. by: who did that."""
    same = f"{sum(map(Replayed.same, played))} of {counted(len(played), 'episode')} played again the same"
    same += f" by {by}" if by else ""
    unknown = [f"{each.episode}: {each.incomparable}" for each in played if each.incomparable]
    return f"{WHOLE}, but only {same}: {unknown[0]}" if unknown else f"{WHOLE}; {same}"


def _split(split: str, hidden: str) -> str:
    """Return the name of a split."""
    return "hidden test" if hidden and split == hidden else known_split(split)[0] or "not one of the benchmark's"


def _section(split: str, asked: int, entries: Sequence[Entry], hidden: str) -> str:
    ordered = sorted(entries, key=_rank, reverse=True)
    name = _split(split, hidden)
    return _table(f"{name}: {counted(asked, 'episode')}, split {split[:12]}", _TITLES, _rows(ordered))


def _unranked(entries: Sequence[Entry], unread: Sequence[str]) -> str:
    """Return the unranked runs, each with the reason."""
    rows = [(*cells, entry.run.name, entry.apart) for cells, entry in zip(_rows(entries), entries, strict=True)]
    table = _table("Not ranked", (*_TITLES, "folder", "why"), rows) if rows else ""
    return table + "".join(f"<p>Not ranked: {_escaped(reason)}</p>" for reason in unread)


def _table(caption: str, titles: Sequence[str], rows: Iterable[Sequence[str | Markup]]) -> str:
    head = "".join(f"<th scope='col'>{html.escape(title)}</th>" for title in titles)
    body = "".join(f"<tr>{_row(texts)}</tr>" for texts in rows)
    caption = html.escape(caption)
    return (
        f"<div tabindex='0' role='region' aria-label='{caption}'><table><caption>{caption}</caption>"
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def _row(cells: Sequence[str | Markup]) -> str:
    first, *rest = (cell if isinstance(cell, Markup) else _escaped(cell) for cell in cells)
    return f"<th scope='row'>{first}</th>" + "".join(f"<td>{cell}</td>" for cell in rest)


def _escaped(text: str) -> str:
    return html.escape(legible(text))


def _rank(entry: Entry) -> tuple[float, ...]:
    rates = [estimate(metric, entry.scored.result.scores) for metric in reversed(RATES)]
    return tuple(rate.value if rate.count else -1.0 for rate in rates)


_RANKING, *_EARLIER = reversed(RATES)
_TITLES: Final = ("agent", _RANKING.name, "records", *(metric.name for metric in _EARLIER), "by", "played with")
"""The rate that ranks and what was checked come first: a phone shows three columns."""


def _rows(entries: Sequence[Entry]) -> list[tuple[str | Markup, ...]]:
    """Return the cells of each entry. The last one names the settings in which it differs from the others."""
    results = [entry.scored.result for entry in entries]
    differing = labels([(result.name, result.conditions) for result in results])
    return [_cells(entry, label) for entry, label in zip(entries, differing, strict=True)]


def _cells(entry: Entry, label: str) -> tuple[str | Markup, ...]:
    result = entry.scored.result
    privileged, near = any(scores.privileged for scores in result.scores), result.known.in_process
    agent = result.name + " (privileged)" * privileged + " (in process)" * near
    rate, *earlier = (_rate(metric, entry) for metric in (_RANKING, *_EARLIER))
    name = Markup(f"<a href='{entry.page}'>{_escaped(agent)}</a>") if entry.page else agent
    engine = result.scores[0].simulator
    return name, rate, _badge(entry), *earlier, entry.submission.who, _details(engine + label, _facts(entry))


def _facts(entry: Entry) -> dict[str, str]:
    """Return what a row folds, by its name."""
    result = entry.scored.result
    return {
        "model of": entry.submission.model_date or "-",
        FALSE_CLAIMS.name: FALSE_CLAIMS.number(estimate(FALSE_CLAIMS, result.scores).value),
        "episodes": f"{len(result.finished)} of {result.total}",
        "motion (s)": _motion(entry),
        "cost ($)": f"{sum(scores.cost for scores in result.scores):.2f}",
        "temperature": _temperature(entry),
        "verifier": result.scores[0].verifier or "-",
        "engine": result.scores[0].simulator,
        "settings": _settings(entry),
        "date": entry.submission.made.isoformat(),
    }


def _temperature(entry: Entry) -> str:
    """Return the temperature of the agent's model. An agent that could not be made has no settings."""
    settings = (episode.record.settings.get("agent", {}) for episode in entry.scored.episodes)
    return next((f"{agent['temperature']!s:.20}" for agent in settings if agent.get("temperature") is not None), "-")


def _badge(entry: Entry) -> Markup:
    kind = "good" if entry.replayed else "told"
    return Markup(f"<span class='{kind}'>{_escaped(entry.records)}</span>")


def _details(title: str, facts: Mapping[str, str]) -> Markup:
    listed = "".join(f"<dt>{html.escape(name)}</dt><dd>{_escaped(fact)}</dd>" for name, fact in facts.items())
    return Markup(f"<details><summary>{_escaped(title)}</summary><dl>{listed}</dl></details>")


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


def _rate(metric: Metric, entry: Entry) -> Markup:
    """Return a rate, its interval, and the interval as a bar from 0 to 100 % with a mark at the rate."""
    share = estimate(metric, entry.scored.result.scores)
    text = html.escape(f"{metric.number(share.value)} {metric.interval(share)}".strip())
    if not np.isfinite([share.low, share.high]).all():
        return Markup(text)
    place = f"left:{100 * share.low:.1f}%;width:{100 * (share.high - share.low):.1f}%"
    mark = f"<i style='left:{100 * share.value:.1f}%'></i>"
    return Markup(f"{text}<span class='bar'><span style='{place}'></span>{mark}</span>")


_PAGE: Final = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>HumanCLAW-Bench: {splits}</title><style>
:root {{ color-scheme: light dark; --paper: light-dark(#fbfaf7, #15171a); --ink: light-dark(#1d2126, #e7e5df);
  --soft: light-dark(#59616b, #a3a9b1); --line: light-dark(#dcd8cf, #343940); --bar: light-dark(#7c9be0, #4d6cb5);
  --good: light-dark(#1b6e46, #7fd3a4);
  --serif: "Iowan Old Style", Charter, "Source Serif 4", Georgia, serif; }}
body {{ font: 16px/1.55 system-ui, sans-serif; margin: 0 auto; max-width: 90rem; padding: 3rem clamp(1rem, 4vw, 3rem);
  background: var(--paper); color: var(--ink); font-variant-numeric: tabular-nums; }}
h1 {{ font: 600 2.5rem/1.2 var(--serif); margin: 0; }}
.note {{ font: 1.05rem/1.5 var(--serif); color: var(--soft); max-width: 46rem; }}
div {{ overflow-x: auto; }}
table {{ border-collapse: collapse; width: 100%; margin: 2rem 0; font-size: .92rem; }}
caption {{ text-align: left; font: 600 1.08rem var(--serif); padding-bottom: .5rem;
  max-width: calc(100vw - 2rem); }}
th, td {{ padding: .42rem .8rem .42rem 0; text-align: left; border-bottom: 1px solid var(--line); vertical-align: top;
  font-weight: 400; }}
thead th, dt {{ color: var(--soft); font-size: .84rem; }}
tbody th {{ font-weight: 600; }} a {{ color: inherit; }} td:has(.bar) {{ white-space: nowrap; }}
.bar {{ display: block; position: relative; height: .4rem; min-width: 6rem; margin-top: .2rem; border-radius: 3px;
  background: var(--line); }}
.bar span {{ position: absolute; inset-block: 0; min-width: 3px; border-radius: 3px; background: var(--bar); }}
.bar i {{ position: absolute; inset-block: -.15rem; width: 2px; margin-left: -1px; background: var(--ink); }}
@media (max-width: 40rem) {{ body {{ padding-top: 1rem; }} h1 {{ font-size: 1.6rem; }} table {{ margin: 1rem 0; }}
  td:has(.bar) {{ white-space: normal; }} .bar {{ min-width: 4rem; }} }}
.good {{ color: var(--good); }}
.good::before {{ content: "✓ "; }} .told::before {{ content: "- "; }}
dl {{ margin: .4rem 0; max-width: 30rem; overflow-wrap: anywhere; }}
dd {{ margin: 0 0 .3rem; }}
</style></head><body><main><h1>HumanCLAW-Bench</h1>
{body}
<p class="note">Rates with 95 % confidence intervals, clustered by house, computed here from the records. "whole": the
records are sealed, and belong to this split and to these options. Only "played again the same" shows that these calls
do what the records say. A record can be edited; a hidden test that the host plays cannot. Do not compare rows of
different tables, or rows that were played with other settings. {meanings}. Made {made}.</p>
</main></body></html>
"""
