"""Markdown tables, and reports as JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from humanclaw.storage import write_atomically


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


Row = dict[str, Any]
"""Text or numbers by the heading of their column, which names the unit."""


def rows_table(rows: Sequence[Row]) -> str:
    """Return rows of the same columns as a Markdown table, numbers with about three digits."""
    return table(tuple(rows[0]), [[_short(value) for value in row.values()] for row in rows])


def _short(value: object) -> str:
    if not isinstance(value, float):
        return str(value)
    return cell(value, 0 if abs(value) >= 100 else 1 if abs(value) >= 10 else 2)


def cell(value: float, digits: int = 1) -> str:
    """Format a number; a dash for NaN."""
    return f"{value:.{digits}f}" if np.isfinite(value) else "-"


def save(path: Path, content: Mapping[str, object]) -> None:
    """Write a report as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, (as_json(content) + "\n").encode())


def as_json(content: object) -> str:
    """Return a report as JSON."""
    return json.dumps(_plain(content), indent=1)


def _plain(value: object) -> object:
    """Turn values into plain JSON, with six digits, and null for NaN, which JSON lacks."""
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, Mapping):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    if isinstance(value, float):
        return float(f"{value:.6g}") if np.isfinite(value) else None
    return value


def numbers(content: Mapping[str, Any]) -> dict[str, Any]:
    """Turn null back into NaN."""
    return {key: float("nan") if value is None else value for key, value in content.items()}
