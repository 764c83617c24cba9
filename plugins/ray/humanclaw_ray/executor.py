"""The executor, and the actor that plays on a node."""

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
from ray.exceptions import RayActorError

from humanclaw import EpisodeSpec, HumanclawError
from humanclaw_bench.executors import FAILED, ONE_THREAD, EpisodeQueue, Job, Worker, WorkerReport, pack, unpack

LIVES: Final = 3
"""So often an episode may lose its actor, and so many actors in a row may die before they have played anything."""
LOCAL: Final = ("", "local")


class Player:
    """Plays in a folder of its node."""

    def __init__(self, job: Job) -> None:
        self._stopping = False
        self._folder = Path(tempfile.mkdtemp(prefix="humanclaw-"))
        name = f"node-{ray.get_runtime_context().get_node_id()[:8]}"
        self._worker = Worker(job, self._folder, lambda: self._stopping, name)

    def ready(self) -> None:
        """Return once the player is there."""

    def play(self, spec: EpisodeSpec, begun: Mapping[str, bytes]) -> WorkerReport:
        """begun: what an earlier session left of the episode."""
        folder = self._folder / spec.id
        unpack(folder, begun)
        report = self._worker.play(spec)
        files = pack(folder)
        shutil.rmtree(folder, ignore_errors=True)
        return replace(report, files=files)

    def stop(self) -> None:
        self._stopping = True


class RayExecutor:
    """As humanclaw_bench.executors.Executor asks."""

    def __init__(self, workers: int = 1, address: str = "") -> None:
        """address: of a running cluster; 'local' or nothing starts one on this machine."""
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
    """The actors, what each is at, and what became of them."""

    def __init__(self, job: Job, out: Path, queue: EpisodeQueue) -> None:
        self._job, self._out, self._queue = job, out, queue
        # With the threads of local workers: the number of threads is in the last bits of a matrix product.
        alike = {"env_vars": ONE_THREAD}
        self._player: Any = ray.remote(num_cpus=1, max_concurrency=2, runtime_env=alike)(Player)
        self._waiting: dict[Any, tuple[Any, EpisodeSpec | None]] = {}
        """Future to actor and episode; none for an actor that is not there yet: a cluster may have no room for it."""
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
        """Wait a while for what the actors say, report it, and give them more to do."""
        if stopping and not self._told:
            self._told = True
            for actor, _ in self._waiting.values():
                actor.stop.remote()
        done, _ = ray.wait(list(self._waiting), timeout=0.5)
        for future in done:
            actor, spec = self._waiting.pop(future)
            try:
                report: WorkerReport | None = ray.get(future)
            except RayActorError as error:
                yield from self._lost(spec, error)
                continue
            if report:
                self._deaths = 0
                yield report
            self._assign(actor, stopping)

    def _assign(self, actor: Any, stopping: bool) -> None:
        spec = None if stopping else self._queue.take()
        if spec is None:
            ray.kill(actor)
            return
        self._waiting[actor.play.remote(spec, pack(self._out / spec.id))] = (actor, spec)

    def _lost(self, spec: EpisodeSpec | None, error: RayActorError) -> Iterator[WorkerReport]:
        """Note that an actor has died: another takes its place and, up to a limit, its episode."""
        reason = str(error).strip().splitlines()[0]
        self._deaths += 1
        if self._deaths > LIVES and self._deaths > len(self._waiting) + 1:
            raise HumanclawError(
                f"{self._deaths} actors died one after another. The last: {reason}.", "See Ray's logs."
            )
        self.spawn()
        if spec is None:
            return
        self._losses[spec.id] += 1
        if self._losses[spec.id] < LIVES:
            self._queue.give_back(spec)
        else:
            yield WorkerReport(spec.id, FAILED, error=f"its actor died {LIVES} times. The last: {reason}")

    def dismiss(self) -> None:
        for actor, _ in self._waiting.values():
            ray.kill(actor)


@contextmanager
def _connected(address: str, workers: int) -> Iterator[None]:
    """Connect to the cluster; one that is there already is used and left as it is."""
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
