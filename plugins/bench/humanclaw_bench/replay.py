"""Play the recorded calls of an episode again, and compare every step with its record.

Motion, physics and views are deterministic, so that an honest record comes out the same to the last bit. Neither agent
nor verifier is asked: their answers are the record's.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from functools import cache, partial
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from humanclaw import (
    Backends,
    Body,
    Call,
    Choice,
    Company,
    Episode,
    EpisodeContext,
    HumanclawError,
    Observation,
    Plugins,
    RecordedEpisode,
    Skill,
    StepRecord,
    Verdict,
    load_run,
)  # fmt: skip
from humanclaw.records import EpisodeRecord
from humanclaw.world import geodesics
from humanclaw_bench.executors import ONE_THREAD, for_children
from humanclaw_bench.two.partners import PARTNER

UNTOLD: Final = frozenset({"seconds"})
"""Fields of a step that differ from run to run."""
SAME: Final = ("scene_digest", "start", "targets", "geodesic", "movable", "ground")
"""Fields of a record that follow from its episode and from the scene."""
DECIDED: Final = ("stopped", "out_of_steps")
"""Outcomes that follow from the steps."""


@dataclass(frozen=True)
class Replayed:
    """What playing an episode again has shown."""

    episode: str
    steps: int
    """Number of steps that were compared."""
    differing: tuple[str, ...] = ()
    """The first differences from the record."""
    incomparable: str = ""
    """Why the episode, or its rest, cannot be compared here."""

    def same(self) -> bool:
        """Whether all of it came out as recorded."""
        return not (self.differing or self.incomparable)


class _Recorded:
    """A verifier that answers as recorded."""

    privileged = False

    def __init__(self, name: str, steps: Sequence[StepRecord]) -> None:
        self.name, self._left = name, iter([step.verdict for step in steps if step.verdict])

    def begin(self, context: EpisodeContext) -> None: ...

    def verify(self, observation: Observation, call: Call, skill: Skill, goal: str) -> Verdict:
        return next(self._left)


def replay(recorded: RecordedEpisode, files: Sequence[Path] = ()) -> Replayed:
    """Play an episode again in this process. files: plugin files of its run.

    The number of threads changes the last bits of a matrix product: replayed() plays with one, as runs do.
    """
    record = recorded.record
    try:
        with TemporaryDirectory() as folder:
            if record.company:
                return _together(recorded, tuple(files), Path(folder))
            with Body(record.spec.scene, **_made_of(record, tuple(files))) as body:
                return _compared(recorded, Path(folder), body)
    except HumanclawError as fault:
        return Replayed(record.spec.id, 0, incomparable=str(fault))


def _together(recorded: RecordedEpisode, files: tuple[Path, ...], folder: Path) -> Replayed:
    """Play an episode again with those of the other bodies in its scene; a partner's record is a part of its own."""
    bodies = [RecordedEpisode(recorded.folder.parent / name) for name in recorded.record.company]
    starts, record = [other.record.start for other in bodies], recorded.record
    with Company(record.spec.scene, starts, **_made_of(record, files)) as company:
        compared = company.play([partial(_compared, other, folder) for other in bodies])
    own = compared[record.company.index(record.spec.id)]
    for other, result in zip(bodies, compared, strict=True):
        if other.folder.parent == recorded.folder:
            own = replace(
                own,
                differing=(*own.differing, *(f"{PARTNER}: {what}" for what in result.differing)),
                incomparable=own.incomparable or (result.incomparable and f"{PARTNER}: {result.incomparable}"),
            )
    return own


def _made_of(record: EpisodeRecord, files: tuple[Path, ...]) -> dict[str, Any]:
    """Return plugins and backends of a record's body."""
    recorded_backends = dict(record.settings.get("body", {}))
    backends = Backends(**recorded_backends | {"sensors": tuple(recorded_backends.get("sensors", ("vision",)))})
    choice = tuple((kind, tuple(texts)) for kind, texts in record.settings.get("plugins", {}).items())
    return {"plugins": _plugins(files, choice), "backends": backends}


@cache
def _plugins(files: tuple[Path, ...], choice: tuple[tuple[str, tuple[str, ...]], ...]) -> Plugins:
    return Plugins.discover(files, Choice(**dict(choice)))


def _compared(recorded: RecordedEpisode, run: Path, body: Body) -> Replayed:
    record, steps = recorded.record, recorded.steps
    folder = run / record.spec.id
    broken = next((step.step for step in steps if step.cancelled), len(steps))
    reason = f"step {broken} was broken off in its middle" if broken < len(steps) else ""
    verifier = _Recorded(record.verifier, steps) if any(step.verdict for step in steps) else None
    # A partner's way to the target is not measured.
    distance = None if recorded.folder.name == PARTNER and record.spec.id == PARTNER else geodesics
    with Episode(body, record.spec, record.agent, verifier, folder=folder, distance=distance) as episode:
        if other := list(_other_versions(record, episode.record, steps)):
            return Replayed(record.spec.id, 0, incomparable=f"other versions are installed: {', '.join(other)}")
        for step in steps[:broken]:
            _submit(episode, step)
    differing = [f"its {name} differs" for name in SAME if getattr(record, name) != getattr(episode.record, name)]
    other_skills = (name for name in sorted(_called(steps)) if _unlike(record, episode.record, name))
    differing += [f"its skill {name} differs" for name in other_skills]
    if not reason and record.outcome in DECIDED and episode.outcome != record.outcome:
        differing.append(f"it ends as {record.outcome}; played again as {episode.outcome}")
    differing += _differences(recorded, RecordedEpisode(folder), broken)
    return Replayed(record.spec.id, broken, tuple(differing[:5]), reason)


def _submit(episode: Episode, step: StepRecord) -> None:
    """Give the recorded answers of a step, refused ones included."""
    for attempt in step.attempts:
        if not episode.done:
            episode.submit(attempt.decision, step.waited)


def _other_versions(recorded: EpisodeRecord, here: EpisodeRecord, steps: Sequence[StepRecord]) -> Iterator[str]:
    """Yield packages, weights and called skills that are not those of the record."""
    called = _called(steps)
    skills = [
        {name: info.digest for name, info in record.skills.items() if name in called} for record in (recorded, here)
    ]
    for was, now in ((recorded.weights, here.weights), (skills[0], skills[1]), (recorded.versions, here.versions)):
        known = was.keys() if was is not recorded.versions else was.keys() & now.keys()
        for name in sorted(known):
            if was[name] != now.get(name):
                yield f"{name} was {was[name][:12]}, here {now.get(name, 'missing')[:12]}"


def _called(steps: Sequence[StepRecord]) -> frozenset[str]:
    return frozenset(step.call.skill for step in steps if step.call)


def _unlike(recorded: EpisodeRecord, here: EpisodeRecord, skill: str) -> bool:
    """Whether a record declares a skill otherwise than it is: success and root causes depend on roles."""
    before, after = recorded.skills.get(skill), here.skills.get(skill)
    return before is None or after is None or (before.role, before.commands) != (after.role, after.commands)


def _differences(was: RecordedEpisode, now: RecordedEpisode, count: int) -> Iterator[str]:
    """Yield the fields, views and arrays of motion in which the first steps differ."""
    if len(now.steps) != count:
        yield f"it has {count} steps; played again {len(now.steps)}"
    for step, other in zip(was.steps[:count], now.steps, strict=False):
        for name in sorted(StepRecord.model_fields.keys() - UNTOLD):
            if getattr(step, name) != getattr(other, name):
                yield f"step {step.step}: its {name} differs"
        if was.view(step) != now.view(other):
            yield f"step {step.step}: its view differs"
    yield from _other_motion(was, now, count)


def _other_motion(was: RecordedEpisode, now: RecordedEpisode, count: int) -> Iterator[str]:
    if not (was.has_motion and now.has_motion):
        return
    whole = count == len(was.steps)
    for kind in ("generated", "simulated"):
        before, after = was.motion(kind), now.motion(kind)
        length = len(before) if whole else len(after)
        if not all(np.array_equal(getattr(before, p)[:length], getattr(after, p)) for p in ("root", "rotations")):
            yield f"its {kind} motion differs"
    if whole and not _alike(was.objects(), now.objects()):
        yield "the motion of its objects differs"


def _alike(first: Mapping[int, Any], other: Mapping[int, Any]) -> bool:
    return first.keys() == other.keys() and all(np.array_equal(first[key], other[key]) for key in first)


# -- many --------------------------------------------------------------------------------------------------------------
def replayed(episodes: Sequence[RecordedEpisode], files: Sequence[Path] = (), workers: int = 1) -> Iterator[Replayed]:
    """Play episodes again in processes of one thread each, a house at a time; yield them as they end."""
    houses: dict[str, list[Path]] = defaultdict(list)
    for episode in episodes:
        houses[episode.record.spec.scene].append(episode.folder)
    with for_children(ONE_THREAD), ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        jobs: list[Future[list[Replayed]]] = [pool.submit(_house, folders, tuple(files)) for folders in houses.values()]
        for job in as_completed(jobs):
            yield from job.result()


def sample(run: Path, count: int, seed: int | None = None) -> list[RecordedEpisode]:
    """Draw some episodes of a run, in their order; all if there are fewer.

    seed: by default a new one, because who forges records must not know which are played.
    """
    episodes = load_run(run)
    return [episodes[k] for k in sorted(np.random.default_rng(seed).permutation(len(episodes))[:count])]


def _house(folders: Sequence[Path], files: tuple[Path, ...]) -> list[Replayed]:
    return [replay(RecordedEpisode(folder), files) for folder in folders]
