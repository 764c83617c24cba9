"""Hooks through which plugins extend the benchmark.

Implement them with @hookimpl(optionalhook=True); then the plugin also works without the benchmark.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import pluggy

if TYPE_CHECKING:
    from pathlib import Path

    from humanclaw import EpisodeSpec, Plugins, RecordedEpisode
    from humanclaw.plugins import Register
    from humanclaw_bench.executors import EpisodeQueue, Job, WorkerReport
    from humanclaw_bench.own import Task

hookspec = pluggy.HookspecMarker("humanclaw")


class Fault(Protocol):
    """An agent with one missing capability, with which root causes are checked."""

    @property
    def name(self) -> str: ...

    @property
    def description(self) -> str: ...

    @property
    def capability(self) -> str:
        """The missing capability, named as in the root causes."""

    @property
    def cause(self) -> str:
        """Label of the root cause that the fault should lead to, such as "nav: stop while far"."""

    @property
    def agent(self) -> str:
        """Name of the agent with the fault. Its option `repair` names a capability whose faults are repaired."""

    @property
    def options(self) -> Mapping[str, Any]:
        """Options that give the agent this fault."""

    def fits(self, spec: EpisodeSpec) -> bool:
        """Return whether an episode can show the fault."""


class Executor(Protocol):
    """Plays episodes somewhere. A plugin registers a factory(workers: int, address: str) -> Executor.

    A humanclaw_bench.worker.Worker does the playing, so that records are the same wherever it runs.
    """

    def reports(self, job: Job, queue: EpisodeQueue, out: Path) -> Generator[WorkerReport, None, None]:
        """Play the episodes in the queue and report each once, in the order in which they end.

        The record of an episode lies in out/EPISODE, or comes in the report's files. When the iterator is closed, all
        running episodes end at once.
        """

    def stop(self) -> None:
        """Take no further episode, and end running episodes after their step. Called from a signal handler."""


class RegisterFault(Protocol):
    def __call__(self, fault: Fault) -> None:
        """Register a fault under its name."""


class RegisterTask(Protocol):
    def __call__(self, task: Task) -> None:
        """Register a task, as @task makes it, under the name of its function."""


if TYPE_CHECKING:
    ExecutorFactory: TypeAlias = Callable[[int, str], Executor]
    MetricFunction: TypeAlias = Callable[[RecordedEpisode], float]


@hookspec
def humanclaw_executors(register: Register[ExecutorFactory]) -> None:
    """Register executors, which play the episodes of a run: factory(workers: int, address: str) -> Executor.

    Executor defines them; plugins/ray is an example for a cluster.
    """


@hookspec
def humanclaw_metrics(register: Register[MetricFunction]) -> None:
    """Register metrics of an episode: function(episode: RecordedEpisode) -> float, NaN if it does not apply.

    They become columns of `humanclaw bench table --only plugins`, of scores.jsonl and of humanclaw_bench.load. Names
    that these already have, such as nav or success, are refused. The description is the unit, such as "radians".
    """


@hookspec
def humanclaw_splits(register: RegisterTask) -> None:
    """Register tasks of one's own, which humanclaw_bench.task makes of a function: `humanclaw bench run --split NAME`.

    Records name the function. Tables find it by that name, so give them the same `--plugin FILE`.
    """


@hookspec
def humanclaw_faults(register: RegisterFault) -> None:
    """Register agents with a known fault, for `humanclaw bench counterfactual`."""


@hookspec
def humanclaw_run_end(
    run: Path, episodes: Sequence[RecordedEpisode], plugins: Plugins, tell: Callable[[str], None]
) -> None:
    """React to the end of `humanclaw bench run`, when no episode is left to play; also for each run that
    `humanclaw bench leaderboard --pages` shows.

    tell: prints a line.
    """


def _use_metric(metric: MetricFunction, plugins: Plugins) -> None:
    from humanclaw_bench.plugin_check import use_metric

    use_metric(metric, plugins)


USES: Mapping[str, Callable[[Any, Plugins], None]] = {"metrics": _use_metric, "splits": _use_metric}
"""How `humanclaw check` uses an item."""
