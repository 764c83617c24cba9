"""The leaderboard: submissions of a folder, checked and ranked on a page."""

from __future__ import annotations

import html
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import numpy as np

from humanclaw import RecordError
from humanclaw.cli import counted, legible
from humanclaw.storage import Folder
from humanclaw_bench.conditions import summary
from humanclaw_bench.integrity import known_split
from humanclaw_bench.metrics import FALSE_CLAIMS, FIND
from humanclaw_bench.replay import Replayed
from humanclaw_bench.statistics import Estimate
from humanclaw_bench.submission import AGREE, RATES, Submission, contradictions, inconsistencies, read
from humanclaw_bench.tables import Column

Again = Callable[[Path], Sequence[Replayed]]
"""Plays episodes of a run again."""


@dataclass(frozen=True)
class Entry:
    """A submission on the page."""

    file: str
    submission: Submission
    records: str
    """Result of its records: agree, not here, or the contradictions."""
    apart: str = ""
    """Reason why it is not ranked; empty if it is."""


def leaderboard(folder: Path, *, any_pace: bool = False, again: Again | None = None) -> Path:
    """Write index.html of all submissions in a folder, the best InteractSR first, and return its path.

    Each split has a table of submissions whose records lie here and agree, and one of submissions without records.
    Partial, contradicted and damaged ones are listed apart. So are, without any_pace, runs whose calls move longer or
    faster than the paper's skills. again: plays recorded calls again where the records lie here.

    Raises RecordError if there is no submission.
    """
    found, unread = _entries(folder, any_pace, again)
    if not (found or unread):
        raise RecordError(f"there is no submission in {folder}.", "Put files of `humanclaw bench submit` there.")
    ranked: dict[tuple[str, int, bool], list[Entry]] = {}
    for one in found:
        if not one.apart:
            split, told = str(one.submission.run.get("split", "")), not one.records.startswith(AGREE)
            ranked.setdefault((split, one.submission.asked, told), []).append(one)
    body = "".join(_section(*key, entries) for key, entries in sorted(ranked.items()))
    body += _unranked([one for one in found if one.apart], unread)
    page = _PAGE.format(body=body, made=datetime.now(UTC).date().isoformat())
    Folder(folder).write("index.html", page.encode())
    return folder / "index.html"


def _entries(folder: Path, any_pace: bool, again: Again | None) -> tuple[list[Entry], list[str]]:
    """Return the submissions of a folder, and the errors of files that could not be read."""
    found, unread = [], []
    for path in map(folder.joinpath, Folder(folder).names(".json")):
        try:
            found.append(_entry(path, read(path), any_pace, again))
        except RecordError as error:
            unread.append(error.message)
        except Exception as error:  # A stranger's broken file must not hide the others.
            unread.append(f"{path} cannot be held to its records: {type(error).__name__}.")
    return found, unread


def _entry(path: Path, one: Submission, any_pace: bool, again: Again | None) -> Entry:
    """Check a submission against its records, if they lie here."""
    run = path.with_suffix("")
    here = run.is_dir() and not run.is_symlink()
    try:
        wrong = contradictions(one, run) if here else (*inconsistencies(one),)
    except RecordError as error:
        return Entry(path.name, one, "damaged, or not of this run", error.message)
    if wrong:
        told = f"contradicted: {wrong[0]}" + (f", and {len(wrong) - 1} more" if len(wrong) > 1 else "")
        return Entry(path.name, one, "contradict it" if here else "not here", told)
    missing = one.asked - _ended(one)
    apart = f"partial: {counted(missing, 'episode')} missing" if missing else ""
    if not (apart or any_pace or all(result.scores.in_pace for result in one.episodes)):
        apart = f"not at the paper's pace ({_motion(one)}); --any-pace ranks it"
    if not here:
        return Entry(path.name, one, "not here", apart)
    if again is None:
        return Entry(path.name, one, AGREE, apart)
    played = again(run)
    same = f"{AGREE}; {sum(map(Replayed.same, played))} of {len(played)} episodes played again the same"
    lies = [f"{each.episode}: {each.differing[0]}" for each in played if each.differing]
    return Entry(path.name, one, same, f"contradicted by playing again: {lies[0]}" if lies else apart)


def _ended(one: Submission) -> int:
    return sum(result.scores.ended for result in one.episodes)


def _section(split: str, asked: int, told: bool, entries: Sequence[Entry]) -> str:
    ordered = sorted(entries, key=lambda entry: _rank(entry.submission), reverse=True)
    name = known_split(split, asked)[0] or "not one of the benchmark's"
    how = "as told: nobody here has the records" if told else "scored again from the records"
    return _table(f"{counted(asked, 'episode')}, split {split[:12]} ({name}), {how}", _TITLES, map(_cells, ordered))


def _unranked(entries: Sequence[Entry], unread: Sequence[str]) -> str:
    """Return the unranked submissions, each with the reason."""
    rows = [(*_cells(entry), entry.file, entry.apart) for entry in entries]
    table = _table("Not ranked", (*_TITLES, "file", "why"), rows) if rows else ""
    return table + "".join(f"<p>Not read: {html.escape(legible(reason))}</p>" for reason in unread)


def _table(caption: str, titles: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    head = "".join(f"<th scope='col'>{html.escape(title)}</th>" for title in titles)
    body = "".join(f"<tr>{_row(texts)}</tr>" for texts in rows)
    caption = f"<caption>{html.escape(caption)}</caption>"
    return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _row(texts: Sequence[str]) -> str:
    first, *rest = (html.escape(legible(text)) for text in texts)
    return f"<th scope='row'>{first}</th>" + "".join(f"<td>{text}</td>" for text in rest)


def _rank(one: Submission) -> tuple[float, ...]:
    return tuple(one.rates.get(metric.name, (-1.0,))[0] for metric in reversed(RATES))


_LATER: Final = tuple(metric.name for metric in RATES if metric is not FIND)
_TITLES: Final = (
    "agent", "model of", "by", FIND.name, FALSE_CLAIMS.name, *_LATER, "episodes", "motion (s)",
    "cost ($)", "temperature", "verifier", "engine", "settings", "date", "records",
)  # fmt: skip


def _cells(entry: Entry) -> tuple[str, ...]:
    one = entry.submission
    find, *later = (_rate(Column.of(metric), one.rates.get(metric.name)) for metric in RATES)
    claims = Column.of(FALSE_CLAIMS).number(_false_claims(one))
    attempts = {"played again": one.again, "continued": one.continued, "not in the journal": one.unstarted}
    told = [f"{count} {what}" for what, count in attempts.items() if count]
    episodes = ", ".join([f"{_ended(one)} of {one.asked}", *told])
    warmth = "-" if one.temperature is None else f"{one.temperature:g}"
    agent = f"{one.agent} (privileged)" if any(e.scores.privileged for e in one.episodes) else one.agent
    return (
        agent, one.model_date or "-", one.who, find, claims, *later, episodes, _motion(one), f"{one.cost:.2f}",
        warmth, one.verifier or "-", one.engine, _settings(one), one.made.isoformat(), entry.records,
    )  # fmt: skip


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


def _rate(column: Column, values: tuple[float, float, float, int] | None) -> str:
    found = Estimate(*values) if values else Estimate(float("nan"))
    return f"{column.number(found.value)} {column.interval(found)}".strip()


_PAGE: Final = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>HumanCLAW-Bench</title><style>
body {{ font: 16px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 110rem; padding: 0 1rem; }}
table {{ border-collapse: collapse; width: 100%; margin: 1.5rem 0; font-size: .8rem; }}
caption {{ text-align: left; font-weight: 600; }}
th, td {{ padding: .3rem .4rem; text-align: left; border-bottom: 1px solid #ccc; font-variant-numeric: tabular-nums; }}
</style></head><body><h1>HumanCLAW-Bench</h1>
<p>Rates with 95 % intervals that know houses. "agree": the records lie here, and scored again they say the same;
only "played again the same" says that these calls do what they tell. Rows of different tables are no comparison.
Made {made}.</p>
{body}</body></html>
"""
