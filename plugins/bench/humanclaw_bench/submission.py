"""A result that others can check: one file with what was run and what came of it, held against the records it is of.

A leaderboard is a folder of such files; where the run lies beside one, in a folder of the same name, its records are
read again.
"""

from __future__ import annotations

import hashlib
import html
import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from humanclaw import RecordedEpisode, RecordError, load_run
from humanclaw.cli import counted
from humanclaw.storage import write_atomically
from humanclaw_bench.export import row, scored
from humanclaw_bench.metrics import FIND, INTERACT, NAV, Scores, estimate
from humanclaw_bench.statistics import Estimate
from humanclaw_bench.tables import Column

NAME: Final = "submission.json"
RATES: Final = (FIND, NAV, INTERACT)
TOLERANCE: Final = 1e-6
"""By how much a number that is computed again may differ: other processors round otherwise."""
_UNSCORED: Final = ("agent", "verifier", "error", "extra")


class _Value(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="strings")


class EpisodeResult(_Value):
    """One episode of a submission: the digest of its record and its numbers, as `bench rescore` writes them."""

    id: str
    seed: int
    digest: str
    """SHA-256 over all that happened in it (RecordedEpisode.digest)."""
    scores: dict[str, Any]


class Submission(_Value):
    """All that a leaderboard shows of a run, and what it takes to check it."""

    format: Literal[1] = 1
    who: str
    """Whoever submits it, as it is to be shown."""
    made: str
    """Day on which this file was written, ISO 8601."""
    agent: str
    model_date: str = ""
    """Version or day of the model as its provider tells it; a name alone may be another model tomorrow."""
    temperature: float | None = None
    """None: not told, or no model."""
    engine: str
    """What moved the world."""
    seeds: tuple[int, ...]
    """Of the episodes, each once."""
    asked: int
    """Episodes that the run is of."""
    cost: float
    """US dollars of all episodes, unfinished ones included."""
    tokens: int
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
    """Make the submission of a run from its records. Raises RecordError unless it is one whole run of one agent."""
    episodes, manifest = load_run(run), _manifest(run)
    agents = sorted({episode.record.agent for episode in episodes})
    if len(agents) > 1:
        raise RecordError(f"{run} holds runs of several agents ({', '.join(agents)}).", "Name the folder of one.")
    pairs = scored(episodes, name=run.name)
    scores = [one for one, _ in pairs]
    results = tuple(_result(*entry) for entry in zip(episodes, (row(*pair) for pair in pairs), strict=True))
    settings = episodes[0].record.settings
    temperature = settings.get("agent", {}).get("temperature")
    return Submission(
        who=who, made=datetime.now(UTC).date().isoformat(), agent=agents[0], model_date=model_date,
        temperature=None if temperature is None else float(temperature),
        engine=str(settings.get("body", {}).get("simulator", "")), seeds=tuple(sorted({one.seed for one in results})),
        asked=max(int(manifest.get("episodes", 0)), len(episodes)), cost=sum(one.cost for one in scores),
        tokens=sum(one.tokens_in + one.tokens_out for one in scores), run=manifest, rates=_rates(scores),
        episodes=results,
    ).sealed  # fmt: skip


def _manifest(run: Path) -> dict[str, Any]:
    try:
        return dict(json.loads((run / "run.json").read_bytes()))
    except (OSError, ValueError) as error:
        raise RecordError(
            f"{run / 'run.json'} cannot be read: {error}.", "Name a folder of `humanclaw bench run`."
        ) from error


def _result(recorded: RecordedEpisode, numbers: Mapping[str, Any]) -> EpisodeResult:
    kept = {key: value for key, value in numbers.items() if key not in _UNSCORED}
    spec = recorded.record.spec
    return EpisodeResult(id=spec.id, seed=spec.seed, digest=recorded.digest, scores=kept)


def _rates(scores: Sequence[Scores]) -> dict[str, tuple[float, float, float, int]]:
    found = {metric.name: estimate(metric, scores) for metric in RATES}
    return {name: (one.value, one.low, one.high, one.count) for name, one in found.items() if one.count}


def read(path: Path) -> Submission:
    """Read a submission. Raises RecordError if it is none or has been changed."""
    try:
        found = Submission.model_validate_json(path.read_bytes())
    except (OSError, ValidationError) as error:
        raise RecordError(f"{path} is no submission: {error}.", "Write it with `humanclaw bench submit`.") from error
    if found.sealed.digest != found.digest:
        raise RecordError(f"{path} has been changed since it was written.", "Write it with `humanclaw bench submit`.")
    return found


# -- checking ----------------------------------------------------------------------------------------------------------
def contradictions(claimed: Submission, run: Path) -> tuple[str, ...]:
    """Score a run again from its records, and tell in what a submission says something else; a line each.

    The records themselves have to be whole: humanclaw_bench.runner.damage tells.
    """
    found = submit(run, claimed.who, claimed.model_date)
    told = [f"{key} is {getattr(found, key)!r}, not {getattr(claimed, key)!r}" for key in _differing(claimed, found)]
    ours, theirs = ({one.id: one for one in of.episodes} for of in (found, claimed))
    told += [f"episode {name} is in one of the two alone" for name in sorted(ours.keys() ^ theirs.keys())]
    for name in sorted(ours.keys() & theirs.keys()):
        told += [f"episode {name}: {what}" for what in _unlike(ours[name], theirs[name])]
    return tuple(told)


def _differing(claimed: Submission, found: Submission) -> list[str]:
    plain = [key for key in ("agent", "engine", "temperature", "seeds", "asked", "tokens", "run")
             if getattr(claimed, key) != getattr(found, key)]  # fmt: skip
    rates = claimed.rates.keys() == found.rates.keys() and all(
        _alike(a, b) for name, values in found.rates.items() for a, b in zip(values, claimed.rates[name], strict=True)
    )
    return plain + ([] if _alike(claimed.cost, found.cost) else ["cost"]) + ([] if rates else ["rates"])


def _unlike(ours: EpisodeResult, theirs: EpisodeResult) -> list[str]:
    if ours.digest != theirs.digest:
        return ["its record is another one"]
    keys = ours.scores.keys() | theirs.scores.keys()
    wrong = sorted(key for key in keys if not _alike(ours.scores.get(key), theirs.scores.get(key)))
    return [f"{key} is {ours.scores.get(key)!r}, not {theirs.scores.get(key)!r}" for key in wrong]


def _alike(a: Any, b: Any) -> bool:
    if isinstance(a, float) and isinstance(b, int | float):
        return abs(a - b) <= TOLERANCE * max(1.0, abs(a))
    return bool(a == b)


# -- the page ----------------------------------------------------------------------------------------------------------
def leaderboard(folder: Path) -> Path:
    """Write index.html of all submissions in a folder, a table a split, the best InteractSR first; returns its path.

    Raises RecordError if there is none, or if one is damaged.
    """
    found = [(path, read(path)) for path in sorted(folder.glob("*.json"))]
    if not found:
        raise RecordError(f"there is no submission in {folder}.", "Put files of `humanclaw bench submit` there.")
    splits: dict[str, list[tuple[Path, Submission]]] = {}
    for path, one in found:
        splits.setdefault(str(one.run.get("split", "")), []).append((path, one))
    body = "".join(_section(split, entries) for split, entries in sorted(splits.items()))
    page = _PAGE.format(body=body, made=datetime.now(UTC).date().isoformat())
    write_atomically(folder / "index.html", page.encode())
    return folder / "index.html"


def _section(split: str, entries: Sequence[tuple[Path, Submission]]) -> str:
    ordered = sorted(entries, key=lambda entry: _rank(entry[1]), reverse=True)
    head = "".join(f"<th scope='col'>{html.escape(title)}</th>" for title in _TITLES)
    rows = "".join("<tr>" + "".join(_cells(path, one)) + "</tr>" for path, one in ordered)
    asked = max(one.asked for _, one in entries)
    caption = f"{counted(asked, 'episode')}, split {html.escape(split[:12])}"
    return f"<table><caption>{caption}</caption><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"


def _rank(one: Submission) -> tuple[float, ...]:
    return tuple(one.rates.get(metric.name, (-1.0,))[0] for metric in reversed(RATES))


_TITLES: Final = (
    "agent", "model of", "by", *(metric.name for metric in RATES), "episodes", "cost ($)", "temperature", "engine",
    "date", "records",
)  # fmt: skip


def _cells(path: Path, one: Submission) -> list[str]:
    ended = sum(bool(episode.scores.get("outcome") not in ("infra_error", "interrupted")) for episode in one.episodes)
    rates = [_rate(Column.of(metric), one.rates.get(metric.name)) for metric in RATES]
    warmth = "-" if one.temperature is None else f"{one.temperature:g}"
    texts = [
        one.agent, one.model_date or "-", one.who, *rates, f"{ended} of {one.asked}", f"{one.cost:.2f}", warmth,
        one.engine, one.made, _checked(path, one),
    ]  # fmt: skip
    first, *rest = (html.escape(text) for text in texts)
    return [f"<th scope='row'>{first}</th>", *(f"<td>{text}</td>" for text in rest)]


def _rate(column: Column, values: tuple[float, float, float, int] | None) -> str:
    found = Estimate(*values) if values else Estimate(float("nan"))
    return f"{column.number(found.value)} {column.interval(found)}".strip()


def _checked(path: Path, one: Submission) -> str:
    run = path.with_suffix("")
    if not (run / "run.json").exists():
        return "not here"
    wrong = contradictions(one, run)
    return f"contradict it: {wrong[0]}" if wrong else "agree"


_PAGE: Final = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>HumanCLAW-Bench</title><style>
body {{ font: 16px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 80rem; padding: 0 1rem; }}
table {{ border-collapse: collapse; width: 100%; margin: 1.5rem 0; }} caption {{ text-align: left; font-weight: 600; }}
th, td {{ padding: .3rem .6rem; text-align: left; border-bottom: 1px solid #ccc; font-variant-numeric: tabular-nums; }}
</style></head><body><h1>HumanCLAW-Bench</h1>
<p>Rates with 95 % intervals that know houses. "agree": the records lie here, and scored again they say the same. Rows
of different splits are no comparison. Made {made}.</p>
{body}</body></html>
"""
