"""A result that others can check: one file with what was run and what came of it, held against the records it is of.

A leaderboard is a folder of such files; where the run lies beside one, in a folder of the same name, its records are
read again.
"""

from __future__ import annotations

import errno
import hashlib
import html
import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from humanclaw import RecordedEpisode, RecordError, load_run
from humanclaw.cli import counted, legible
from humanclaw.storage import write_atomically
from humanclaw_bench.export import row, scored
from humanclaw_bench.integrity import MOST as EPISODES, Manifest, faults, known_split, played_again, read_manifest
from humanclaw_bench.metrics import FALSE_CLAIMS, FIND, INTERACT, NAV, Scores, ended, estimate
from humanclaw_bench.splits import original_of
from humanclaw_bench.statistics import Estimate, rate
from humanclaw_bench.tables import Column

NAME: Final = "submission.json"
RATES: Final = {FIND: "find", NAV: "nav", INTERACT: "interact"}
"""What submissions are ranked by, from the first stage to the last, and where an episode's numbers have it."""
MOST: Final = 10**15
"""Of whatever is counted; more is a mistake."""
LARGEST: Final = 100_000_000
"""Bytes of a submission; that of 1,218 episodes has two million."""
TOLERANCE: Final = 1e-6
"""By how much a number that is computed again may differ: other processors round otherwise."""
_UNSCORED: Final = ("agent", "verifier", "error", "extra")


class _Value(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


Text = Annotated[str, Field(max_length=500)]
Dollars = Annotated[float, Field(ge=0, le=MOST)]
Count = Annotated[int, Field(ge=0, le=MOST)]


class Numbers(_Value):
    """An episode's numbers as `bench rescore` writes them; those that the page rests on are named here."""

    model_config = ConfigDict(extra="allow", strict=True)

    scene: str
    outcome: str
    limit: str = ""
    find: bool | None
    nav: bool | None
    interact: bool | None
    """None: the task does not ask for it."""
    false_claims: Annotated[float, Field(ge=0, le=1)] | None
    cost: Dollars
    tokens_in: Count
    tokens_out: Count
    privileged: str | None = None

    @property
    def ended(self) -> bool:
        return ended(self.outcome, self.limit)


class EpisodeResult(_Value):
    """One episode of a submission: the digest of its record and its numbers."""

    id: Text
    seed: int
    digest: Text
    """SHA-256 over all that happened in it (RecordedEpisode.digest)."""
    scores: Numbers


class Submission(_Value):
    """All that a leaderboard shows of a run, and what it takes to check it."""

    format: Literal[2] = 2
    who: Text
    """Whoever submits it, as it is to be shown."""
    made: date
    """Day on which this file was written."""
    agent: Text
    verifier: Text = ""
    """Whoever checked the calls; empty for nobody."""
    model_date: Text = ""
    """Version or day of the model as its provider tells it; a name alone may be another model tomorrow."""
    temperature: Annotated[float, Field(ge=0, le=100)] | None = None
    """None: not told, or no model."""
    engine: Text
    """What moved the world."""
    seeds: tuple[int, ...]
    """Of the episodes, each once."""
    asked: Annotated[int, Field(ge=1, le=EPISODES)]
    """Episodes that the run is of."""
    cost: Dollars
    """US dollars of all episodes, unfinished ones included."""
    tokens: Count
    again: Count = 0
    """Episodes that were played again after they had ended, as far as the run's journal tells."""
    run: dict[str, Any]
    """run.json: split and weights by digest, options, versions, limits."""
    rates: dict[str, tuple[float, float, float, int]]
    """FindSR, NavSR, InteractSR: value, interval, episodes."""
    episodes: tuple[EpisodeResult, ...]
    digest: str = ""
    """SHA-256 of this file without this line."""

    @property
    def sealed(self) -> Submission:
        """The same with the digest that belongs to it."""
        content = self.model_dump_json(exclude={"digest"}).encode()
        return self.model_copy(update={"digest": hashlib.sha256(content).hexdigest()})


def submit(run: Path, who: str, model_date: str = "") -> Submission:
    """Make the submission of a run from its records. Raises RecordError unless they are those of one run of one agent,
    whole and sealed."""
    manifest, episodes = read_manifest(run), load_run(run)
    if wrong := faults(episodes, run):
        raise RecordError(wrong[0], f"`humanclaw bench verify {run}` names all that is wrong.")
    agents = sorted({episode.record.agent for episode in episodes})
    if len(agents) > 1:
        raise RecordError(f"{run} holds runs of several agents ({', '.join(agents)}).", "Name the folder of one.")
    try:
        return _made(episodes, run, manifest, who, model_date).sealed
    except ValidationError as error:
        raise RecordError(
            f"no submission can be made of {run}: {_first(error)}.", "Mend that and try again."
        ) from error


def _made(episodes: Sequence[RecordedEpisode], run: Path, manifest: Manifest, who: str, model_date: str) -> Submission:
    pairs = scored(episodes, name=run.name)
    scores = [one for one, _ in pairs]
    results = tuple(_result(*entry) for entry in zip(episodes, (row(*pair) for pair in pairs), strict=True))
    # An agent that was never made says nothing of itself.
    first = min((one.record for one in episodes), key=lambda record: record.outcome == "plugin_error")
    return Submission(
        who=who, made=datetime.now(UTC).date(), agent=first.agent, verifier=first.verifier, model_date=model_date,
        temperature=_temperature(first.settings.get("agent", {}).get("temperature")),
        engine=str(first.settings.get("body", {}).get("simulator", "")),
        seeds=tuple(sorted({one.seed for one in results})), asked=manifest.episodes,
        cost=sum(one.cost for one in scores), tokens=sum(one.tokens_in + one.tokens_out for one in scores),
        again=len(played_again(run)), run=manifest.content, rates=_rates(scores), episodes=results,
    )  # fmt: skip


def _temperature(told: object) -> float | None:
    """Return what an agent says as a temperature, if it is one."""
    return float(told) if isinstance(told, int | float) and 0 <= told <= 100 else None


def _result(recorded: RecordedEpisode, numbers: Mapping[str, Any]) -> EpisodeResult:
    kept = {key: value for key, value in numbers.items() if key not in _UNSCORED}
    spec = recorded.record.spec
    return EpisodeResult(id=spec.id, seed=spec.seed, digest=recorded.digest, scores=Numbers(**kept))


def _rates(scores: Sequence[Scores]) -> dict[str, tuple[float, float, float, int]]:
    found = {metric.name: estimate(metric, scores) for metric in RATES}
    return {name: (one.value, one.low, one.high, one.count) for name, one in found.items() if one.count}


def read(path: Path) -> Submission:
    """Read a submission. Raises RecordError if it is none or has been changed."""
    try:
        found = Submission.model_validate_json(_bytes(path))
    except (OSError, ValidationError) as error:
        told = f"{path} is no submission: {_first(error)}."  # Never what stands in it: a link may lead anywhere.
        raise RecordError(told, "Write it with `humanclaw bench submit`.") from error
    if found.sealed.digest != found.digest:
        raise RecordError(f"{path} has been changed since it was written.", "Write it with `humanclaw bench submit`.")
    return found


def _bytes(path: Path) -> bytes:
    """Read a file that may be anything. Raises OSError also for what would never end."""
    if not path.is_file():
        raise OSError(errno.EINVAL, "no file")
    if path.stat().st_size > LARGEST:
        raise OSError(errno.EFBIG, f"larger than {LARGEST // 10**6} MB")
    return path.read_bytes()


def _first(error: OSError | ValidationError) -> str:
    if isinstance(error, OSError):
        return error.strerror or type(error).__name__
    first = error.errors(include_url=False, include_input=False)[0]
    return ": ".join([*(".".join(map(str, first["loc"])),) * bool(first["loc"]), first["msg"]])


# -- checking ----------------------------------------------------------------------------------------------------------
def contradictions(claimed: Submission, run: Path) -> tuple[str, ...]:
    """Score a run again from its records, and tell in what a submission says something else; a line each.

    Raises RecordError if the records themselves are damaged or of another run: humanclaw_bench.integrity.check tells.
    """
    found = submit(run, claimed.who, claimed.model_date)
    told = [*_inconsistencies(claimed)]
    told += [f"{key} is {getattr(found, key)!r}, not {getattr(claimed, key)!r}" for key in _differing(claimed, found)]
    ours, theirs = ({one.id: one for one in of.episodes} for of in (found, claimed))
    told += [f"episode {name} is in one of the two alone" for name in sorted(ours.keys() ^ theirs.keys())]
    for name in sorted(ours.keys() & theirs.keys()):
        told += [f"episode {name}: {what}" for what in _unlike(ours[name], theirs[name])]
    return tuple(told)


def _inconsistencies(claimed: Submission) -> Iterator[str]:
    """Yield what a submission says against itself, which it takes no records to tell."""
    counts = Counter(one.id for one in claimed.episodes)
    yield from (f"episode {name} is there {count} times" for name, count in sorted(counts.items()) if count > 1)
    if {one.seed for one in claimed.episodes} != set(claimed.seeds):
        yield "seeds are not those of its episodes"
    if claimed.run.get("episodes") != claimed.asked:
        yield f"asked is {claimed.asked}, and its run is of {claimed.run.get('episodes')}"
    yield from _off_split(claimed)
    for metric, field in RATES.items():
        known = [one for one in claimed.episodes if one.scores.ended and getattr(one.scores, field) is not None]
        met, houses = [getattr(one.scores, field) for one in known], [one.scores.scene for one in known]
        found = rate(met, houses, [original_of(one.id) for one in known])
        yield from _off_rate(metric.name, found, claimed.rates.get(metric.name))
    scores = [one.scores for one in claimed.episodes]
    if not _alike(cost := sum(one.cost for one in scores), claimed.cost):
        yield f"cost is {claimed.cost:g}, and {cost:g} by its episodes"
    if (tokens := sum(one.tokens_in + one.tokens_out for one in scores)) != claimed.tokens:
        yield f"tokens are {claimed.tokens}, and {tokens} by its episodes"


def _off_split(claimed: Submission) -> Iterator[str]:
    """Yield in what its episodes are not those of the benchmark's split that it names, if it is one of them."""
    name, found = known_split(str(claimed.run.get("split", "")), claimed.asked)
    specs = {spec.id: spec for spec in found}
    if name and claimed.asked != len(specs):
        yield f"asked is {claimed.asked}, and split {name} has {len(specs)}"
    for one in claimed.episodes if name else ():
        spec = specs.get(one.id)
        if not spec:
            yield f"episode {one.id} is not of split {name}"
        elif one.seed != spec.seed:
            yield f"episode {one.id} has seed {spec.seed} in split {name}, not {one.seed}"
        elif one.scores.scene != spec.scene:
            yield f"episode {one.id} is in {spec.scene} in split {name}, not in {one.scores.scene!r:.40}"
        elif one.scores.ended and None in (one.scores.find, one.scores.nav):
            yield f"episode {one.id} is to find a target and go to it in split {name}"
        elif one.scores.ended and spec.interact == (one.scores.interact is None):
            yield f"episode {one.id} is {'' if spec.interact else 'not '}to sit down in split {name}"


def _off_rate(name: str, found: Estimate, told: tuple[float, float, float, int] | None) -> Iterator[str]:
    by_episodes = f"{found.value if found.count else 0:g} of {found.count} by its episodes"
    if told is None:
        if found.count:
            yield f"{name} is not among its rates, and {by_episodes}"
        return
    value, low, high, count = told
    if count != found.count or not _alike(found.value, value):
        yield f"{name} is {value:g} of {count} by its rates, and {by_episodes}"
    elif not (_alike(found.low, low) and _alike(found.high, high)):
        yield f"{name} has the interval {low:g} to {high:g}, and {found.low:g} to {found.high:g} by its episodes"


def _differing(claimed: Submission, found: Submission) -> list[str]:
    plain = [key for key in ("agent", "verifier", "engine", "temperature", "seeds", "asked", "tokens", "run")
             if getattr(claimed, key) != getattr(found, key)]  # fmt: skip
    rates = claimed.rates.keys() == found.rates.keys() and all(
        _alike(a, b) for name, values in found.rates.items() for a, b in zip(values, claimed.rates[name], strict=True)
    )
    # Whoever hosts the records may have them without their journal.
    plain += ["again"] * (found.again > claimed.again)
    return plain + ([] if _alike(claimed.cost, found.cost) else ["cost"]) + ([] if rates else ["rates"])


def _unlike(ours: EpisodeResult, theirs: EpisodeResult) -> list[str]:
    if ours.digest != theirs.digest:
        return ["its record is another one"]
    if ours.seed != theirs.seed:
        return [f"seed is {ours.seed}, not {theirs.seed}"]
    one, two = ours.scores.model_dump(), theirs.scores.model_dump()
    wrong = sorted(key for key in one.keys() | two.keys() if not _alike(one.get(key), two.get(key)))
    return [f"{key} is {one.get(key)!r:.80}, not {two.get(key)!r:.80}" for key in wrong]


def _alike(a: Any, b: Any) -> bool:
    if isinstance(a, float) and isinstance(b, float):
        return abs(a - b) <= TOLERANCE * max(1.0, abs(a))
    return bool(a == b)


AGREE: Final = "agree"
"""What is said of records that lie beside a submission and lead to its numbers."""


# -- the page ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Entry:
    """A submission on the page."""

    file: str
    submission: Submission
    records: str
    """What its records say of it: agree, not here, or in what they do not."""
    apart: str = ""
    """Why it is not ranked; empty if it is."""


def leaderboard(folder: Path) -> Path:
    """Write index.html of all submissions in a folder, the best InteractSR first; returns its path.

    A split has a table of those whose records lie here and agree, and one of those that are only told. One of a partial
    run, one that its records contradict, and one whose records cannot be read is listed apart. Raises RecordError if
    there is none.
    """
    found, unread = _entries(folder)
    if not (found or unread):
        raise RecordError(f"there is no submission in {folder}.", "Put files of `humanclaw bench submit` there.")
    ranked: dict[tuple[str, int, bool], list[Entry]] = {}
    for one in found:
        if not one.apart:
            split, told = str(one.submission.run.get("split", "")), one.records != AGREE
            ranked.setdefault((split, one.submission.asked, told), []).append(one)
    body = "".join(_section(*key, entries) for key, entries in sorted(ranked.items()))
    body += _unranked([one for one in found if one.apart], unread)
    page = _PAGE.format(body=body, made=datetime.now(UTC).date().isoformat())
    write_atomically(folder / "index.html", page.encode())
    return folder / "index.html"


def _entries(folder: Path) -> tuple[list[Entry], list[str]]:
    """Return the submissions in a folder, and what is wrong with the files that are none."""
    found, unread = [], []
    for path in sorted(folder.glob("*.json")):
        try:
            found.append(_entry(path, read(path)))
        except RecordError as error:
            unread.append(error.message)
        except Exception as error:  # Whatever a stranger's file or records may do, it stops nobody else's.
            unread.append(f"{path} cannot be held to its records: {type(error).__name__}.")
    return found, unread


def _entry(path: Path, one: Submission) -> Entry:
    """Hold a submission to its records, if they lie here."""
    run = path.with_suffix("")
    try:
        wrong = contradictions(one, run) if run.is_dir() else (*_inconsistencies(one),)
    except RecordError as error:
        return Entry(path.name, one, "damaged, or not of this run", error.message)
    if wrong:
        told = f"contradicted: {wrong[0]}" + (f", and {len(wrong) - 1} more" if len(wrong) > 1 else "")
        return Entry(path.name, one, "contradict it" if run.is_dir() else "not here", told)
    missing = one.asked - _ended(one)
    apart = f"partial: {counted(missing, 'episode')} missing" if missing else ""
    return Entry(path.name, one, AGREE if run.is_dir() else "not here", apart)


def _ended(one: Submission) -> int:
    return sum(result.scores.ended for result in one.episodes)


def _section(split: str, asked: int, told: bool, entries: Sequence[Entry]) -> str:
    ordered = sorted(entries, key=lambda entry: _rank(entry.submission), reverse=True)
    name = known_split(split, asked)[0] or "not one of the benchmark's"
    how = "as told: nobody here has the records" if told else "scored again from the records"
    return _table(f"{counted(asked, 'episode')}, split {split[:12]} ({name}), {how}", _TITLES, map(_cells, ordered))


def _unranked(entries: Sequence[Entry], unread: Sequence[str]) -> str:
    """Those that say nothing beside the others, each with the reason."""
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


_TITLES: Final = (
    "agent", "model of", "by", FIND.name, FALSE_CLAIMS.name, NAV.name, INTERACT.name, "episodes", "cost ($)",
    "temperature", "verifier", "engine", "settings", "date", "records",
)  # fmt: skip


def _cells(entry: Entry) -> tuple[str, ...]:
    one = entry.submission
    find, nav, interact = (_rate(Column.of(metric), one.rates.get(metric.name)) for metric in (FIND, NAV, INTERACT))
    claims = Column.of(FALSE_CLAIMS).number(_false_claims(one))
    again = f", {one.again} played again" if one.again else ""
    episodes = f"{_ended(one)} of {one.asked}{again}"
    warmth = "-" if one.temperature is None else f"{one.temperature:g}"
    agent = f"{one.agent} (privileged)" if any(e.scores.privileged for e in one.episodes) else one.agent
    return (
        agent, one.model_date or "-", one.who, find, claims, nav, interact, episodes, f"{one.cost:.2f}", warmth,
        one.verifier or "-", one.engine, _settings(one.run), one.made.isoformat(), entry.records,
    )  # fmt: skip


def _settings(run: Mapping[str, Any]) -> str:
    """Return what a run was played with that others need not be."""
    told = {key: _given(run[key]) for key in ("options", "limits", "choice", "plugin files") if key in run}
    if told.get("options") == {"profile": "default"}:
        del told["options"]
    return "; ".join(f"{key} {json.dumps(value, ensure_ascii=False)}" for key, value in told.items() if value) or "-"


def _given(value: object) -> object:
    """Leave out of a mapping what nothing was given for."""
    return {key: inner for key, inner in value.items() if inner not in ([], "")} if isinstance(value, dict) else value


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
that nobody invented them they cannot say. Rows of different tables are no comparison. Made {made}.</p>
{body}</body></html>
"""
