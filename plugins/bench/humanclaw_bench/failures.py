"""`humanclaw bench failures`: where episodes fail and why, as the paper's figure 9."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import click
import numpy as np
from PIL import Image, ImageDraw

from humanclaw.cli import plugin_files
from humanclaw.storage import save_picture
from humanclaw_bench.attribution import CAUSES
from humanclaw_bench.cli import RUN
from humanclaw_bench.metrics import Column
from humanclaw_bench.results import Result
from humanclaw_bench.scoring import results_of
from humanclaw_bench.statistics import Estimate
from humanclaw_bench.tables import causes_table, funnel_table

FACULTIES: Final = {
    "perception": "#2f6fd6", "mid-level reasoning": "#8a5fc0", "body awareness": "#d6407f",
    "ego-spatial distance": "#e08a2b", "decision": "#7a6a55", "action": "#2f8f57",
    "task": "#8b919c",
}  # fmt: skip
"""Colours of the capabilities that root causes name."""
WIDE: Final = 600
"""Width of a panel, pixels."""
_LINE: Final = 28
"""Height of a row, pixels."""
NAME: Final = 220
"""Width of the names, pixels."""
GREY: Final = "#c3c7cf"
"""Colour of the paper's shares."""
SHARE: Final = Column("share", percent=True, digits=0)


@click.command()
@click.argument("runs", type=RUN, nargs=-1, required=True, metavar="RUN...")
@click.option("--out", type=click.Path(path_type=Path), default=Path("figure-9.png"), show_default=True,
              help="PNG or JPEG file.")  # fmt: skip
@click.option("--paper/--no-paper", default=True, help="Draw the paper's shares beside them, in grey.")
@plugin_files
def failures(runs: tuple[Path, ...], out: Path, paper: bool, files: tuple[Path, ...]) -> None:
    """Draw the funnel of some runs, and the root causes of their failures by stage and capability."""
    click.echo(save_picture(picture(results_of(runs, files), paper=paper), out, quality=85))


def picture(results: Sequence[Result], *, paper: bool = True) -> Image.Image:
    """Draw the funnel, then the root causes of each stage; several runs are pooled. paper: with its shares."""
    funnel, causes = funnel_table(results, paper=paper), causes_table(results, paper=paper)
    last = [row for row in funnel.rows if not row.paper][-1]
    shares = [last.cells, *(row.cells for row in funnel.rows if row.paper)]
    stages = [f"{column.name}, of {cell.count}" for column, cell in zip(funnel.columns, last.cells, strict=True)]
    panels = [_panel(f"funnel: episodes of {last.name}", [(stage, "#2f6fd6") for stage in stages], shares)]
    cells = {row.name: row.cells[-1 - paper :] for row in causes.rows}
    for stage in dict.fromkeys(cause.stage for cause in CAUSES):
        own = [cause for cause in CAUSES if cause.stage == stage]
        bars = [(cause.name, FACULTIES[cause.capability]) for cause in own]
        failed = sum(cause is not None and cause.stage == stage for result in results for cause in result.causes)
        columns = list(zip(*(cells[cause.label] for cause in own), strict=True))
        panels.append(_panel(f"{stage}: shares of {failed} failures", bars, columns))
    high = max(panel.height for panel in panels)
    sheet = Image.new("RGB", (2 * WIDE, 2 * high + _LINE), "white")
    for number, panel in enumerate(panels):
        sheet.paste(panel, (number % 2 * WIDE, number // 2 * high))
    draw, x = ImageDraw.Draw(sheet), 12.0
    for name, colour in {**FACULTIES, **({"paper": GREY} if paper else {})}.items():
        draw.rectangle((x, 2 * high + 6, x + 12, 2 * high + 18), colour)
        draw.text((x + 18, 2 * high + 12), name, "black", font_size=14, anchor="lm")
        x += 34 + draw.textlength(name, font_size=14)
    return sheet


def _panel(title: str, bars: Sequence[tuple[str, str]], shares: Sequence[Sequence[Estimate]]) -> Image.Image:
    """Draw a bar for each name and colour, and below it the paper's. shares: of the runs, then of the paper."""
    image = Image.new("RGB", (WIDE, _LINE * (len(bars) + 2)), "white")
    draw = ImageDraw.Draw(image)
    draw.text((12, _LINE / 2), title, "black", font_size=18, anchor="lm")
    for row, (name, colour) in enumerate(bars):
        y = _LINE * (row + 1.5)
        draw.text((NAME - 10, y), name, "black", font_size=15, anchor="rm")
        for number, (values, tint) in enumerate(zip(shares, (colour, GREY), strict=False)):
            share, top = values[row].value, y - 10 + 11 * number
            end = NAME + float(np.nan_to_num(share)) * (WIDE - NAME - 60)
            draw.rectangle((NAME, top, end, top + 9), tint)
            draw.text((end + 6, top + 5), _percent(share), "black", font_size=11, anchor="lm")
    return image


def _percent(share: float) -> str:
    """Write a share as the paper does: "<1%" is not "0%". Pillow's own font has no dash for a missing one."""
    return "<1%" if 0 < share < 0.005 + 1e-9 else SHARE.number(share).replace("\u2013", "-")
