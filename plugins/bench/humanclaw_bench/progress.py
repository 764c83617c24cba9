"""Show the progress of a run on the terminal."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Final, Self

import click
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn

from humanclaw.cli import Console, counted

if TYPE_CHECKING:
    from humanclaw_bench.runner import RunStatus
    from humanclaw_bench.worker import WorkerReport

_LONG: Final = 600
"""Seconds of a rest that nobody needs to be asked about."""

stop_after_option = click.option(
    "--stop-after",
    type=click.IntRange(0),
    default=10,
    show_default=True,
    help="Stop the run after N answers in a row without a usable call, or 3 provider failures in a row; 0 for never.",
)


class RunProgress:
    """A line per episode, and below them a bar with rate, remaining time and cost."""

    def __init__(self, console: Console, out: Path) -> None:
        self._console, self._out = console, out
        self._bar = Progress(
            SpinnerColumn(), BarColumn(30), MofNCompleteColumn(), TextColumn("{task.description}"), console=console,
            disable=not console.is_terminal,
        )  # fmt: skip
        self._task = self._bar.add_task("starting", total=None)

    def watch(self, status: RunStatus, report: WorkerReport | None) -> None:
        """Show an episode that ended; run_split calls this. report: None at the beginning."""
        self._bar.update(self._task, completed=status.done, total=status.total, description=_rate(status))
        if report is None:
            before = f", {status.done} of them already finished" if status.done else ""
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
        """Print how the run ended."""
        self._bar.stop()
        state = "stopped" if status.stopped else "ended"
        failed = f", {status.failed} broken by infrastructure" if status.failed else ""
        self._print(
            f"{state}: {status.done} of {counted(status.total, 'episode')}{failed}; "
            f"{_clock(status.seconds)}{_spent(status)}."
        )
        if status.halted:
            self._print(status.halted)
        if status.done < status.total:
            self._print("The same command continues the run.")

    def foresee(self, forecast: RunStatus, *, ask: bool) -> bool:
        """Print the estimate for the rest of the run. On a terminal, ask whether to continue if that costs money or
        takes long."""
        said = foresight(forecast)
        dear = forecast.tokens or forecast.cost or forecast.seconds_left > _LONG
        if not (ask and dear and self._console.is_terminal):
            self._print(said)
            return True
        self._bar.stop()
        on = click.confirm(f"{said} Continue?", default=True)
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
    """Return the rate: "8.1 episodes/min, 0:11:02 left, $0.41 spent, about $3.90 to go"."""
    if not status.played:
        return "starting"
    rate = f"{60 * status.played / status.seconds:.1f} episodes/min, {_clock(status.seconds_left)} left"
    return rate + (f"{_spent(status)}, about ${status.cost_left:.2f} to go" if status.cost else "")


def foresight(forecast: RunStatus) -> str:
    """Return the estimate: "Estimate for the remaining 97 episodes: 5:50:00 and $50.00 (from the first 3)."."""
    money = f" and ${forecast.cost_left:.2f}" if forecast.cost else ""
    tokens = forecast.tokens and not forecast.cost
    unknown = f" The cost is unknown: the {forecast.tokens:,} tokens so far have no known price." if tokens else ""
    others = "episode" if forecast.left == 1 else f"{forecast.left} episodes"
    left = f"{_clock(forecast.seconds_left)}{money}"
    return f"Estimate for the remaining {others}: {left} (from the first {forecast.played}).{unknown}"


def _spent(status: RunStatus) -> str:
    return f", ${status.cost:.2f} spent" if status.cost else ""


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"
