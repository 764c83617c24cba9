"""How `humanclaw check` uses an item of the benchmark's hooks once."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from numbers import Real
from pathlib import Path

from humanclaw import Call, Decision, Episode, Keyframes, RecordedEpisode, skill
from humanclaw.records import free_episode
from humanclaw.testing import fake_body


@skill()
def nod() -> Keyframes:
    """Nod the head to agree."""
    return Keyframes.cycle("head", "x", 20, 0.5)


def use_metric(metric: Callable[[RecordedEpisode], object]) -> None:
    """Give a metric the record of an episode of one step. Raises TypeError if it returns no number."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "check"
        with fake_body(nod) as body:
            task = free_episode("nod", body.scene, max_steps=2)
            with Episode(body, task, "check", folder=path) as episode:
                episode.submit(Decision((Call("nod"),)))
        value = metric(RecordedEpisode(path))
    if not isinstance(value, Real):
        raise TypeError(f"it returned {value!r} and no number")
