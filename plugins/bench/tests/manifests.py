"""A run.json for records that were written by hand."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from humanclaw import load_run
from humanclaw_bench.integrity import split_digest


def tell(run: Path, **more: Any) -> Path:
    """Write a run.json that names the episodes whose records lie there, and whatever else is given."""
    specs = [one.record.spec for one in load_run(run)]
    told = {"episodes": len(specs), "split": split_digest(specs)} | more
    (run / "run.json").write_text(json.dumps(told))
    return run
