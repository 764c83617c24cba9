"""A run.json for records that were written by hand, and the commands that read it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from click.testing import CliRunner, Result

from humanclaw import Plugins, load_run
from humanclaw.cli import Commands
from humanclaw_bench.cli import bench
from humanclaw_bench.verification import split_digest


def tell(run: Path, **more: Any) -> Path:
    """Write a run.json as the run of the records that lie there would have it, or as is given."""
    records = [episode.record for episode in load_run(run)]
    first, specs = records[0], [record.spec for record in records]
    manifest = {"episodes": len(specs), "split": split_digest(specs), "options": first.options}
    (run / "run.json").write_text(json.dumps(manifest | more))
    return run


def invoke(*words: object) -> Result:
    group = Commands("humanclaw", {"bench": bench}, plugins=Plugins)
    return CliRunner().invoke(group, ["bench", *map(str, words)])
