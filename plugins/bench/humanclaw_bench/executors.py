"""Executors play the episodes of a run: on this machine, or as a plugin does it (hook humanclaw_executors)."""

from __future__ import annotations

import faulthandler
import io
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnContext, SpawnProcess
from pathlib import Path
from typing import Any, Final

from humanclaw import EpisodeSpec, HumanclawError
from humanclaw.storage import Folder
from humanclaw_bench.worker import (
    FAILED as FAILED,
    Job as Job,
    Worker as Worker,
    WorkerReport as WorkerReport,
    pack as pack,
    unpack as unpack,
)

ONE_THREAD: Final = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)
"""Environment of workers. They share the cores, so a second thread in one takes time from another."""
DEATHS_IN_A_ROW: Final = 3
"""After so many deaths without a played episode between them, the episodes are not the reason."""


class EpisodeQueue:
    """The episodes that no worker has taken yet, by house, so that a worker rarely builds a house twice."""

    def __init__(self, specs: Iterable[EpisodeSpec], first: Iterable[EpisodeSpec] = ()) -> None:
        """Fill the queue. first: those of specs that are taken before all others, whatever their house."""
        self._houses: dict[str, deque[EpisodeSpec]] = {}
        self._entered: set[str] = set()
        self._first = deque(first)
        for spec in specs:
            if spec not in self._first:
                self.give_back(spec)

    def __len__(self) -> int:
        return len(self._first) + sum(map(len, self._houses.values()))

    def give_back(self, spec: EpisodeSpec) -> None:
        self._houses.setdefault(spec.scene, deque()).append(spec)

    def take(self, house: str = "") -> EpisodeSpec | None:
        """Take an episode in this house if there is one, else in a new house, else in the house with the most left."""
        spec = self._first.popleft() if self._first else self._next(house)
        if spec:
            self._entered.add(spec.scene)
        return spec

    def _next(self, house: str) -> EpisodeSpec | None:
        left = {name: waiting for name, waiting in self._houses.items() if waiting}
        if not left:
            return None
        if house not in left:
            fresh = [name for name in left if name not in self._entered]
            house = fresh[0] if fresh else max(left, key=lambda name: len(left[name]))
        return left[house].popleft()


@dataclass
class _WorkerProcess:
    """A worker process, as its parent sees it."""

    name: str
    process: SpawnProcess
    channel: Connection
    log: Path
    ready: bool = False
    task: EpisodeSpec | None = None
    house: str = ""
    began: float = 0.0

    @property
    def expected(self) -> bool:
        """Whether it is going to send a message."""
        return not self.ready or self.task is not None


class LocalExecutor:
    """Plays in processes of this machine. If one dies, the others continue; its output is in logs/."""

    def __init__(self, workers: int = 1) -> None:
        self._workers = workers
        self._context: SpawnContext = multiprocessing.get_context("spawn")
        # Shared memory without a lock: a killed worker or an interrupted signal handler could hold the lock forever.
        self._stopping: Any = self._context.RawValue("b", 0)

    def stop(self) -> None:
        self._stopping.value = 1

    def reports(self, job: Job, queue: EpisodeQueue, out: Path) -> Generator[WorkerReport, None, None]:
        processes = [self._spawn(job, out, f"worker-{number}") for number in range(min(self._workers, len(queue)))]
        deaths = 0
        try:
            while waiting := {worker.channel: worker for worker in processes if worker.expected}:
                for worker in [waiting[channel] for channel in wait(list(waiting)) if isinstance(channel, Connection)]:
                    try:
                        report = worker.channel.recv()
                        deaths = deaths if report is None else 0
                        worker.ready, worker.task = True, None
                    except (EOFError, ConnectionError):
                        deaths += 1
                        report = _crash_report(worker, deaths)
                        processes.remove(worker)
                        if len(queue) and not self._stopping.value:
                            processes.append(self._spawn(job, out, worker.name))
                    if report:
                        yield report
                    self._assign(worker, queue)
            _dismiss(processes)
        finally:
            for worker in processes:
                worker.process.kill()
                worker.process.join()

    def _spawn(self, job: Job, out: Path, name: str) -> _WorkerProcess:
        mine, theirs = self._context.Pipe()
        log = f"logs/{name}.log"
        process = self._context.Process(target=_serve, args=(theirs, job, out, self._stopping, name, log), name=name)
        with for_children(ONE_THREAD):
            process.start()
        theirs.close()
        return _WorkerProcess(name, process, mine, out / log)

    def _assign(self, worker: _WorkerProcess, queue: EpisodeQueue) -> None:
        alive = worker.ready and worker.process.is_alive()
        worker.task = queue.take(worker.house) if alive and not self._stopping.value else None
        if worker.task:
            worker.house, worker.began = worker.task.scene, time.perf_counter()
            worker.channel.send(worker.task)


def _crash_report(worker: _WorkerProcess, deaths: int) -> WorkerReport | None:
    """Return the failure of the episode in which a worker died; None if it had none.

    Raises HumanclawError after DEATHS_IN_A_ROW deaths.
    """
    worker.process.join()
    fate = f"{worker.name} died with {_reason(worker.process.exitcode)}; see {worker.log}"
    if deaths >= DEATHS_IN_A_ROW:
        raise HumanclawError(f"{deaths} workers died in a row. The last: {fate}.", "Fix the error in that log.")
    if worker.task is None:
        return None
    return WorkerReport(
        worker.task.id, FAILED, seconds=time.perf_counter() - worker.began, error=fate, worker=worker.name
    )


def _reason(code: int | None) -> str:
    if code is None or code >= 0:
        return f"exit code {code}"
    name = signal.Signals(-code).name
    return f"{name} (out of memory?)" if name == "SIGKILL" else name


def _dismiss(processes: Iterable[_WorkerProcess]) -> None:
    for worker in processes:
        if worker.process.is_alive():
            worker.channel.send(None)
    for worker in processes:
        worker.process.join(timeout=10)


@contextmanager
def for_children(variables: Mapping[str, str]) -> Iterator[None]:
    """Set environment and signals for processes that start meanwhile. They ignore Ctrl-C: the parent handles it."""
    before = {key: os.environ.get(key) for key in variables}
    os.environ.update(variables)
    main = threading.current_thread() is threading.main_thread()
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN) if main else None
    try:
        yield
    finally:
        if main:
            signal.signal(signal.SIGINT, handler)
        for key, value in before.items():
            os.environ.pop(key) if value is None else os.environ.__setitem__(key, value)


# -- inside a worker ---------------------------------------------------------------------------------------------------
def _serve(channel: Connection, job: Job, out: Path, stopping: Any, name: str, log: str) -> None:
    """Play the episodes that come through the channel, in a worker process, until None comes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_die_with_parent, daemon=True).start()
    _write_to(Folder(out), log)
    with Worker(job, out, lambda: bool(stopping.value), name) as worker:
        channel.send(None)
        for spec in iter(channel.recv, None):
            channel.send(worker.play(spec))


def _die_with_parent() -> None:
    """Exit when the parent dies: somebody may resume the run at once, and two writers would damage it."""
    parent: Any = multiprocessing.parent_process()
    parent.join()
    os._exit(1)


def _write_to(folder: Folder, log: str) -> None:
    """Send all output of this process to a file, including messages of libraries and tracebacks of crashes."""
    stream = io.TextIOWrapper(io.BufferedWriter(folder.append(log)), "utf-8", line_buffering=True)
    for standard in (1, 2):
        os.dup2(stream.fileno(), standard)
    sys.stdout = sys.stderr = stream
    faulthandler.enable(stream)
