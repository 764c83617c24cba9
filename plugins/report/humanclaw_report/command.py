"""`humanclaw report`: write the page of runs that are already recorded."""

from __future__ import annotations

from pathlib import Path

import click

from humanclaw import Plugins
from humanclaw.cli import plugin_files


@click.command()
@click.argument("runs", type=click.Path(path_type=Path), nargs=-1, required=True, metavar="RUN...")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Where to write; the default is report.html in the run, of several runs in this folder.",
)
@plugin_files
def report(runs: tuple[Path, ...], out: Path | None, files: tuple[Path, ...]) -> None:
    """Write the page that shows a run, or several side by side: tables, and every episode with its replay."""
    from humanclaw_report.report import write_report

    plugins = Plugins.discover(files)

    click.echo(
        write_report(
            runs, out, plugins.scene,
            contribute=lambda found, page: plugins.tell("humanclaw_overview", runs=found, page=page),
        )
    )  # fmt: skip
