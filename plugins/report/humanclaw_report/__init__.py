"""HumanCLAW plugin: pages and films of recorded episodes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanclaw import hookimpl

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path
    from types import ModuleType

    import click

    from humanclaw import Plugins, RecordedEpisode, Reporter
    from humanclaw.plugins import Register, ReporterFactory

__version__ = "0.1.0"


@hookimpl
def humanclaw_reports(register: Register[ReporterFactory]) -> None:
    register("page", _page, "film and one self-contained HTML page")


def _page(film: str = "mp4", renderer: str = "raster") -> Reporter:
    from humanclaw_report.page import PageReporter

    return PageReporter(film, renderer)


@hookimpl
def humanclaw_commands(cli: click.Group) -> None:
    from humanclaw.cli import LazyCommand

    for name, about in (
        ("report", "Write the page that shows a run, or several side by side."),
        ("film", "Film a recorded episode from behind the body."),
        ("watch", "Show a run in progress in a browser on this machine."),
    ):
        cli.add_command(LazyCommand(name, f"humanclaw_report.command:{name}", about))


@hookimpl
def humanclaw_hookspecs(register: Callable[[ModuleType], None]) -> None:
    from humanclaw_report import hookspecs

    register(hookspecs)


@hookimpl(optionalhook=True)
def humanclaw_run_end(
    run: Path, episodes: Sequence[RecordedEpisode], plugins: Plugins, tell: Callable[[str], None]
) -> None:
    """Write the page of a finished benchmark run."""
    from humanclaw_report.page import report_of

    tell(f"report: {report_of({run: episodes}, plugins)}")
