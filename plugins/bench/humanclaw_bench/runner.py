"""Run a split. run.json and split.jsonl hold the settings; every episode has its own folder and is run once.

A run may end at any moment, even by a crash, and be resumed: finished episodes are kept, others continue from their
last recorded step.
"""

from __future__ import annotations

import random
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Final

from filelock import FileLock, Timeout

from humanclaw import EpisodeSpec, HumanclawError, Plugins, RecordError
from humanclaw.cli import advice_after
from humanclaw.records import REPORT, EpisodeRecord, targeted, write_episodes
from humanclaw.storage import Folder, writing
from humanclaw_bench.executors import EpisodeQueue
from humanclaw_bench.hookspecs import Executor
from humanclaw_bench.required_skills import require_skills
from humanclaw_bench.scores import ended
from humanclaw_bench.settings import agree, introduced, manifest, seeded
from humanclaw_bench.verification import MANIFEST, SPLIT
from humanclaw_bench.worker import FAILED, Job, WorkerReport, mark, recorded, unpack


@dataclass(frozen=True)
class RunStatus:
    """The progress of a run."""

    total: int
    done: int
    """Number of finished episodes, including those of earlier sessions."""
    failed: int = 0
    """Number of infrastructure failures in this session; these episodes must be run again."""
    played: int = 0
    """Number of episodes that ended in this session."""
    playing: float = 0.0
    """Seconds that they took, without starting the workers."""
    workers: int = 1
    """Number of episodes under way at a time."""
    seconds: float = 0.0
    """Time since this session began."""
    cost: float = 0.0
    """US dollars that this session has spent."""
    tokens: int = 0
    stopped: bool = False
    limited: bool = False
    """Whether a limit of the run stopped it."""

    halted: str = ""
    """Why the run stopped by itself (Job.stop_after), and what to try; empty if it did not."""
    failed_in_a_row: int = 0
    """Provider failures since the last episode that ended otherwise."""

    @property
    def left(self) -> int:
        return self.total - self.done - self.failed

    @property
    def seconds_left(self) -> float:
        """Remaining seconds at the rate of this session's episodes; NaN before the first."""
        return self.left * self.playing / (self.played * self.workers) if self.played else float("nan")

    @property
    def cost_left(self) -> float:
        """Remaining US dollars at the cost of this session's episodes; NaN before the first."""
        return self.left * self.cost / self.played if self.played else float("nan")


Watcher = Callable[[RunStatus, WorkerReport | None], None]
"""Called for every episode that ended, and once at the beginning without a report."""
OWN: Final = frozenset({MANIFEST, SPLIT, "logs", "scores.jsonl", REPORT, "submission.json"})
"""Files and folders in the folder of a run that are not episodes."""
FAILURES_IN_A_ROW: Final = 3
"""Episodes in a row without a provider's answer after which a run stops. Each was asked for several times already."""
PILOT: Final = 3
"""Number of episodes from which the rest of a run is estimated, drawn beforehand: the first to end are short."""


def run_split(
    specs: Sequence[EpisodeSpec],
    job: Job,
    executor: Executor,
    out: Path,
    *,
    plugins: Plugins,
    watch: Watcher = lambda status, report: None,
    go_on: Callable[[RunStatus], bool] = lambda forecast: True,
) -> RunStatus:
    """Run the episodes that have not ended yet in out. The job's run limits hold for this session and all its workers.

    Targets that an episode without a scene digest leaves open are filled in (humanclaw.records.targeted).

    go_on: called once, as soon as the PILOT episodes have ended, with the time and cost of these alone, from which the
    rest is estimated; False stops the run.

    Raises RecordError if out holds a run with other settings or another process runs there, HumanclawError for an error
    that every episode would meet, and KeyboardInterrupt on the second SIGINT.
    """
    _check_ids(specs)
    require_skills(specs, plugins)
    scene = lru_cache(1)(plugins.scene)  # Episodes of a scene stand together, and a scene is large.
    specs = [spec if spec.scene_digest else targeted(spec, scene(spec.scene)) for spec in specs]
    job = introduced(seeded(job, out), plugins)
    settings = manifest(specs, job, plugins)
    out.mkdir(parents=True, exist_ok=True)
    with _alone(out):
        agree(out, settings)
        write_episodes(out / SPLIT, specs)
        todo = [spec for spec in specs if ended_record(Folder(out) / spec.id) is None]
        random.Random(job.seed).shuffle(todo)  # An agent that knows the split could count its episodes.
        began, status = time.perf_counter(), RunStatus(len(specs), len(specs) - len(todo))
        watch(status, None)
        pilot = _Pilot(todo[:PILOT])
        queue = EpisodeQueue(todo, pilot.specs)
        with _stops(executor) as stopped, closing(executor.reports(job, queue, out)) as reports:
            for report in reports:
                _keep(out, report)
                status = _counted(status, report, time.perf_counter() - began, len(queue))
                watch(status, report)
                if report.fatal:
                    raise HumanclawError(f"episode {report.episode} cannot be run: {report.error}")
                asked = pilot.ends_with(report) and status.left > 0
                refused = asked and not go_on(pilot.forecast(status))
                halted = halted_by(report, status, job.stop_after)
                limited = report.limit == "run" or _spent(status, job.limits)
                status = replace(status, limited=status.limited or limited, halted=status.halted or halted)
                if limited or refused or halted:
                    executor.stop()
                    stopped.set()
    return replace(status, stopped=stopped.is_set())


def halted_by(report: WorkerReport, status: RunStatus, stop_after: int) -> str:
    """Return why a run stops after this episode, and what to try; empty if it goes on."""
    if report.refusal:
        advice = advice_after(report.refusal)
        return f"{stop_after} answers in a row held no usable call. {advice} --stop-after 0 plays on."
    if stop_after and status.failed_in_a_row >= FAILURES_IN_A_ROW:
        return (
            f"{FAILURES_IN_A_ROW} episodes in a row failed for want of an answer. "
            f"The last: {report.error.rstrip('.')}. Mend that and give the same command again; --stop-after 0 plays on."
        )
    return ""


class _Pilot:
    """The first episodes of a run, with their time and cost."""

    def __init__(self, specs: Sequence[EpisodeSpec]) -> None:
        self.specs = specs
        self._awaited = {spec.id for spec in specs}
        self._ended: list[WorkerReport] = []

    def ends_with(self, report: WorkerReport) -> bool:
        """Note a played episode. Returns whether it was the last of the pilot and at least one of them ended."""
        if report.episode not in self._awaited:
            return False
        self._awaited.discard(report.episode)
        if ended(report.outcome, report.limit):
            self._ended.append(report)
        return bool(self._ended) and not self._awaited

    def forecast(self, status: RunStatus) -> RunStatus:
        """Return a status that estimates the rest: every remaining episode takes as much as the pilot's on average."""
        seconds, cost = (sum(getattr(report, what) for report in self._ended) for what in ("seconds", "cost"))
        return replace(status, played=len(self._ended), playing=seconds, cost=cost)


def _check_ids(specs: Sequence[EpisodeSpec]) -> None:
    """Raise HumanclawError unless each episode gets its own folder, even on file systems that ignore case."""
    counted = Counter(spec.id.lower() for spec in specs)
    if twice := [name for name, count in counted.items() if count > 1]:
        raise HumanclawError(f"the split holds episode {twice[0]!r} twice.", "Give every episode a unique id.")
    if taken := sorted(counted.keys() & OWN):
        raise HumanclawError(f"episode {taken[0]!r} has the name of one of the run's own files.", "Give it another id.")


def ended_record(folder: Folder) -> EpisodeRecord | None:
    """Return the record of an episode that ended, by itself or by a limit that it would reach again.

    None for any other episode, and for a damaged record.
    """
    try:
        episode = recorded(folder)
    except RecordError:
        return None  # The worker that plays it again logs the reason.
    return episode.record if episode and ended(episode.record.outcome, episode.record.limit) else None


def _spent(status: RunStatus, limits: Mapping[str, float]) -> bool:
    used = {"run.usd": status.cost, "run.tokens": status.tokens, "run.seconds": status.seconds}
    return any(amount >= limits.get(name, float("inf")) for name, amount in used.items())


def _counted(status: RunStatus, report: WorkerReport, seconds: float, waiting: int) -> RunStatus:
    """Add a report. seconds: since the session began; waiting: number of episodes that no worker has taken."""
    done, failed = ended(report.outcome, report.limit), report.outcome == FAILED
    return replace(
        status, done=status.done + done, failed=status.failed + failed,
        failed_in_a_row=status.failed_in_a_row + 1 if failed else 0, played=status.played + done,
        seconds=seconds, cost=status.cost + report.cost,
        tokens=status.tokens + report.tokens, playing=status.playing + done * report.seconds,
        workers=max(status.workers, status.left - waiting),
    )  # fmt: skip


def _keep(out: Path, report: WorkerReport) -> None:
    """Store a report: its files, or the failure of a worker that died."""
    record = Folder(out) / report.episode
    unpack(record, report.files)
    if report.outcome == FAILED:
        mark(record, FAILED, report.error)


# -- lock and signals --------------------------------------------------------------------------------------------------
@contextmanager
def _alone(out: Path) -> Iterator[None]:
    """Hold the folder's lock. The system frees it when this process ends, even by a crash."""
    with writing(out):
        Folder(out).append(".lock").close()  # FileLock itself would follow a link.
    lock = FileLock(out / ".lock", timeout=0)
    try:
        lock.acquire()
    except Timeout:
        raise RecordError(f"another run is writing to {out}.", "Wait for it, or name another folder.") from None
    try:
        yield
    finally:
        lock.release()


@contextmanager
def _stops(executor: Executor) -> Iterator[threading.Event]:
    """Stop the run after the current steps on the first SIGINT or SIGTERM, and at once on the second."""
    stopped = threading.Event()

    def handle(number: int, frame: object) -> None:
        if stopped.is_set():
            raise KeyboardInterrupt
        stopped.set()
        executor.stop()

    if threading.current_thread() is not threading.main_thread():
        yield stopped
        return
    before = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stopped
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
