"""The comparison of two runs as a table, and its verdict in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.box import SIMPLE_HEAD
from rich.table import Table

from humanclaw.cli import counted
from humanclaw_bench.metrics import Column, Metric
from humanclaw_bench.statistics import SIGNIFICANT, Difference, Estimate
from humanclaw_bench.tables import TELLING, inline


def compare_table(differences: Mapping[str, Difference], metrics: Sequence[Metric], a: str, b: str) -> Table:
    """Return a table: for each metric both values, the difference with its interval, p, and a verdict."""
    caption = (
        f"{bearing(differences, metrics)} p: the runs are swapped house by house, exactly for rates (McNemar's test if "
        "each house has one episode), at random for the rest; corrected (Holm) for FindSR, ArriveSR and InteractSR, "
        f"and separately for the other metrics. Noise: p is {SIGNIFICANT} or more, and the interval contains 0 and "
        f"excludes {100 * TELLING:.0f} points (if not a share, {TELLING:.0%} of the mean of both) either way. Too few "
        "to tell: p is as large, and the interval contains 0 and is wider, or this test cannot give less than "
        f"{SIGNIFICANT}. "
        "Not significant: p is as large although the interval excludes 0. "
        "The same: no episode differs."
    )
    grid = Table(
        title=f"A: {a}\nB: {b}", title_justify="left", caption=caption, caption_justify="left", box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0), show_edge=False, pad_edge=False,
    )  # fmt: skip
    for title in ("metric", "A", "B", "B \u2212 A", "p", ""):
        grid.add_column(title, justify="left" if title in ("metric", "") else "right", no_wrap=True)
    for metric in metrics:
        if metric.name in differences:
            cells = compared(metric, differences[metric.name])
            grid.add_row(*(cell.replace(" [", "\n[") for cell in cells))  # Intervals below their value save width.
    return grid


def bearing(differences: Mapping[str, Difference], metrics: Sequence[Metric]) -> str:
    """Return a sentence on the number of compared episodes, and on the metrics that cover fewer."""
    count = max((found.count for found in differences.values()), default=0)
    fewer: dict[int, list[str]] = {}
    for metric in metrics:
        if metric.name in differences and differences[metric.name].count < count:
            fewer.setdefault(differences[metric.name].count, []).append(metric.name)
    told = ", ".join(f"{', '.join(names)} ({number})" for number, names in fewer.items())
    return f"Over the {counted(count, 'episode')} that both finished." + (f" Fewer count for {told}." if told else "")


def compared(column: Column, found: Difference) -> tuple[str, ...]:
    """Return a row of the comparison: metric, both values, the difference with its interval, p, and a verdict."""
    change = Estimate(found.value, found.low, found.high, found.count)
    sign = "+" if found.value > 0 else ""
    values = (column.number(found.a), column.number(found.b), f"{sign}{inline(column, change)}")
    p = "< 0.001" if found.p < 0.0005 else f"{found.p:.3f}"
    return (column.head, *values, p, verdict(column, found))


def verdict(column: Column, found: Difference) -> str:
    """Return the difference in words: the better run, not significant, noise, too few to tell, or the same.

    If neither direction is better, it names the run with the higher value.
    """
    if not found.significant:
        # A rate has an interval even if no episode differs: a larger split could still show a difference.
        same = found.alike and not found.high > found.low
        if found.low > 0 or found.high < 0:
            return "not significant"
        return "the same" if same else "too few to tell" if _blunt(column, found) else "noise"
    higher = "B" if found.value > 0 else "A"
    other = "A" if higher == "B" else "B"
    return {"higher": f"{higher} is better", "lower": f"{other} is better"}.get(column.better, f"{higher} is higher")


def _blunt(column: Column, found: Difference) -> bool:
    """Return whether there are too few houses to show a difference, or to exclude a relevant one."""
    room = TELLING * (1.0 if column.percent else found.level)
    return found.least >= SIGNIFICANT or not -room <= found.low <= 0.0 <= found.high <= room
