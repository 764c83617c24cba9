"""Check a run: its records are whole, and its episodes are those that run.json names.

run.json holds the digest of the split. Its episodes come from the records of a whole run, from split.jsonl beside
run.json, or from the benchmark's own splits. Each record is then compared with its episode, field by field.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import chain
from pathlib import Path, PureWindowsPath
from typing import Annotated, Any, Final

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from humanclaw import EpisodeSpec, HumanclawError, RecordedEpisode, RecordError
from humanclaw.cli import counted
from humanclaw.records import EpisodeRecord, first_fault, read_episodes
from humanclaw.storage import Folder, lacking
from humanclaw_bench.scores import ended
from humanclaw_bench.splits import SPLITS, load_split, repeated

MANIFEST: Final = "run.json"
SPLIT: Final = "split.jsonl"
"""File with the episodes of a run, in its folder."""
JOURNAL: Final = "journal.jsonl"
"""File with a line for every episode that ended."""
LARGEST: Final = 64 << 20
"""Maximum bytes of each of the three."""
MOST: Final = 100_000
"""Maximum episodes of a run."""
REPEATS: Final = 100
"""Maximum repeats of an episode; runs with more need the split beside run.json."""


# -- run.json ----------------------------------------------------------------------------------------------------------
class Manifest(BaseModel):
    """The fields of run.json that are checked; it holds more."""

    model_config = ConfigDict(frozen=True, extra="allow", strict=True)

    episodes: Annotated[int, Field(ge=1, le=MOST)]
    split: str
    """SHA-256 of the episodes (split_digest)."""
    options: dict[str, Any]
    verifier: str
    """Registered name of the verifier; records hold its own name."""
    limits: dict[str, float]
    backends: dict[str, Any]
    versions: dict[str, str]
    weights: dict[str, str]
    choice: dict[str, list[str]] = {}
    """Choice of plugins and skills; empty for all."""
    plugin_files: Annotated[dict[str, str], Field(alias="plugin files")] = {}

    @property
    def content(self) -> dict[str, Any]:
        """All of run.json."""
        return self.model_dump(exclude_unset=True, by_alias=True)


def read_manifest(run: Path) -> Manifest:
    """Read run.json of a run. Raises RecordError if it is missing, damaged or invalid."""
    path = run / MANIFEST
    try:
        return Manifest.model_validate_json(Folder(run).read(MANIFEST, LARGEST))
    except OSError as error:
        raise RecordError(
            f"{path} cannot be read: {error.strerror}.", "Name a folder of `humanclaw bench run`."
        ) from error
    except ValidationError as error:
        told = f"{path} is damaged: {first_fault(error)}."
        raise RecordError(told, "Run the split again in another folder.") from None


def split_digest(specs: Iterable[EpisodeSpec]) -> str:
    """Return the SHA-256 of episodes, in any order."""
    lines = (spec.model_dump_json() for spec in sorted(specs, key=lambda spec: spec.id))
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


@cache
def known_split(digest: str, episodes: int) -> tuple[str, Sequence[EpisodeSpec]]:
    """Return the benchmark's split with a digest, by name, and its episodes; ("", ()) if none has it.

    episodes: number of episodes of the run, repeats included.
    """
    for name in SPLITS:
        specs = load_split(name)
        times, rest = divmod(episodes, len(specs))
        if split_digest(specs) == digest:
            return name, specs
        if 1 < times <= REPEATS and not rest and split_digest(found := repeated(specs, times)) == digest:
            return f"{name}, each {times} times", found
    return "", ()


# -- contradictions ----------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Standing:
    """Facts about a run besides its scores."""

    asked: int = 0
    """Number of episodes according to run.json; 0 without one."""
    faults: tuple[str, ...] = ()
    """Contradictions to run.json, and records without a seal; one line each."""
    again: int = 0
    """Number of episodes that were played more than once from their first step."""
    continued: int = 0
    """Number of episodes that went on after their last recorded step."""
    unstarted: int = 0
    """Number of records without a start in the journal, which may lack other attempts too."""
    in_process: bool = False
    """Whether an unprivileged agent or verifier of a run with a run.json played in the body's own process."""


def standing(run: Path, episodes: Sequence[RecordedEpisode]) -> Standing:
    """Check the episodes of a run, as they were read, against its run.json. Raises RecordError if that is damaged."""
    files = RunFiles.read(run)
    told = files.journal
    return Standing(
        files.asked, faults(episodes, run, files), len(told.again), len(told.continued),
        files.unstarted(one.record.spec.id for one in episodes),
        bool(files.manifest) and any(map(_in_process, episodes)),
    )  # fmt: skip


def _in_process(one: RecordedEpisode) -> bool:
    apart, privileged = (one.record.settings.get(what, {}) for what in ("apart", "privileged"))
    return any(not known and role not in apart for role, known in privileged.items())


def is_told(folder: Path) -> bool:
    """Tell whether a run.json lies in, above or below a folder."""
    return Folder(folder.absolute().parent).has(MANIFEST) or bool(Folder(folder).holding(MANIFEST))


def check(run: Path, files: RunFiles | None = None) -> tuple[int, tuple[str, ...]]:
    """Return the number of records of a run, and everything that is wrong with them.

    files: those of the run, if they have been read. Raises RecordError if there is no record, or if run.json is
    damaged.
    """
    held = {one.path: one for name in ("episode.json", "steps.jsonl") for one in Folder(run).holding(name)}
    folders = [held[path] for path in sorted(held)]
    if not folders:
        raise lacking(run, "episode record", "Name a folder that `humanclaw bench run` wrote.")
    whole, damaged = [], []
    for folder in folders:
        try:
            whole.append(RecordedEpisode(folder))
        except RecordError as error:
            damaged.append(error.message)
    return len(folders), (*damaged, *faults(whole, run, files))


def faults(episodes: Sequence[RecordedEpisode], root: Path, files: RunFiles | None = None) -> tuple[str, ...]:
    """Return which records have no seal, and which do not belong to the run in whose folder they lie.

    root: the folder under which they were found. files: those of root, if they have been read. Raises RecordError if a
    run.json is damaged.
    """
    unsealed = [
        f"{one.folder / 'episode.json'} has no seal, so changes cannot be detected."
        for one in episodes
        if not one.record.seal
    ]
    runs: dict[Path, list[RecordedEpisode]] = defaultdict(list)
    for one in episodes:
        if home := _home(one.folder, root):
            runs[home].append(one)
    return (
        *unsealed,
        *chain.from_iterable(
            _foreign(run, files if files and run == root else RunFiles.read(run), found) for run, found in runs.items()
        ),
    )


def _home(folder: Path, root: Path) -> Path | None:
    """Return the run of a record: the outermost folder with a run.json, from the root down to the record.

    A run inside of another belongs to the outer one; otherwise the outer run.json could be bypassed.
    """
    above = [parent for parent in folder.parents if parent in (folder.parent, root) or root in parent.parents]
    return next((parent for parent in reversed(above) if Folder(parent).has(MANIFEST)), None)


@dataclass(frozen=True)
class End:
    """The end of an episode."""

    outcome: str
    steps: int

    def __str__(self) -> str:
        return f"{self.outcome} after {counted(self.steps, 'step')}"


@dataclass(frozen=True)
class Journal:
    """What a run noted of its episodes, by name: unreadable lines, which a full disk may leave, are skipped."""

    ends: Mapping[str, Sequence[End]]
    """Ends that count."""
    starts: Mapping[str, int]
    """How often each was started from its first step."""
    continued: Mapping[str, int]
    """How often each went on after its last recorded step."""

    @classmethod
    def read(cls, run: Path) -> Journal:
        try:
            text = Folder(run).read(JOURNAL, LARGEST)
        except FileNotFoundError:
            text = b""
        except OSError as error:
            raise RecordError(f"cannot read {run / JOURNAL}: {error.strerror}.", "Remove it.") from error
        ends: dict[str, list[End]] = defaultdict(list)
        starts: Counter[str] = Counter()
        continued: Counter[str] = Counter()
        for line in re.finditer(rb"[^\n]+", text):  # A list of lines of millions of empty ones would take gigabytes.
            with contextlib.suppress(ValueError, KeyError, TypeError, OverflowError, RecursionError):
                told = json.loads(line[0])
                if "from" in told:
                    (continued if told["from"] else starts)[str(told["episode"])] += 1
                elif ended(str(told["outcome"]), str(told["limit"])):
                    ends[str(told["episode"])].append(End(str(told["outcome"]), int(told["steps"])))
        return cls(ends, starts, continued)

    @property
    def again(self) -> tuple[str, ...]:
        """Episodes that were played more than once from their first step, by name, whatever the reason: a damaged
        record, a provider that failed, a worker that died, or somebody who threw the record away."""
        played = {
            name: max(len(self.ends.get(name, ())), self.starts.get(name, 0)) for name in {*self.ends, *self.starts}
        }
        return tuple(sorted(name for name, times in played.items() if times > 1))


@dataclass(frozen=True)
class RunFiles:
    """run.json and the journal of a run, read once."""

    manifest: Manifest | None
    """None without a run.json."""
    journal: Journal

    @classmethod
    def read(cls, run: Path) -> RunFiles:
        """Read both. Raises RecordError if run.json is damaged, or one of them is a link or no regular file."""
        there = MANIFEST in Folder(run).names()
        return cls(read_manifest(run) if there else None, Journal.read(run))

    @property
    def asked(self) -> int:
        """Number of episodes of the run; 0 without a run.json."""
        return self.manifest.episodes if self.manifest else 0

    @property
    def again(self) -> tuple[str, ...]:
        """Episodes that were played more than once from their first step, by name."""
        return self.journal.again

    def unstarted(self, episodes: Iterable[str]) -> int:
        """Return how many episodes, by name, have no start in the journal; 0 without a run.json."""
        return sum(name not in self.journal.starts for name in episodes) if self.manifest else 0


def _foreign(run: Path, files: RunFiles, episodes: Sequence[RecordedEpisode]) -> Iterator[str]:
    """Yield the contradictions between the records of a run and its run.json."""
    here = [one for one in episodes if one.folder.parent == run]
    for one in episodes:
        if one.folder.parent != run:
            yield f"{one.folder} lies below the run {run} and not in its folder, where its episodes lie: move it away."
    told = files.manifest or read_manifest(run)
    asked = _asked(run, told, [one.record.spec for one in here])
    yield from _other_split(run, told, len(here), len(asked))
    # An agent that could not be made is recorded as unprivileged, whatever it is.
    if not told.content.get("in process") and any(_in_process(o) for o in here if o.record.outcome != "plugin_error"):
        yield f"{run / MANIFEST} does not say that agent or verifier played in the body's own process; the records do."
    usual = _usual([one.record for one in here])
    for one in here:
        if differing := [*_other_episode(one, asked), *_other_settings(one.record, told, usual)]:
            yield f"{one.folder} is not of this run: {', '.join(differing)}."
        yield from _other_end(one, files.journal.ends.get(one.record.spec.id, []))


def _other_split(run: Path, told: Manifest, here: int, asked: int) -> Iterator[str]:
    """Yield that the split of run.json is unknown, or has another number of episodes."""
    split, episodes = f"split {told.split[:12]}", counted(told.episodes, "episode")
    if not asked:
        nowhere = f"neither the {counted(here, 'record')} here nor a {SPLIT} beside it nor a split of the benchmark"
        yield f"{run / MANIFEST} names {episodes} of {split}; {nowhere} is that one."
    elif asked != told.episodes:
        yield f"{run / MANIFEST} says that the run is of {episodes}; {split} has {asked}."


def _other_end(one: RecordedEpisode, ends: Sequence[End]) -> Iterator[str]:
    """Yield that a record is not the last end in the journal: somebody may have chosen the best of several attempts."""
    found = End(one.record.outcome, one.record.steps)
    if ends and ended(found.outcome, one.record.limit) and found != ends[-1]:
        yield f"{one.folder} is not the record that was made last: {found}; by the journal {ends[-1]}."


def _asked(run: Path, told: Manifest, found: Sequence[EpisodeSpec]) -> Mapping[str, EpisodeSpec]:
    """Return the episodes of the split that run.json names, by id; none if the split is not found."""
    for specs in chain([found], _splits(run, told)):
        if specs and split_digest(specs) == told.split:
            return {spec.id: spec for spec in specs}
    return {}


def _splits(run: Path, told: Manifest) -> Iterator[Sequence[EpisodeSpec]]:
    """Yield candidates for the split of a run: the file beside its run.json, then the benchmark's own splits."""
    if Folder(run).has(SPLIT):
        try:
            yield read_episodes(run / SPLIT, Folder(run).read(SPLIT, LARGEST))
        except HumanclawError as error:
            raise RecordError(error.message, error.remedy) from error
    yield known_split(told.split, told.episodes)[1]


def _other_episode(one: RecordedEpisode, asked: Mapping[str, EpisodeSpec]) -> list[str]:
    """Return the fields in which a record's episode differs from the split's."""
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
    """Return the settings in which a record differs from run.json, or from most records of its run."""
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
    """Yield differing backends, versions and weights.

    A record has the versions of its own episode, and run.json those of all. Weights of adapters are compared by the
    digests of skills.
    """
    body = record.settings.get("body", {})
    origins = {info.origin for info in record.skills.values()} & record.versions.keys()
    parts = [("backends", name, body, told.backends) for name in sorted(body.keys() | told.backends.keys())]
    named = {"humanclaw", *origins, *(told.versions.keys() & record.versions.keys())}
    parts += [("versions", name, record.versions, told.versions) for name in sorted(named)]
    parts += [("weights", name, record.weights, told.weights) for name in sorted(record.weights)]
    for kind, name, found, wanted in parts:
        if found.get(name) != wanted.get(name):
            yield f"{kind} {name}"


def _usual(records: Sequence[EpisodeRecord]) -> dict[str, str]:
    """Return the most common values of the settings that all records must share and run.json does not hold."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for record in records:
        for what, value in _common(record).items():
            counts[what][value] += 1
    return {what: count.most_common(1)[0][0] for what, count in counts.items()}


def _common(record: EpisodeRecord) -> dict[str, str]:
    """Return these settings of a record. An agent whose plugin failed has none."""
    skills = sorted((name, info.digest) for name, info in record.skills.items())
    deciders = {"verifier": record.verifier, "temperature": record.settings.get("agent", {}).get("temperature")}
    told = {"skills": skills} | (deciders if record.outcome != "plugin_error" else {})
    return {what: json.dumps(value, sort_keys=True) for what, value in told.items()}
