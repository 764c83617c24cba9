"""Check a run: its records are whole, and its episodes are those that run.json names.

run.json holds the digest of the split. Its episodes come from the records of a whole run, from split.jsonl beside
run.json, or from the benchmark's own splits. Each record is then compared with its episode, field by field.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, Final, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from humanclaw import EpisodeSpec, HumanclawError, RecordedEpisode, RecordError
from humanclaw.cli import counted
from humanclaw.records import EpisodeRecord, first_fault, read_episodes
from humanclaw.storage import Folder, lacking
from humanclaw_bench.splits import SPLITS, load_split
from humanclaw_bench.two.partners import PARTNER, part_of

M = TypeVar("M", bound=BaseModel)
MANIFEST: Final = "run.json"
SPLIT: Final = "split.jsonl"
"""File with the episodes of a run, in its folder."""
LARGEST: Final = 64 << 20
"""Maximum bytes of either."""
MOST: Final = 100_000
"""Maximum episodes of a run."""


# -- run.json ----------------------------------------------------------------------------------------------------------
class Manifest(BaseModel):
    """The fields of run.json that are checked; it holds more."""

    model_config = ConfigDict(frozen=True, extra="allow", strict=True)

    episodes: Annotated[int, Field(ge=1, le=MOST)]
    split: str
    """SHA-256 of the episodes (split_digest)."""
    options: dict[str, Any]

    @property
    def content(self) -> dict[str, Any]:
        """All of run.json."""
        return self.model_dump()


def read_json(kind: type[M], run: Path, name: str, remedy: str) -> M:
    """Read a JSON file of a run. Raises RecordError with a remedy if it is missing, damaged or invalid."""
    try:
        return kind.model_validate_json(Folder(run).read(name, LARGEST))
    except OSError as error:
        raise RecordError(f"{run / name} cannot be read: {error.strerror}.", remedy) from error
    except ValidationError as error:
        raise RecordError(f"{run / name} is damaged: {first_fault(error)}.", remedy) from error


def read_manifest(run: Path) -> Manifest:
    """Read run.json of a run. Raises RecordError if it is missing, damaged or invalid."""
    return read_json(
        Manifest, run, MANIFEST, "Name a folder of `humanclaw bench run`, or run the split in another one."
    )


def split_digest(specs: Iterable[EpisodeSpec]) -> str:
    """Return the SHA-256 of episodes, in any order."""
    lines = (spec.model_dump_json() for spec in sorted(specs, key=lambda spec: spec.id))
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


@cache
def known_split(digest: str) -> tuple[str, Sequence[EpisodeSpec]]:
    """Return the benchmark's split with a digest, by name, and its episodes; ("", ()) if none has it."""
    splits = ((name, load_split(name)) for name in SPLITS)
    return next(((name, specs) for name, specs in splits if split_digest(specs) == digest), ("", ()))


# -- records -----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Standing:
    """Facts about a run besides its scores."""

    asked: int = 0
    """Number of episodes according to run.json; 0 without one."""
    faults: tuple[str, ...] = ()
    """Records without a seal, and records that are not of this run; one line each."""
    in_process: bool = False
    """Whether an unprivileged agent or verifier of a run with a run.json played in the body's own process."""


def standing(run: Path, episodes: Sequence[RecordedEpisode]) -> Standing:
    """Check the episodes of a run, as they were read, against its run.json. Raises RecordError if that is damaged."""
    manifest = read_manifest(run) if MANIFEST in Folder(run).names() else None
    faults = [
        f"{episode.folder / 'episode.json'} has no seal of its files, so changes cannot be detected."
        for episode in episodes
        if not _sealed(episode.record)
    ]
    faults += [fault for episode in episodes for fault in _partner_faults(episode)]
    if manifest is None:
        return Standing(0, tuple(faults))
    beside = any(map(_in_process, episodes))
    return Standing(manifest.episodes, (*faults, *_foreign(run, manifest, episodes)), beside)


def _sealed(record: EpisodeRecord) -> bool:
    """Tell whether a record has a seal, and the digests of its files once it has ended."""
    return bool(record.seal) and (record.outcome == "running" or bool(record.files))


def _in_process(episode: RecordedEpisode) -> bool:
    apart, privileged = (episode.record.settings.get(what, {}) for what in ("apart", "privileged"))
    return any(not known and role not in apart for role, known in privileged.items())


def check(run: Path) -> tuple[int, Standing]:
    """Return the number of records of a run, and everything that is wrong with them.

    Raises RecordError if there is no record, or if run.json is damaged.
    """
    held = {folder.path: folder for name in ("episode.json", "steps.jsonl") for folder in Folder(run).holding(name)}
    if not held:
        raise lacking(run, "episode record", "Name a folder that `humanclaw bench run` wrote.")
    whole, damaged = [], []
    for path in sorted(held):
        try:
            whole.append(RecordedEpisode(held[path]))
        except RecordError as error:
            damaged.append(error.message)
    known = standing(run, whole)
    return len(held), replace(known, faults=(*damaged, *known.faults))


def _partner_faults(episode: RecordedEpisode) -> Iterator[str]:
    """Yield what is wrong with the record of an episode's partner, which lies in the episode's folder."""
    spec = episode.record.spec
    if spec.partner is None or not episode.has_motion:
        return
    try:
        partner = RecordedEpisode(episode.folder / PARTNER).record
    except RecordError as error:
        yield error.message
    else:
        if partner.spec != part_of(spec) or not _sealed(partner):
            yield f"{episode.folder / PARTNER} is not the sealed record of this episode's partner."


def _foreign(run: Path, manifest: Manifest, episodes: Sequence[RecordedEpisode]) -> Iterator[str]:
    """Yield the contradictions between the records of a run and its run.json."""
    here = [episode for episode in episodes if episode.folder.parent == run]
    for episode in episodes:
        if episode.folder.parent != run:
            yield f"{episode.folder} lies below the run {run} and not in its folder: move it away."
    asked = _asked(run, manifest, [episode.record.spec for episode in here])
    yield from _other_split(run, manifest, len(here), len(asked))
    for episode in here:
        if differing := _other_episode(episode, manifest, asked):
            yield f"{episode.folder} is not of this run: {', '.join(differing)}."


def _other_split(run: Path, manifest: Manifest, here: int, asked: int) -> Iterator[str]:
    """Yield that the split of run.json is unknown, or has another number of episodes."""
    split, episodes = f"split {manifest.split[:12]}", counted(manifest.episodes, "episode")
    if not asked:
        nowhere = f"neither the {counted(here, 'record')} here nor a {SPLIT} beside it nor a split of the benchmark"
        yield f"{run / MANIFEST} names {episodes} of {split}; {nowhere} is that one."
    elif asked != manifest.episodes:
        yield f"{run / MANIFEST} says that the run is of {episodes}; {split} has {asked}."


def _asked(run: Path, manifest: Manifest, specs_here: Sequence[EpisodeSpec]) -> Mapping[str, EpisodeSpec]:
    """Return the episodes of the split that run.json names, by id; none if the split is not found."""
    for specs in chain([specs_here], _splits(run, manifest)):
        if specs and split_digest(specs) == manifest.split:
            return {spec.id: spec for spec in specs}
    return {}


def _splits(run: Path, manifest: Manifest) -> Iterator[Sequence[EpisodeSpec]]:
    """Yield candidates for the split of a run: the file beside its run.json, then the benchmark's own splits."""
    if Folder(run).has(SPLIT):
        try:
            yield read_episodes(run / SPLIT, Folder(run).read(SPLIT, LARGEST))
        except HumanclawError as error:
            raise RecordError(error.message, error.remedy) from error
    yield known_split(manifest.split)[1]


def _other_episode(episode: RecordedEpisode, manifest: Manifest, asked: Mapping[str, EpisodeSpec]) -> list[str]:
    """Return the fields in which a record differs from its episode in the split, and whether its options do."""
    spec, options = episode.record.spec, ["options"] if episode.record.options != manifest.options else []
    if spec.id != episode.folder.name:
        return [f"it holds the record of {spec.id!r}"]
    if not asked:
        return options
    if not (wanted := asked.get(spec.id)):
        return ["the split has no such episode"]
    return [name for name in EpisodeSpec.model_fields if getattr(spec, name) != getattr(wanted, name)] + options
