"""How `humanclaw check` uses an item of the benchmark's hooks once."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from numbers import Real
from pathlib import Path

from humanclaw import Call, Decision, Episode, Keyframes, Plugins, RecordedEpisode, skill
from humanclaw.records import free_episode
from humanclaw.testing import fake_body
from humanclaw_bench.scoring import refuse_taken_name


@skill()
def nod() -> Keyframes:
    """Nod the head to agree."""
    return Keyframes.cycle("head", "x", 20, 0.5)


def use_metric(metric: Callable[[RecordedEpisode], object], plugins: Plugins) -> None:
    """Give a metric the record of an episode of one step.

    Raises TypeError if it returns no number, PluginError if its name is one of the benchmark's own.
    """
    for item in plugins.registered("metrics"):
        if item.value is metric:
            refuse_taken_name(item.name, item.owner)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "check"
        with fake_body(nod) as body:
            task = free_episode("nod", body.scene, max_steps=2)
            with Episode(body, task, "check", folder=path) as episode:
                episode.submit(Decision((Call("nod"),)))
        value = metric(RecordedEpisode(path))
    if not isinstance(value, Real):
        raise TypeError(f"it returned {value!r} and no number")
