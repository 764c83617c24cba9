"""What a person at the terminal sees of a run under way."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Self

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn

from humanclaw.cli import counted
from humanclaw_bench.runner import Forecast, RunStatus
from humanclaw_bench.worker import WorkerReport


class RunProgress:
    """A line an episode, and below it a bar with rate, time and money left."""

    def __init__(self, console: Console, out: Path) -> None:
        self._console, self._out = console, out
        self._bar = Progress(
            SpinnerColumn(), BarColumn(30), MofNCompleteColumn(), TextColumn("{task.description}"), console=console,
            disable=not console.is_terminal,
        )  # fmt: skip
        self._task = self._bar.add_task("starting", total=None)

    def watch(self, status: RunStatus, report: WorkerReport | None) -> None:
        """Told by run_split of each episode that ended."""
        self._bar.update(self._task, completed=status.done, total=status.total, description=_rate(status))
        if report is None:
            before = f", {status.done} of them have ended before" if status.done else ""
            self._print(
                f"{self._out}: {counted(status.total, 'episode')}{before}. Ctrl-C stops after the steps under way."
            )
            return
        why = f"  {report.error}" if report.error else ""
        steps = counted(report.steps, "step")
        line = f"{status.done:>5}/{status.total}  {report.episode:<30} {report.outcome:<13} {steps:>9} "
        left = "" if self._console.is_terminal else f"  {_rate(status)}"
        self._print(f"{line} {report.seconds:6.1f} s{left}{why}")

    def end(self, status: RunStatus) -> None:
        """Say how the run ended."""
        self._bar.stop()
        state = "stopped" if status.stopped else "ended"
        failed = f", {status.failed} broken by infrastructure" if status.failed else ""
        self._print(
            f"{state}: {status.done} of {counted(status.total, 'episode')}{failed}; "
            f"{_clock(status.seconds)}{_spent(status)}."
        )
        if status.done < status.total:
            self._print("The same command goes on from here.")

    def foresee(self, forecast: Forecast, *, ask: bool) -> bool:
        """Say what the run will take, as its pilot has shown; ask whether to go on, if a person is there."""
        said = foresight(forecast)
        if not (ask and self._console.is_terminal):
            self._print(said)
            return True
        self._bar.stop()
        on = click.confirm(f"{said} Go on?", default=True)
        self._bar.start()
        return on

    def _print(self, text: str) -> None:
        self._console.print(text, highlight=False, markup=False, emoji=False, soft_wrap=True)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()


def _rate(status: RunStatus) -> str:
    """Such as: 8.1 episodes/min, 0:11:02 left, $0.41 spent, about $3.90 to go."""
    if not status.played:
        return "starting"
    rate = f"{60 * status.played / status.seconds:.1f} episodes/min, {_clock(status.seconds_left)} left"
    return rate + (f"{_spent(status)}, about ${status.cost_left:.2f} to go" if status.cost else "")


def foresight(forecast: Forecast) -> str:
    """Such as: By 3 of its episodes the other 97 take about 5 h 50 min and $50."""
    hours, minutes = divmod(round(forecast.seconds / 60), 60)
    time = f"{hours} h {minutes} min" if hours else f"{max(1, minutes)} min"
    money = f" and ${forecast.cost:.2f}" if forecast.cost else ""
    tokens = forecast.tokens and not forecast.cost
    unknown = (
        f" No price is known of the {forecast.tokens:,} tokens so far, nor what the rest will cost." if tokens else ""
    )
    others = "the other takes" if forecast.left == 1 else f"the other {forecast.left} take"
    return f"By {forecast.episodes} of its episodes {others} about {time}{money}.{unknown}"


def _spent(status: RunStatus) -> str:
    return f", ${status.cost:.2f} spent" if status.cost else ""


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"
