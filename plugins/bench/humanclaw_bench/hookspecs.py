"""What a plugin can add to the benchmark. It implements these hooks with @hookimpl(optionalhook=True), and then also
works where the benchmark is not installed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import pluggy

if TYPE_CHECKING:
    from pathlib import Path

    from humanclaw import EpisodeSpec, Plugins, RecordedEpisode
    from humanclaw.plugins import Register
    from humanclaw_bench.executors import Executor

hookspec = pluggy.HookspecMarker("humanclaw")


class Fault(Protocol):
    """An agent with one capability missing: what root causes are checked with."""

    @property
    def name(self) -> str: ...

    @property
    def description(self) -> str: ...

    @property
    def capability(self) -> str:
        """What the agent lacks, in the word that root causes have for it."""

    @property
    def cause(self) -> str:
        """Label of the root cause that it is meant to lead to, such as "nav: stop while far"."""

    @property
    def agent(self) -> str:
        """The agent that has the fault. It also takes the option `repair`: a capability whose faults are put right."""

    @property
    def options(self) -> Mapping[str, Any]:
        """Of the agent, for it to have the fault."""

    def fits(self, spec: EpisodeSpec) -> bool:
        """Whether an episode can show it."""

    def goes_with(self, other: Any) -> bool:
        """Whether one agent can have this fault and another one at once: two capabilities are missing then."""

    def with_another(self, other: Any) -> Mapping[str, Any]:
        """Options of the agent, for it to have both; the other is one that this goes with."""


class RegisterFault(Protocol):
    def __call__(self, fault: Fault) -> None:
        """Register a fault under its name."""


if TYPE_CHECKING:
    ExecutorFactory: TypeAlias = Callable[[int, str], Executor]
    MetricFunction: TypeAlias = Callable[[RecordedEpisode], float]


@hookspec
def humanclaw_executors(register: Register[ExecutorFactory]) -> None:
    """Register executors, which play the episodes of a run somewhere: factory(workers: int, address: str) -> Executor.

    humanclaw_bench.executors tells what one does; plugins/ray is one for a cluster.
    """


@hookspec
def humanclaw_metrics(register: Register[MetricFunction]) -> None:
    """Register metrics of an episode, from its record: function(episode: RecordedEpisode) -> float, NaN if it does not
    apply.

    They are columns of `humanclaw bench table --only plugins`, of scores.jsonl and of humanclaw_bench.load. A name that
    a row of these has already, such as nav or success, is refused.
    """


@hookspec
def humanclaw_faults(register: RegisterFault) -> None:
    """Register agents with a known fault, for `humanclaw bench repair`."""


@hookspec
def humanclaw_run_end(run: Path, plugins: Plugins, tell: Callable[[str], None]) -> None:
    """Hear that `humanclaw bench run` has no more episodes to play. tell: prints a line."""
