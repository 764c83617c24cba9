"""The executor, and the actor that plays episodes on a node."""

from __future__ import annotations

import shutil
import tempfile
from collections import Counter
from collections.abc import Generator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import ray
from ray.exceptions import RayError, RayTaskError

from humanclaw import EpisodeSpec, HumanclawError
from humanclaw.storage import Folder
from humanclaw_bench.executors import FAILED, ONE_THREAD, EpisodeQueue, Job, Worker, WorkerReport, pack, unpack

LIVES: Final = 3
"""Number of actors that an episode may lose, and of actors that may die in a row before one reports an episode."""
LOCAL: Final = ("", "local")
"""Addresses that start a cluster on this machine."""


class Player:
    """Plays episodes in a temporary folder of its node."""

    def __init__(self, job: Job) -> None:
        self._stopping = False
        self._home = tempfile.TemporaryDirectory(prefix="humanclaw-")  # Goes when the actor ends.
        self._folder = Folder(Path(self._home.name))
        name = f"node-{ray.get_runtime_context().get_node_id()[:8]}"
        self._worker = Worker(job, self._folder.path, lambda: self._stopping, name)

    def ready(self) -> None:
        """Do nothing. The call returns once the actor has started."""

    def play(self, spec: EpisodeSpec, begun: Mapping[str, bytes]) -> WorkerReport:
        """Play an episode and return its report with all files. begun: files that an earlier run of it left."""
        folder = self._folder / spec.id
        unpack(folder, begun)
        report = self._worker.play(spec)
        files = pack(folder)
        shutil.rmtree(folder.path, ignore_errors=True)
        return replace(report, files=files)

    def stop(self) -> None:
        self._stopping = True


class RayExecutor:
    """Implements the protocol humanclaw_bench.hookspecs.Executor."""

    def __init__(self, workers: int = 1, address: str = "") -> None:
        """Choose a cluster. address: a running cluster; 'local' or empty starts one on this machine."""
        self._workers, self._address = workers, address
        self._stopping = False

    def stop(self) -> None:
        self._stopping = True

    def reports(self, job: Job, queue: EpisodeQueue, out: Path) -> Generator[WorkerReport, None, None]:
        with _connected(self._address, self._workers):
            pool = _Pool(job, out, queue)
            try:
                pool.spawn(min(self._workers, len(queue)))
                while pool.under_way or (len(queue) and not self._stopping):
                    yield from pool.reports(self._stopping)
            finally:
                pool.dismiss()


class _Pool:
    """The actors, the episode of each, and the counts of those that died."""

    def __init__(self, job: Job, out: Path, queue: EpisodeQueue) -> None:
        self._job, self._out, self._queue = job, out, queue
        # One thread, as in local workers: the number of threads changes the last bits of a matrix product.
        alike = {"env_vars": ONE_THREAD}
        self._player: Any = ray.remote(num_cpus=1, max_concurrency=2, runtime_env=alike)(Player)
        self._waiting: dict[Any, tuple[Any, EpisodeSpec | None]] = {}
        """Future to actor and episode; no episode while an actor starts, which waits for room in the cluster."""
        self._losses: Counter[str] = Counter()
        self._deaths = 0
        self._told = False

    @property
    def under_way(self) -> bool:
        return any(spec is not None for _, spec in self._waiting.values())

    def spawn(self, count: int = 1) -> None:
        for _ in range(count):
            actor = self._player.remote(self._job)
            self._waiting[actor.ready.remote()] = (actor, None)

    def reports(self, stopping: bool) -> Iterator[WorkerReport]:
        """Wait up to half a second for actors, yield their reports, and assign their next episodes."""
        if stopping and not self._told:
            self._told = True
            for actor, _ in self._waiting.values():
                actor.stop.remote()
        done, _ = ray.wait(list(self._waiting), timeout=0.5)
        for future in done:
            actor, spec = self._waiting.pop(future)
            try:
                report: WorkerReport | None = ray.get(future)
            except RayTaskError:  # Our own code failed.
                raise
            except RayError as error:
                ray.kill(actor)
                yield from self._lost(spec, error)
                continue
            if report:
                self._deaths = 0
                yield report
            self._assign(actor, spec.scene if spec else "", stopping)

    def _assign(self, actor: Any, house: str, stopping: bool) -> None:
        """Give an actor its next episode, if possible in the house that it has built."""
        spec = None if stopping else self._queue.take(house)
        if spec is None:
            actor.__ray_terminate__.remote()
            return
        self._waiting[actor.play.remote(spec, pack(Folder(self._out) / spec.id))] = (actor, spec)

    def _lost(self, spec: EpisodeSpec | None, error: RayError) -> Iterator[WorkerReport]:
        """Replace an actor that died, of which the memory monitor, a node or a lost report tells. Its episode is played
        again until it has lost LIVES actors."""
        reason = str(error).strip().splitlines()[0]
        self._deaths += 1
        # More deaths than actors: not single nodes that failed, but a fault that all actors share.
        if self._deaths > LIVES and self._deaths > len(self._waiting) + 1:
            raise HumanclawError(f"{self._deaths} actors died in a row. The last: {reason}.", "See Ray's logs.")
        self.spawn()
        if spec is None:
            return
        self._losses[spec.id] += 1
        if self._losses[spec.id] < LIVES:
            self._queue.give_back(spec)
        else:
            yield WorkerReport(spec.id, FAILED, error=f"its actor died {LIVES} times. The last: {reason}")

    def dismiss(self) -> None:
        """End the actors. One that plays does not outlive its driver."""
        for actor, _ in self._waiting.values():
            actor.__ray_terminate__.remote()


@contextmanager
def _connected(address: str, workers: int) -> Iterator[None]:
    """Connect to the cluster. A connection that already exists is used and stays open."""
    if ray.is_initialized():
        yield
        return
    where: dict[str, Any] = {"num_cpus": workers} if address in LOCAL else {"address": address}
    try:
        ray.init(**where, log_to_driver=False, include_dashboard=False if address in LOCAL else None)
    except ConnectionError as error:
        raise HumanclawError(f"there is no Ray cluster at {address}: {error}", "Start one with `ray start`.") from error
    try:
        yield
    finally:
        ray.shutdown()
