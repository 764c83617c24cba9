"""The leaderboard: submissions of a folder, checked and ranked on a page."""

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
from humanclaw_bench.integrity import RunFiles, known_split
from humanclaw_bench.metrics import FALSE_CLAIMS
from humanclaw_bench.replay import Replayed
from humanclaw_bench.statistics import Estimate
from humanclaw_bench.submission import AGREE, RATES, Submission, contradictions, inconsistencies, read
from humanclaw_bench.tables import Column

_HALF: Final = f"{AGREE}, but only"
"""Beginning of the result of records that agree, of which some cannot be played again here."""

_INDEX: Final = "index.html"
_RENAME: Final = "Rename it, such as to mine.json."


class Markup(str):
    """Text of a page whose parts are escaped already."""


Again = Callable[[Path], Sequence[Replayed]]
"""Plays episodes of a run again."""


@dataclass(frozen=True)
class Checks:
    """How the submissions are checked."""

    any_pace: bool = False
    """Whether to rank runs whose calls move longer or faster than the paper's skills too."""
    again: Again | None = None
    """Plays recorded calls again where the records lie here."""
    by: str = ""
    """Who plays them again, as the page names it."""
    hidden: str = ""
    """Digest of the hidden test; empty for none."""
    pages: Callable[[Path, Path], None] | None = None
    """Writes the page of a run whose records agree into another folder; None links to none."""
    out: Path | None = None
    """Folder to publish: of what submitters sent it holds records alone. None writes index.html beside them."""


@dataclass(frozen=True)
class Entry:
    """A submission on the page."""

    file: str
    submission: Submission
    records: str
    """Result of its records: agree, not here, or the contradictions."""
    apart: str = ""
    """Reason why it is not ranked; empty if it is."""
    replayed: bool = False
    """Whether its calls were played again, and did the same."""
    page: str = ""
    """Address of the run's page beside this one; empty if there is none."""

    @property
    def agrees(self) -> bool:
        return self.records.startswith(AGREE)


def leaderboard(folder: Path, checks: Checks = Checks()) -> Path:
    """Write index.html of all submissions in a folder, the best InteractSR first, and return its path.

    Each split has a table of submissions whose records lie here and agree, and one of submissions without records.
    Partial, contradicted and damaged ones are listed apart. So are runs that are not at the paper's pace.

    Raises RecordError if there is no submission.
    """
    found, unread = _entries(folder, checks)
    if not (found or unread):
        remedy = f"Write one with `humanclaw bench submit RUN --who NAME --out {folder}/NAME.json`."
        raise lacking(folder, "submission", remedy)
    ranked: dict[tuple[str, int, bool], list[Entry]] = {}
    for one in found:
        if not one.apart:
            split, told = str(one.submission.run.get("split", "")), not one.agrees
            ranked.setdefault((split, one.submission.asked, told), []).append(one)
    sections = sorted(ranked.items())
    splits = [_split(split, asked, checks.hidden) for (split, asked, _), _ in sections]
    body = "".join(_section(*key, entries, checks.hidden) for key, entries in sections)
    body += _unranked([one for one in found if one.apart], unread)
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
    """Return the submissions of a folder, and the errors of files that could not be read."""
    found, unread = [], []
    for path in map(folder.joinpath, Folder(folder).names(".json")):
        try:
            one = _entry(path, read(path), checks)
            found.append(_with_page(one, path.with_suffix(""), checks) if one.agrees else one)
        except RecordError as error:
            unread.append(str(error))
        except Exception as error:  # A stranger's broken file must not hide the others.
            unread.append(f"{path} cannot be held to its records: {type(error).__name__}.")
    return _with_twins(found), unread


def _entry(path: Path, one: Submission, checks: Checks) -> Entry:
    """Check a submission against its records, if they lie here."""
    run = path.with_suffix("")
    if not path.stem.strip("."):  # The folder of "...json" would be the one above the board.
        raise RecordError(f"{path} has a name of dots alone, which names no run.", _RENAME)
    if path.stem.lower() == _INDEX:
        raise RecordError(f"{path} has the name of the board's own page.", _RENAME)
    here = run.is_dir() and not run.is_symlink()
    try:
        wrong = contradictions(one, run) if here else (*inconsistencies(one),)
    except RecordError as error:
        return Entry(path.name, one, "damaged, or not of this run", error.message)
    if wrong:
        told = f"contradicted: {wrong[0]}" + (f", and {len(wrong) - 1} more" if len(wrong) > 1 else "")
        return Entry(path.name, one, "contradict it" if here else "not here", told)
    one = _missed(one, run) if here else one
    missing = one.asked - _ended(one)
    apart = f"partial: {counted(missing, 'episode')} missing" if missing else ""
    if not (apart or checks.any_pace or all(result.scores.in_pace for result in one.episodes)):
        apart = f"not at the paper's pace ({_motion(one)}); --any-pace ranks it"
    if not here:
        return Entry(path.name, one, "not here", apart)
    if checks.again is None:
        return Entry(path.name, one, AGREE, apart)
    played = checks.again(run)
    lies = [f"{each.episode}: {each.differing[0]}" for each in played if each.differing]
    apart = f"contradicted by playing again: {lies[0]}" if lies else apart
    return Entry(path.name, one, _replayed(played, checks.by), apart, bool(played) and all(map(Replayed.same, played)))


def _with_page(entry: Entry, run: Path, checks: Checks) -> Entry:
    """Write the page of a run into the folder to publish, and link to it."""
    if not (checks.pages and checks.out):
        return entry
    with suppress(OSError, RecordError):
        checks.pages(run, checks.out / run.name)
        if Folder(checks.out).has(f"{run.name}/{REPORT}"):
            return replace(entry, page=quote(f"{run.name}/{REPORT}"))
    return replace(entry, records=f"{entry.records}; page not written")


def _with_twins(found: Sequence[Entry]) -> list[Entry]:
    """Say of submissions of the same records that they are. Who copied whom cannot be told."""
    files = defaultdict[frozenset[str], list[str]](list)
    for one in found:
        files[_records_of(one)].append(one.file)

    def told(one: Entry) -> str:
        others = [file for file in files[_records_of(one)] if file != one.file]
        return f"{one.records}; the same records as {', '.join(others)}" if others else one.records

    return [replace(one, records=told(one)) for one in found]


def _records_of(entry: Entry) -> frozenset[str]:
    return frozenset(episode.digest for episode in entry.submission.episodes)


def _replayed(played: Sequence[Replayed], by: str) -> str:
    """Return the result of records that agree and were played again. by: who did that."""
    same = f"{sum(map(Replayed.same, played))} of {counted(len(played), 'episode')} played again the same"
    same += f" by {by}" if by else ""
    unknown = [f"{each.episode}: {each.incomparable}" for each in played if each.incomparable]
    return f"{_HALF} {same}: {unknown[0]}" if unknown else f"{AGREE}; {same}"


def _missed(one: Submission, run: Path) -> Submission:
    """Note the episodes without a start in the journal here, whatever the submission says of them."""
    missed = RunFiles.read(run).unstarted(result.id for result in one.episodes)
    return one.model_copy(update={"unstarted": max(missed, one.unstarted)})


def _ended(one: Submission) -> int:
    return sum(result.scores.ended for result in one.episodes)


def _split(split: str, asked: int, hidden: str) -> str:
    """Return the name of a split."""
    return "hidden test" if hidden and split == hidden else known_split(split, asked)[0] or "not one of the benchmark's"


def _section(split: str, asked: int, told: bool, entries: Sequence[Entry], hidden: str) -> str:
    ordered = sorted(entries, key=lambda entry: _rank(entry.submission), reverse=True)
    name = _split(split, asked, hidden)
    how = "as told: nobody here has the records" if told else "scored again from the records"
    return _table(f"{name}: {counted(asked, 'episode')}, split {split[:12]}, {how}", _TITLES, _rows(ordered))


def _unranked(entries: Sequence[Entry], unread: Sequence[str]) -> str:
    """Return the unranked submissions, each with the reason."""
    rows = [(*cells, entry.file, entry.apart) for cells, entry in zip(_rows(entries), entries, strict=True)]
    table = _table("Not ranked", (*_TITLES, "file", "why"), rows) if rows else ""
    return table + "".join(f"<p>Not read: {_escaped(reason)}</p>" for reason in unread)


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


def _rank(one: Submission) -> tuple[float, ...]:
    return tuple(one.rates.get(metric.name, (-1.0,))[0] for metric in reversed(RATES))


_RANKING, *_EARLIER = reversed(RATES)
_TITLES: Final = ("agent", _RANKING.name, "records", *(metric.name for metric in _EARLIER), "by", "played with")
"""The rate that ranks and what was checked come first: a phone shows three columns."""


def _rows(entries: Sequence[Entry]) -> list[tuple[str | Markup, ...]]:
    """Return the cells of each entry. The last one names the settings in which it differs from the others."""
    differing = labels([(entry.submission.agent, entry.submission.conditions) for entry in entries])
    return [_cells(entry, label) for entry, label in zip(entries, differing, strict=True)]


def _cells(entry: Entry, label: str) -> tuple[str | Markup, ...]:
    one = entry.submission
    privileged, near = any(e.scores.privileged for e in one.episodes), one.run.get("in process")
    agent = one.agent + " (privileged)" * privileged + " (in process)" * bool(near)
    rate, *earlier = (_rate(Column.of(metric), one.rates.get(metric.name)) for metric in (_RANKING, *_EARLIER))
    name = Markup(f"<a href='{entry.page}'>{_escaped(agent)}</a>") if entry.page else agent
    return name, rate, _badge(entry), *earlier, one.who, _details(one.engine + label, _facts(one))


def _facts(one: Submission) -> dict[str, str]:
    """Return what a row folds, by its name."""
    attempts = {"played again": one.again, "continued": one.continued, "not in the journal": one.unstarted}
    told = [f"{count} {what}" for what, count in attempts.items() if count]
    return {
        "model of": one.model_date or "-",
        FALSE_CLAIMS.name: Column.of(FALSE_CLAIMS).number(_false_claims(one)),
        "episodes": ", ".join([f"{_ended(one)} of {one.asked}", *told]),
        "motion (s)": _motion(one),
        "cost ($)": f"{one.cost:.2f}",
        "temperature": "-" if one.temperature is None else f"{one.temperature:g}",
        "verifier": one.verifier or "-",
        "engine": one.engine,
        "settings": _settings(one),
        "date": one.made.isoformat(),
    }


def _badge(entry: Entry) -> Markup:
    told = entry.agrees or entry.records.startswith("not here")
    kind = "good" if entry.replayed else "told" if told else "bad"
    return Markup(f"<span class='{kind}'>{_escaped(entry.records)}</span>")


def _details(title: str, facts: Mapping[str, str]) -> Markup:
    listed = "".join(f"<dt>{html.escape(name)}</dt><dd>{_escaped(fact)}</dd>" for name, fact in facts.items())
    return Markup(f"<details><summary>{_escaped(title)}</summary><dl>{listed}</dl></details>")


def _settings(one: Submission) -> str:
    """Return the settings in which rows may differ."""
    unusual = ("options", "plugin files", "in process", "beside the body")
    told = {key: one.run[key] for key in unusual if one.run.get(key)}
    if told.get("options") == {"profile": "default"}:
        del told["options"]
    given = [f"{key} {json.dumps(value, ensure_ascii=False)}" for key, value in told.items()]
    return "; ".join([*given, summary(one.conditions)])


def _motion(one: Submission) -> str:
    """Return the mean seconds of motion of an episode, and the longest and fastest call."""
    known = [result.scores for result in one.episodes if result.scores.ended]
    mean = float(np.mean([scores.motion for scores in known] or [np.nan]))
    longest, fastest = (
        max((getattr(scores, name) for scores in known), default=0.0) for name in ("longest", "fastest")
    )
    return f"{mean:.1f}, at most {longest:.1f} a call, {fastest:.2f} m in half a second"


def _false_claims(one: Submission) -> float:
    """Return FALSE_CLAIMS of a submission, which has no records."""
    shares = [e.scores.false_claims for e in one.episodes if e.scores.ended]
    return float(np.mean([share for share in shares if share is not None] or [np.nan]))


def _rate(column: Column, values: tuple[float, float, float, int] | None) -> Markup:
    """Return a rate, its interval, and the interval as a bar from 0 to 100 % with a mark at the rate."""
    found = Estimate(*values) if values else Estimate(float("nan"))
    text = html.escape(f"{column.number(found.value)} {column.interval(found)}".strip())
    if not np.isfinite([found.low, found.high]).all():
        return Markup(text)
    place = f"left:{100 * found.low:.1f}%;width:{100 * (found.high - found.low):.1f}%"
    mark = f"<i style='left:{100 * found.value:.1f}%'></i>"
    return Markup(f"{text}<span class='bar'><span style='{place}'></span>{mark}</span>")


_PAGE: Final = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>HumanCLAW-Bench: {splits}</title><style>
:root {{ color-scheme: light dark; --paper: light-dark(#fbfaf7, #15171a); --ink: light-dark(#1d2126, #e7e5df);
  --soft: light-dark(#59616b, #a3a9b1); --line: light-dark(#dcd8cf, #343940); --bar: light-dark(#7c9be0, #4d6cb5);
  --good: light-dark(#1b6e46, #7fd3a4); --bad: light-dark(#9b2c2c, #f1a09a);
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
.good {{ color: var(--good); }} .bad {{ color: var(--bad); }}
.good::before {{ content: "✓ "; }} .told::before {{ content: "- "; }} .bad::before {{ content: "✗ "; }}
dl {{ margin: .4rem 0; max-width: 30rem; overflow-wrap: anywhere; }}
dd {{ margin: 0 0 .3rem; }}
</style></head><body><main><h1>HumanCLAW-Bench</h1>
{body}
<p class="note">Rates with 95 % confidence intervals, clustered by house. "agree": the records lie here, and scored
again they give the same numbers; only "played again the same" shows that these calls do what the records say. Do not
compare rows of different tables, or rows that were played with other settings. {meanings}. Made {made}.</p>
</main></body></html>
"""
