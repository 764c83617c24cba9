"""What a person at the terminal sees of an episode or a run under way."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn

from humanclaw.bench.runner import Tally
from humanclaw.bench.worker import Report
from humanclaw.hookspecs import hookimpl
from humanclaw.records import CallRecord, EpisodeRecord, StepRecord


class StepProgress:
    """Prints a line a step: the call, why, and what it took."""

    def __init__(self, console: Console, max_steps: int) -> None:
        self._console = console
        self._width = len(str(max_steps))

    @hookimpl
    def humanclaw_step(self, episode: EpisodeRecord, step: StepRecord) -> None:
        thought = step.attempts[-1].reasoning.split("\n")[0] if step.attempts else ""
        near = f"{step.target_distance:5.2f} m" if step.target_distance is not None else ""
        took = f"{sum(step.seconds.values()):4.1f} s" if step.seconds else ""
        line = f"{step.step:>{self._width}}  {_call(step.call):<44} {near:>8} {took:>7}  {thought}"
        self._console.print(line, highlight=False, markup=False, no_wrap=True, overflow="ellipsis")


def _call(call: CallRecord | None) -> str:
    if call is None:
        return "(no usable call)"
    return f"{call.skill}({', '.join(f'{key}={value}' for key, value in call.params.items())})"


def summary(record: EpisodeRecord, steps: Sequence[StepRecord]) -> str:
    """How the episode ended, in a sentence."""
    parts = [f"{record.outcome.replace('_', ' ')} after {record.steps} steps"]
    if steps and steps[-1].target_distance is not None:
        category = record.spec.target_category.replace("_", " ")
        parts.append(f"{steps[-1].target_distance:.2f} m from the nearest {category}")
    if record.spec.interact and steps:
        sat = bool(set(steps[-1].pelvis_contacts) & set(record.spec.target_ids))
        parts.append("sitting on it" if sat else "not sitting on it")
    return ", ".join(parts) + "."


class RunProgress:
    """A line an episode, and below it a bar with rate, time and money left."""

    def __init__(self, console: Console, out: Path) -> None:
        self._console, self._out = console, out
        self._bar = Progress(
            SpinnerColumn(), BarColumn(30), MofNCompleteColumn(), TextColumn("{task.description}"), console=console,
            disable=not console.is_terminal,
        )  # fmt: skip
        self._task = self._bar.add_task("starting", total=None)

    def watch(self, tally: Tally, report: Report | None) -> None:
        """Told by run_split of each episode that ended."""
        self._bar.update(self._task, completed=tally.done, total=tally.total, description=_rate(tally))
        if report is None:
            before = f", {tally.done} of them have ended before" if tally.done else ""
            self._print(f"{self._out}: {tally.total} episodes{before}. Ctrl-C stops after the steps under way.")
            return
        why = f"  {report.error}" if report.error else ""
        line = f"{tally.done:>5}/{tally.total}  {report.episode:<30} {report.outcome:<13} {report.steps:>3} steps "
        left = "" if self._console.is_terminal else f"  {_rate(tally)}"
        self._print(f"{line} {report.seconds:6.1f} s{left}{why}")

    def end(self, tally: Tally) -> None:
        """Say how the run ended."""
        self._bar.stop()
        state = "stopped" if tally.stopped else "ended"
        failed = f", {tally.failed} broken by infrastructure" if tally.failed else ""
        self._print(f"{state}: {tally.done} of {tally.total} episodes{failed}; {_clock(tally.seconds)}{_spent(tally)}.")
        if tally.done < tally.total:
            self._print("The same command goes on from here.")

    def _print(self, text: str) -> None:
        self._console.print(text, highlight=False, markup=False, soft_wrap=True)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()


def _rate(tally: Tally) -> str:
    """Such as: 8.1 episodes/min, 0:11:02 left, $0.41 spent, about $3.90 to go."""
    if not tally.played:
        return "starting"
    rate = f"{60 * tally.played / tally.seconds:.1f} episodes/min, {_clock(tally.seconds_left)} left"
    return rate + (f"{_spent(tally)}, about ${tally.cost_left:.2f} to go" if tally.cost else "")


def _spent(tally: Tally) -> str:
    return f", ${tally.cost:.2f} spent" if tally.cost else ""


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"
