"""A run's numbers in one file, checked against its records."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, date, datetime
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, TypeAdapter, ValidationError

from humanclaw import RecordedEpisode, RecordError, load_run
from humanclaw.records import first_fault
from humanclaw.storage import Folder
from humanclaw_bench.causes import Cause
from humanclaw_bench.export import row, scored
from humanclaw_bench.integrity import MOST as EPISODES, Manifest, Standing, known_split, read_manifest, standing
from humanclaw_bench.metrics import ARRIVE, FIND, INTERACT, NAV, estimate
from humanclaw_bench.motion_check import moved
from humanclaw_bench.results import named, require_whole, shared_conditions
from humanclaw_bench.scores import Scores, ended, keeps_pace
from humanclaw_bench.splits import original_of
from humanclaw_bench.statistics import Estimate, rate

NAME: Final = "submission.json"
RATES: Final = {FIND: "find", NAV: "nav", ARRIVE: "arrive", INTERACT: "interact"}
"""The ranked rates, from first to last stage, and their fields in an episode's numbers."""
MOST: Final = 10**15
"""Maximum of any count."""
_WRITE: Final = "Write it with `humanclaw bench submit`."
LARGEST: Final = 96 << 20
"""Maximum bytes of a submission; 1,218 episodes take two million."""
TOLERANCE: Final = 1e-6
"""Allowed difference of recomputed numbers: processors round differently."""
_EXACT: Final = ("agent", "verifier", "engine", "temperature", "seeds", "asked", "tokens", "run", "conditions")
_UNSCORED: Final = ("agent", "verifier", "error", "extra")


class _Value(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


Text = Annotated[str, Field(max_length=500)]
Who = Annotated[Text, StringConstraints(strip_whitespace=True, min_length=1)]
Dollars = Annotated[float, Field(ge=0, le=MOST)]
Measure = Annotated[float, Field(ge=0, le=MOST)]
"""Of seconds or metres."""
Count = Annotated[int, Field(ge=0, le=MOST)]


class Numbers(_Value):
    """An episode's numbers as `bench rescore` writes them. The fields are those that the page uses."""

    model_config = ConfigDict(extra="allow", strict=True)

    scene: str
    outcome: str
    limit: str = ""
    find: bool | None
    nav: bool | None
    arrive: bool | None = None
    interact: bool | None
    """None: not part of the task."""
    false_claims: Annotated[float, Field(ge=0, le=1)] | None
    cost: Dollars
    tokens_in: Count
    tokens_out: Count
    privileged: str | None = None
    motion: Measure = 0.0
    longest: Measure = 0.0
    fastest: Measure = 0.0

    @property
    def in_pace(self) -> bool:
        return keeps_pace(self.longest, self.fastest)

    @property
    def ended(self) -> bool:
        return ended(self.outcome, self.limit)


class EpisodeResult(_Value):
    """One episode of a submission: the digest of its record and its numbers."""

    id: Text
    seed: int
    digest: Text
    """RecordedEpisode.digest."""
    scores: Numbers


class Submission(_Value):
    """The numbers of a run for a leaderboard, with everything needed to check them."""

    format: Literal[2] = 2
    who: Who
    """The author, as shown on the page."""
    made: date
    """Date of this file."""
    agent: Text
    verifier: Text = ""
    """Name of the verifier; empty for none."""
    model_date: Text = ""
    """Version or date of the model from its provider: a name alone may change its meaning."""
    temperature: Annotated[float, Field(ge=0, le=100)] | None = None
    """None if unknown or without a model."""
    engine: Text
    """Name of the simulator."""
    seeds: tuple[int, ...]
    """Seeds of the episodes, each once."""
    asked: Annotated[int, Field(ge=1, le=EPISODES)]
    """Number of episodes of the run."""
    cost: Dollars
    """Cost of all episodes, unfinished ones included, US dollars."""
    tokens: Count
    again: Count = 0
    """Number of episodes that were played more than once from their first step, according to the journal."""
    continued: Count = 0
    """Number of episodes that went on after their last recorded step in another session."""
    unstarted: Count = 0
    """Number of episodes without a start in the journal."""
    run: dict[str, Any]
    """run.json: split and weights by digest, options, versions, limits."""
    conditions: dict[str, str] = {}
    """What the episodes were played with (humanclaw_bench.conditions)."""
    rates: dict[str, tuple[float, float, float, int]]
    """FindSR, NavSR, ArriveSR, InteractSR: value, interval, episodes."""
    episodes: tuple[EpisodeResult, ...]
    digest: str = ""
    """SHA-256 of this file without this field."""

    @property
    def sealed(self) -> Submission:
        """The submission with its digest."""
        content = self.model_dump_json(exclude={"digest"}).encode()
        return self.model_copy(update={"digest": hashlib.sha256(content).hexdigest()})


def submit(run: Path, who: str, model_date: str = "", partial: bool = True) -> Submission:
    """Make the submission of a run. Raises RecordError unless its records are whole, sealed and of one agent.

    partial: allow missing episodes.
    """
    try:  # The author first: it is the command's own word.
        TypeAdapter(Who).validate_python(who)
    except ValidationError as error:
        raise RecordError(f"no submission can be made: who: {first_fault(error)}.", "Name the author.") from error
    manifest, episodes = read_manifest(run), load_run(run)
    known = standing(run, episodes)
    if fault := next(chain(known.faults, moved(episodes)), None):
        raise RecordError(fault, f"`humanclaw bench verify {run}` lists everything that is wrong.")
    agents = sorted({episode.record.agent for episode in episodes})
    if len(agents) > 1:
        raise RecordError(f"{run} holds runs of several agents ({', '.join(agents)}).", "Name the folder of one.")
    pairs = scored(episodes, name=run.name)
    require_whole(named({str(run): pairs}, {str(run): known}), partial)
    try:
        return _made(episodes, pairs, manifest, known, who, model_date).sealed
    except ValidationError as error:
        said = f"no submission can be made of {run}: {first_fault(error)}."
        raise RecordError(said, "Fix that and try again.") from error


def _made(
    episodes: Sequence[RecordedEpisode],
    pairs: Sequence[tuple[Scores, Cause | None]],
    manifest: Manifest,
    known: Standing,
    who: str,
    model_date: str,
) -> Submission:
    scores = [one for one, _ in pairs]
    results = tuple(_result(*entry) for entry in zip(episodes, (row(*pair) for pair in pairs), strict=True))
    # An agent that could not be made has no settings.
    first = min((one.record for one in episodes), key=lambda record: record.outcome == "plugin_error")
    return Submission(
        who=who, made=datetime.now(UTC).date(), agent=first.agent, verifier=first.verifier, model_date=model_date,
        temperature=_temperature(first.settings.get("agent", {}).get("temperature")),
        engine=str(first.settings.get("body", {}).get("simulator", "")),
        seeds=tuple(sorted({one.seed for one in results})), asked=manifest.episodes,
        cost=sum(one.cost for one in scores), tokens=sum(one.tokens_in + one.tokens_out for one in scores),
        again=known.again, continued=known.continued, unstarted=known.unstarted, run=manifest.content,
        conditions=dict(shared_conditions(scores)),
        rates=_rates(scores), episodes=results,
    )  # fmt: skip


def _temperature(told: object) -> float | None:
    """Return a temperature from an agent's settings; None if it is not a number."""
    return float(told) if isinstance(told, int | float) and 0 <= told <= 100 else None


def _result(recorded: RecordedEpisode, numbers: Mapping[str, Any]) -> EpisodeResult:
    kept = {key: value for key, value in numbers.items() if key not in _UNSCORED}
    spec = recorded.record.spec
    return EpisodeResult(id=spec.id, seed=spec.seed, digest=recorded.digest, scores=Numbers(**kept))


def _rates(scores: Sequence[Scores]) -> dict[str, tuple[float, float, float, int]]:
    found = {metric.name: estimate(metric, scores) for metric in RATES}
    return {name: (one.value, one.low, one.high, one.count) for name, one in found.items() if one.count}


def read(path: Path) -> Submission:
    """Read a submission. Raises RecordError if it is malformed or has been changed."""
    return parsed(path, content(path))


def content(path: Path) -> bytes:
    """Return the bytes of a submission: whoever checks its signature too reads it once. Raises RecordError."""
    try:
        return Folder(path.parent).read(path.name, LARGEST)
    except OSError as error:
        raise RecordError(f"{path} is not a submission: {error.strerror}.", _WRITE) from error


def parsed(path: Path, data: bytes) -> Submission:
    """Return what content() returned as read() does."""
    try:
        found = Submission.model_validate_json(data)
    except ValidationError as error:
        raise RecordError(f"{path} is not a submission: {first_fault(error)}.", _WRITE) from error
    if found.sealed.digest != found.digest:
        raise RecordError(f"{path} has been changed since it was written.", _WRITE)
    return found


# -- checking ----------------------------------------------------------------------------------------------------------
def contradictions(claimed: Submission, run: Path) -> tuple[str, ...]:
    """Score a run again from its records, and return each contradiction to a submission.

    Raises RecordError if the records are damaged or of another run (humanclaw_bench.integrity.check).
    """
    found = submit(run, claimed.who, claimed.model_date)
    told = [*inconsistencies(claimed)]
    told += [f"{key} is {getattr(found, key)!r}, not {getattr(claimed, key)!r}" for key in _differing(claimed, found)]
    ours, theirs = ({one.id: one for one in of.episodes} for of in (found, claimed))
    told += [f"episode {name} is in one of the two alone" for name in sorted(ours.keys() ^ theirs.keys())]
    for name in sorted(ours.keys() & theirs.keys()):
        told += [f"episode {name}: {what}" for what in _unlike(ours[name], theirs[name])]
    return tuple(told)


def inconsistencies(claimed: Submission) -> Iterator[str]:
    """Yield contradictions within a submission, which need no records."""
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
    """Yield differences between its episodes and the named split, if that is one of the benchmark's."""
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
    plain = [key for key in _EXACT if getattr(claimed, key) != getattr(found, key)]
    rates = claimed.rates.keys() == found.rates.keys() and all(
        _alike(a, b) for name, values in found.rates.items() for a, b in zip(values, claimed.rates[name], strict=True)
    )
    # A host may have the records without their journal.
    plain += [key for key in ("again", "continued") if getattr(found, key) > getattr(claimed, key)]
    return plain + ([] if _alike(claimed.cost, found.cost) else ["cost"]) + ([] if rates else ["rates"])


def _unlike(ours: EpisodeResult, theirs: EpisodeResult) -> list[str]:
    if ours.digest != theirs.digest:
        return ["its record is another one"]
    if ours.seed != theirs.seed:
        return [f"seed is {ours.seed}, not {theirs.seed}"]
    one, two = (result.scores.model_dump(mode="json") for result in (ours, theirs))
    wrong = sorted(key for key in one.keys() | two.keys() if not _alike(one.get(key), two.get(key)))
    return [f"{key} is {one.get(key)!r:.80}, not {two.get(key)!r:.80}" for key in wrong]


def _alike(a: Any, b: Any) -> bool:
    if isinstance(a, float) and isinstance(b, float):
        return abs(a - b) <= TOLERANCE * max(1.0, abs(a))
    return bool(a == b)


AGREE: Final = "agree"
"""Result for records that lie beside a submission and lead to its numbers."""
