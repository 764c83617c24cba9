"""What plays the episodes of a run, wherever it runs: in a process of this machine or on a node of a cluster."""

from __future__ import annotations

import contextlib
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, Self

from humanclaw import (
    Backends,
    Body,
    Choice,
    Episode,
    EpisodeSpec,
    HumanclawError,
    Meter,
    Plugins,
    RecordedEpisode,
    RecordError,
    ReplayError,
    StepRecord,
)
from humanclaw.records import Outcome, Usage, close_record, writing
from humanclaw.storage import within, write_atomically
from humanclaw.world import geodesics

FAILED: Final = "infra_error"


@dataclass(frozen=True)
class Job:
    """What is the same for every episode of a run: plain values, which can be sent anywhere."""

    agent: str
    options: Mapping[str, Any] = field(default_factory=dict)
    verifier: str = ""
    """Empty for none."""
    backends: Backends = field(default_factory=Backends)
    limits: Mapping[str, float] = field(default_factory=dict)
    """As humanclaw.limits has them. Those of a run hold for one session."""
    files: tuple[str, ...] = ()
    """Plugin files to load besides what is installed."""
    choice: Choice = field(default_factory=Choice)
    """Of plugins and skills."""
    names: Mapping[str, str] = field(default_factory=dict)
    """What agent and verifier call themselves, for where they cannot be made ("agents", "verifiers")."""


@dataclass(frozen=True)
class WorkerReport:
    """An episode has ended, or its worker has."""

    episode: str
    outcome: Outcome
    limit: str = ""
    """Whose limit was reached, if one was."""
    steps: int = 0
    """Steps of the episode, those of an earlier session included."""
    seconds: float = 0.0
    cost: float = 0.0
    """US dollars that this session has spent on it."""
    tokens: int = 0
    error: str = ""
    fatal: bool = False
    """Whether the error is one that the user has to mend, and every other episode would meet."""
    worker: str = ""
    files: Mapping[str, bytes] = field(default_factory=dict)
    """The record by path in its folder, from a worker that does not write where the run is."""


class Worker:
    """Plays one episode after another; a house that it has just played in is not built again."""

    def __init__(
        self, job: Job, out: Path, stopping: Callable[[], bool] = lambda: False, name: str = "", *, plugins: Any = None
    ) -> None:
        """out: the folder of the run. stopping: asked after each step; when true, the episode is broken off there."""
        self._job, self._out, self._name = job, out, name
        self._plugins: Plugins = plugins or Plugins.discover([Path(file) for file in job.files], job.choice)
        self._stopping = stopping
        self._meter = Meter(job.limits)
        self._body: Body | None = None
        self._episode: Episode | None = None
        self._replayed = Usage()
        """What the steps took that were played in an earlier session."""

    def play(self, spec: EpisodeSpec) -> WorkerReport:
        """Play an episode, or what is left of it. Never raises: what went wrong is in the report."""
        self._episode, self._replayed = None, Usage()
        began = time.perf_counter()
        error, fatal = "", False
        try:
            self._play(spec)
        except KeyboardInterrupt:
            pass  # Whoever decides has had enough: the record says so.
        except HumanclawError as fault:
            error, fatal = str(fault), True
        except BaseException as fault:  # A plugin that exits takes no other episode with it.
            error = f"{type(fault).__name__}: {fault}"
            self._clean_up(spec, error)
        return self._report(spec, time.perf_counter() - began, error, fatal)

    def _clean_up(self, spec: EpisodeSpec, error: str) -> None:
        """Mark the record and put the body away, as far as what has broken allows."""
        with contextlib.suppress(Exception):
            traceback.print_exc()
        for tidy in (partial(mark, self._out / spec.id, FAILED, error), self.close):
            with contextlib.suppress(BaseException):
                tidy()

    def _play(self, spec: EpisodeSpec) -> None:
        folder = self._out / spec.id
        try:
            replay = recorded_steps(folder)
        except RecordError as fault:
            print(f"{fault.message} It is begun anew.", flush=True)
            replay = ()
        try:
            self._episode = self._begun(spec, folder, replay)
        except ReplayError as fault:  # Of the replay alone: what a plugin raises is its own error.
            print(f"{fault} It is begun anew.", flush=True)
            self._episode = self._begun(spec, folder, ())
        with self._episode as episode:
            while not (episode.done or self._stopping()):
                episode.ask()
        if episode.fault:
            traceback.print_exception(episode.fault)

    def _begun(self, spec: EpisodeSpec, folder: Path, replay: tuple[StepRecord, ...]) -> Episode:
        """Begin an episode, or take it up again. Raises ReplayError if the world no longer does what was recorded."""
        job, plugins = self._job, self._plugins
        body = self._body = self._body or Body(spec.scene, plugins=plugins, backends=job.backends)
        agent, verifier = self._made("agents", job.agent), self._made("verifiers", job.verifier)
        self._replayed = sum((step.usage for step in replay), Usage())
        return Episode(
            body, spec, agent, verifier, folder=folder, options=job.options, distance=geodesics, replay=replay,
            meter=self._meter,
        )  # fmt: skip

    def _made(self, kind: str, name: str) -> Any:
        """Make an agent or a verifier, None if it has no name; where that fails, the record has the name that the run
        knows it by."""
        return self._plugins.decider(kind, name, self._job.options, self._job.names.get(kind, "")) if name else None

    def _report(self, spec: EpisodeSpec, seconds: float, error: str, fatal: bool) -> WorkerReport:
        report = WorkerReport(spec.id, FAILED, seconds=round(seconds, 3), error=error, fatal=fatal, worker=self._name)
        if self._episode is None:
            return report
        end, before = self._episode.record, self._replayed
        if not error or end.outcome == "plugin_error":
            report = replace(report, outcome=end.outcome, error=end.error)
        cost = end.usage.cost - before.cost
        tokens = end.usage.tokens_in + end.usage.tokens_out - before.tokens_in - before.tokens_out
        return replace(report, limit=end.limit, steps=end.steps, cost=cost, tokens=tokens)

    def close(self) -> None:
        body, self._body = self._body, None
        if body is not None:
            body.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def recorded_steps(folder: Path) -> tuple[StepRecord, ...]:
    """Return the steps of an episode that an earlier session left behind, if any. Raises RecordError if they are
    damaged."""
    found = recorded(folder)
    return found.steps if found else ()


def recorded(folder: Path) -> RecordedEpisode | None:
    """Return the record of an episode, in the folder of its name; None if there is none. Raises RecordError if it is
    damaged."""
    if not (folder / "episode.json").exists():
        return None
    found = RecordedEpisode(folder)
    if found.record.spec.id != folder.name:
        raise RecordError(f"{folder} holds the record of {found.record.spec.id!r}.", "Remove the folder.")
    return found


def mark(folder: Path, outcome: Outcome, error: str) -> None:
    """Write into the record of an episode how it ended, where nobody else could. A damaged one is left: it is begun
    anew."""
    try:
        found = recorded(folder)
    except RecordError:
        return
    if found:
        close_record(folder, found.record.ended(outcome, error, steps=len(found.steps)))


# -- a record on its way -----------------------------------------------------------------------------------------------
def pack(folder: Path) -> dict[str, bytes]:
    """Every file of an episode's record by its path in the folder; nothing if there is none."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file() and path.suffix != ".partial")
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def unpack(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write a record; episode.json comes last, since it says that there is one.

    Raises RecordError if it cannot be written, and before anything is if a name leads out of the folder.
    """
    try:
        places = {within(folder, name): data for name, data in files.items()}
    except ValueError as error:
        raise RecordError(
            f"a worker sent a record with a file elsewhere: {error}.", "Look after that worker."
        ) from None
    with writing(folder):
        for path, data in sorted(places.items(), key=lambda item: item[0].name == "episode.json"):
            path.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(path, data)
