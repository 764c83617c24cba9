"""`humanclaw assets`: import furniture that others made."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import click
from rich.table import Table
from tqdm import tqdm

from humanclaw import HumanclawError
from humanclaw.cli import Console, counted
from humanclaw_houses.asset_import import TRIANGLES, ImportReport, import_assets, listed_in
from humanclaw_houses.importers import open_collection
from humanclaw_houses.importers.folder import COLUMNS, FolderMetadata
from humanclaw_houses.library import Library


@click.group()
def assets() -> None:
    """Libraries of furniture for houses."""


@assets.command("import")
@click.argument("source", type=click.Path(path_type=Path))
@click.option("--out", "library", required=True, type=click.Path(path_type=Path), help="Folder of the library.")
@click.option("--name", default="", help="Name of the collection (default: the name of its file or folder).")
@click.option(
    "--triangles", default=TRIANGLES, show_default=True, type=click.IntRange(50), help="Maximum of triangles per asset."
)
@click.option("--table", type=click.Path(path_type=Path), help=f"For a folder of models: a CSV file with {COLUMNS}.")
@click.option("--licence", default="", help="For a folder of models: their licence, an SPDX name such as CC0-1.0.")
@click.option("--author", default="", help="For a folder of models: their author.")
@click.option("--front", default="+z", show_default=True, type=click.Choice(["+z", "-z", "+x", "-x"]),
              help="For a folder of models: direction of the front, where the mesh does not show it.")  # fmt: skip
@click.option(
    "--only",
    type=click.Path(path_type=Path, exists=True, dir_okay=False),
    help="File with the ids of the targets to import, one per line. All other furniture is imported anyway.",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def import_(
    source: Path, library: Path, name: str, triangles: int, table: Path | None, licence: str, author: str, front: str,
    only: Path | None, as_json: bool,
) -> None:  # fmt: skip
    """Import furniture into a library: a Sweet Home 3D library (.sh3f) or a folder of GLB or OBJ models.

    Importing the same source again changes nothing. Importing another source into the same library adds to it.
    """
    total, listed = ImportReport(), listed_in(only) if only else None
    for collection in open_collection(source, name, FolderMetadata(licence, author, front, table)):
        with tqdm(collection.models, desc=collection.name, unit="model", leave=False) as bar:
            _add(total, import_assets(collection, library, triangles, bar, listed))
    if as_json:
        click.echo(json.dumps(vars(total), indent=2, ensure_ascii=False))
    else:
        _tell(total, Console(markup=False, emoji=False), library)
        _tell_listed(total, only)
    if not total.imported:
        raise HumanclawError(
            "nothing was imported.", "No model has a known category and is usable; see the reasons above."
        )


@assets.command("list")
@click.argument("library", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print JSON, with triangles and hulls.")
def list_(library: Path, as_json: bool) -> None:
    """List the assets of a library with their licences."""
    entries = Library(library).entries
    if as_json:
        click.echo(json.dumps([e.model_dump(mode="json") for e in entries], indent=2, ensure_ascii=False))
        return
    table = Table("asset", "category", "size (m)", "seat", "licence", "author", box=None, pad_edge=False)
    for e in entries:
        size = " x ".join(f"{value:.2f}" for value in e.size)
        seat = f"{e.seat_height:.2f}" if e.seat_height else ""
        table.add_row(e.id, e.category, size, seat, e.licence, e.author)
    Console(markup=False, emoji=False).print(table)


def _add(total: ImportReport, report: ImportReport) -> None:
    total.imported += report.imported
    total.other += report.other
    total.rejected |= report.rejected
    total.unlisted += report.unlisted
    total.missing += report.missing
    for field in ("unchanged", "passed_over", "triangles", "hulls"):
        setattr(total, field, getattr(total, field) + getattr(report, field))


def _tell(report: ImportReport, console: Console, library: Path) -> None:
    table = Table("category", "assets")
    for category, count in sorted(report.imported.items()):
        table.add_row(category, str(count))
    count = report.imported.total()
    table.add_section()
    table.add_row("all", str(count))
    console.print(table)
    for name, reason in report.rejected.items():
        console.print(f"rejected: {name}: {reason}", highlight=False, markup=False)
    if report.other:
        console.print(f"left out, of no category: {report.other.total()} ({_some(report.other)})", highlight=False)
    if report.passed_over:
        console.print(f"left out, doors, windows and stairs: {report.passed_over}", highlight=False)
    console.print(
        f"{library}: {counted(count, 'asset')} from this source ({report.unchanged} unchanged), "
        f"{report.triangles} triangles, "
        f"{report.hulls} hulls, {len(report.rejected)} rejected.", highlight=False,
    )  # fmt: skip


def _tell_listed(report: ImportReport, only: Path | None) -> None:
    if only and report.unlisted:
        click.echo(f"left out, not in {only.name}: {len(report.unlisted)} ({', '.join(sorted(report.unlisted))})")
    if only and report.missing:
        click.echo(f"in {only.name} and not in this source: {', '.join(report.missing)}", err=True)


def _some(names: Counter[str]) -> str:
    first = [name for name, _ in names.most_common(6)]
    return ", ".join(first) + (", ..." if len(names) > len(first) else "")
