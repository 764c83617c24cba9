"""`humanclaw report`: write the page of a run that is already recorded."""

from __future__ import annotations

from pathlib import Path

import click

from humanclaw import HumanclawError, Plugins


@click.command()
@click.argument("folder", type=click.Path(path_type=Path), metavar="RUN")
@click.option("--out", type=click.Path(path_type=Path), help="Where to write; the default is report.html in the run.")
def report(folder: Path, out: Path | None) -> None:
    """Write the page that shows a run: filmstrips, maps, calls and tables."""
    from humanclaw_report.report import write_report

    try:
        click.echo(write_report(folder, out, Plugins.discover().scene))
    except OSError as error:
        raise HumanclawError(f"cannot write the report: {error}.", "Name another file with --out.") from error
