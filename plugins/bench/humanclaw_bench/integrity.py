"""Whether a run is what it says it is: its records whole, and its episodes those that run.json names.

run.json holds the digest of the split. The episodes that belong to it are known from the records of a whole run, from
split.jsonl beside run.json, or from the benchmark's own splits; each record is then held to its episode, field by
field.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path, PureWindowsPath
from typing import Annotated, Any, Final

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from humanclaw import EpisodeSpec, HumanclawError, RecordedEpisode, RecordError
from humanclaw.cli import counted
from humanclaw.records import EpisodeRecord, read_episodes
from humanclaw_bench.scores import ended
from humanclaw_bench.splits import SPLITS, load_split, repeated

MANIFEST: Final = "run.json"
SPLIT: Final = "split.jsonl"
"""The episodes that a run is of, in its folder."""
JOURNAL: Final = "journal.jsonl"
"""A line for every episode that ended while it was run."""
MOST: Final = 100_000
"""Episodes of a run; more are a mistake."""
REPEATS: Final = 100
"""Of each episode; whoever has more needs the split beside run.json."""


# -- what a run says of itself -----------------------------------------------------------------------------------------
class Manifest(BaseModel):
    """What is read of run.json; it holds more."""

    model_config = ConfigDict(frozen=True, extra="allow", strict=True)

    episodes: Annotated[int, Field(ge=1, le=MOST)]
    split: str
    """SHA-256 of its episodes (split_digest)."""
    options: dict[str, Any]
    verifier: str
    """As it is registered; a record has what it calls itself."""
    limits: dict[str, float]
    backends: dict[str, Any]
    versions: dict[str, str]
    weights: dict[str, str]
    choice: dict[str, list[str]] = {}
    """Of plugins and skills; empty for all."""
    plugin_files: Annotated[dict[str, str], Field(alias="plugin files")] = {}

    @property
    def content(self) -> dict[str, Any]:
        """All of run.json, as it is there."""
        return self.model_dump(exclude_unset=True, by_alias=True)


def read_manifest(run: Path) -> Manifest:
    """Read run.json of a run. Raises RecordError if it is missing, damaged, or says something odd."""
    path = run / MANIFEST
    try:
        return Manifest.model_validate_json(path.read_bytes())
    except OSError as error:
        raise RecordError(
            f"{path} cannot be read: {error.strerror}.", "Name a folder of `humanclaw bench run`."
        ) from error
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = "".join(f" {name}:" for name in first["loc"])
        told = f"{path} is damaged:{where} {first['msg']}."
        raise RecordError(told, "Run the split again in another folder.") from None


def split_digest(specs: Iterable[EpisodeSpec]) -> str:
    """Return the SHA-256 of episodes, in whatever order they come."""
    lines = (spec.model_dump_json() for spec in sorted(specs, key=lambda spec: spec.id))
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def known_split(digest: str, episodes: int) -> tuple[str, Sequence[EpisodeSpec]]:
    """Return the benchmark's split with a digest, by name, and its episodes; ("", ()) if none has it.

    episodes: of how many a run is, which may have each several times.
    """
    for name in SPLITS:
        specs = load_split(name)
        times, rest = divmod(episodes, len(specs))
        if split_digest(specs) == digest:
            return name, specs
        if 1 < times <= REPEATS and not rest and split_digest(found := repeated(specs, times)) == digest:
            return f"{name}, each {times} times", found
    return "", ()


# -- what contradicts it -----------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Standing:
    """What is known of a run besides its episodes' scores."""

    asked: int = 0
    """Episodes that it is of, as its run.json says; 0 if there is none."""
    faults: tuple[str, ...] = ()
    """What contradicts that, or leaves it open whether a record was changed; a line each."""
    again: int = 0
    """Episodes that were played again after they had ended."""


def standing(run: Path, episodes: Sequence[RecordedEpisode]) -> Standing:
    """Hold the episodes of a run, as they were read, to its run.json. Raises RecordError if that is damaged."""
    return Standing(asked_of(run), faults(episodes, run), len(played_again(run)))


def asked_of(run: Path) -> int:
    """Return how many episodes a run is of, 0 if no run.json tells. Raises RecordError if that is damaged."""
    return read_manifest(run).episodes if (run / MANIFEST).exists() else 0


def is_told(folder: Path) -> bool:
    """Whether a run.json says of what the records in a folder are, or the record that it is."""
    return (folder.absolute().parent / MANIFEST).exists() or any(folder.rglob(MANIFEST))


def check(run: Path) -> tuple[int, tuple[str, ...]]:
    """How many records a run holds, and what is wrong with them: a line each.

    Raises RecordError if there is none, or if run.json is damaged.
    """
    folders = sorted({path.parent for name in ("episode.json", "steps.jsonl") for path in run.rglob(name)})
    if not folders:
        raise RecordError(f"there is no episode record in {run}.", "Name a folder that `humanclaw bench run` wrote.")
    whole, damaged = [], []
    for folder in folders:
        try:
            whole.append(RecordedEpisode(folder))
        except RecordError as error:
            damaged.append(error.message)
    return len(folders), (*damaged, *faults(whole, run))


def faults(episodes: Sequence[RecordedEpisode], root: Path) -> tuple[str, ...]:
    """Tell which records have no seal, and which are not of the run in whose folder they lie.

    root: the folder under which they were found. Raises RecordError if a run.json is damaged.
    """
    unsealed = [
        f"{one.folder / 'episode.json'} has no seal: nothing tells whether it has been changed."
        for one in episodes
        if not one.record.seal
    ]
    runs: dict[Path, list[RecordedEpisode]] = defaultdict(list)
    for one in episodes:
        if home := _home(one.folder, root):
            runs[home].append(one)
    return (*unsealed, *chain.from_iterable(_foreign(run, found) for run, found in runs.items()))


def _home(folder: Path, root: Path) -> Path | None:
    """Return the run to which a record belongs: of the folders over it, up to the root, the outermost with a run.json.

    A run inside another is none of its own: what stands in the outer run.json would hold for nothing.
    """
    above = [parent for parent in folder.parents if parent in (folder.parent, root) or root in parent.parents]
    return next((parent for parent in reversed(above) if (parent / MANIFEST).exists()), None)


def played_again(run: Path) -> tuple[str, ...]:
    """Return the episodes of which the journal of a run has more than one end that would have counted, by name.

    A record that was damaged is begun anew, and so is one that somebody threw away since he did not like it: nothing
    tells them apart.
    """
    return tuple(sorted(name for name, ends in journal(run).items() if len(ends) > 1))


@dataclass(frozen=True)
class End:
    """How an episode ended."""

    outcome: str
    steps: int

    def __str__(self) -> str:
        return f"{self.outcome} after {counted(self.steps, 'step')}"


def journal(run: Path) -> dict[str, list[End]]:
    """Return the ends that count of each episode, as the journal has them. A line that cannot be read, as a disk that
    was full may leave it, tells of nothing."""
    try:
        lines = (run / JOURNAL).read_bytes().splitlines()
    except OSError:
        return {}
    found: dict[str, list[End]] = defaultdict(list)
    for line in lines:
        with contextlib.suppress(ValueError, KeyError, TypeError, OverflowError, RecursionError):
            told = json.loads(line)
            if ended(str(told["outcome"]), str(told["limit"])):
                found[str(told["episode"])].append(End(str(told["outcome"]), int(told["steps"])))
    return found


def _foreign(run: Path, episodes: Sequence[RecordedEpisode]) -> Iterator[str]:
    """Yield what the records of a run say otherwise than its run.json."""
    told, here = read_manifest(run), [one for one in episodes if one.folder.parent == run]
    for one in episodes:
        if one.folder.parent != run:
            yield f"{one.folder} lies below the run {run} and not in its folder, where its episodes lie: move it away."
    asked = _asked(run, told, [one.record.spec for one in here])
    yield from _other_split(run, told, len(here), len(asked))
    usual, ends = _usual([one.record for one in here]), journal(run)
    for one in here:
        if differing := [*_other_episode(one, asked), *_other_settings(one.record, told, usual)]:
            yield f"{one.folder} is not of this run: {', '.join(differing)}."
        yield from _other_end(one, ends.get(one.record.spec.id, []))


def _other_split(run: Path, told: Manifest, here: int, asked: int) -> Iterator[str]:
    """Yield that nobody knows the split that run.json names, or that it has not so many episodes."""
    split, episodes = f"split {told.split[:12]}", counted(told.episodes, "episode")
    if not asked:
        nowhere = f"neither the {counted(here, 'record')} here nor a {SPLIT} beside it nor a split of the benchmark"
        yield f"{run / MANIFEST} names {episodes} of {split}; {nowhere} is that one."
    elif asked != told.episodes:
        yield f"{run / MANIFEST} says that the run is of {episodes}; {split} has {asked}."


def _other_end(one: RecordedEpisode, ends: Sequence[End]) -> Iterator[str]:
    """Yield that a record is not the one that the journal saw end last: of several attempts somebody may have chosen
    the best."""
    found = End(one.record.outcome, one.record.steps)
    if ends and ended(found.outcome, one.record.limit) and found != ends[-1]:
        yield f"{one.folder} is not the record that was made last: {found}; by the journal {ends[-1]}."


def _asked(run: Path, told: Manifest, found: Sequence[EpisodeSpec]) -> Mapping[str, EpisodeSpec]:
    """Return the episodes of the split that run.json names, by id; none if they are nowhere to be found."""
    for specs in chain([found], _splits(run, told)):
        if specs and split_digest(specs) == told.split:
            return {spec.id: spec for spec in specs}
    return {}


def _splits(run: Path, told: Manifest) -> Iterator[Sequence[EpisodeSpec]]:
    """Yield what the split of a run may be where its records do not tell: the one beside its run.json, and the
    benchmark's own."""
    if (run / SPLIT).exists():
        try:
            yield read_episodes(run / SPLIT)
        except HumanclawError as error:
            raise RecordError(error.message, error.remedy) from error
    yield known_split(told.split, told.episodes)[1]


def _other_episode(one: RecordedEpisode, asked: Mapping[str, EpisodeSpec]) -> list[str]:
    """In what the episode of a record is another one than the split's."""
    spec = one.record.spec
    if spec.id != one.folder.name:
        return [f"it holds the record of {spec.id!r}"]
    if not asked:
        return []
    wanted = asked.get(spec.id)
    if not wanted:
        return ["the split has no such episode"]
    return [name for name in EpisodeSpec.model_fields if getattr(spec, name) != getattr(wanted, name)]


def _other_settings(record: EpisodeRecord, told: Manifest, usual: Mapping[str, str]) -> list[str]:
    """In what a record was played otherwise than run.json says, or than most records of its run."""
    settings = record.settings
    limits = {name: most for name, most in settings.get("limits", {}).items() if not name.startswith("run.")}
    choice = {kind: list(texts) for kind, texts in told.choice.items() if texts}
    origins = {info.origin for info in record.skills.values() if info.origin.endswith(".py")} - record.versions.keys()
    same = {
        "options": told.options == record.options,
        "verifier": bool(told.verifier) == bool(record.verifier),
        "limits": told.limits == limits,
        "choice of plugins": choice == settings.get("plugins", {}),
        "plugin files": {PureWindowsPath(path).name for path in origins} <= told.plugin_files.keys(),  # Either slash.
        **{f"{what} of the others": value == usual[what] for what, value in _common(record).items()},
    }
    return [*(what for what, alike in same.items() if not alike), *_other_parts(record, told)]


def _other_parts(record: EpisodeRecord, told: Manifest) -> Iterator[str]:
    """Yield of what else a record was played with. It has versions of more than the run rests on, and the run has
    weights of adapters, which a record has in the digests of its skills."""
    body = record.settings.get("body", {})
    origins = {info.origin for info in record.skills.values()} & record.versions.keys()
    parts = [("backends", name, body, told.backends) for name in sorted(body.keys() | told.backends.keys())]
    parts += [
        ("versions", name, record.versions, told.versions) for name in sorted({"humanclaw", *origins, *told.versions})
    ]
    parts += [("weights", name, record.weights, told.weights) for name in sorted(record.weights)]
    for kind, name, found, wanted in parts:
        if found.get(name) != wanted.get(name):
            yield f"{kind} {name}"


def _usual(records: Sequence[EpisodeRecord]) -> dict[str, str]:
    """Return what most records of a run have of what all must have alike, and run.json does not tell."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for record in records:
        for what, value in _common(record).items():
            counts[what][value] += 1
    return {what: count.most_common(1)[0][0] for what, count in counts.items()}


def _common(record: EpisodeRecord) -> dict[str, str]:
    """Return that of a record. Where a plugin failed, nobody knows what an agent that was never made would have said
    of itself."""
    skills = sorted((name, info.digest) for name, info in record.skills.items())
    deciders = {"verifier": record.verifier, "temperature": record.settings.get("agent", {}).get("temperature")}
    told = {"skills": skills} | (deciders if record.outcome != "plugin_error" else {})
    return {what: json.dumps(value, sort_keys=True) for what, value in told.items()}
