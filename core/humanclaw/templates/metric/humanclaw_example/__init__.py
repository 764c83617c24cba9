"""DESCRIPTION"""

from __future__ import annotations

from math import dist, nan
from typing import TYPE_CHECKING, Any

from humanclaw import hookimpl

if TYPE_CHECKING:
    from humanclaw import RecordedEpisode
    from humanclaw.hookspecs import Register

__version__ = "0.1.0"


def example(episode: RecordedEpisode) -> float:
    """Return the mean way of the hips in an executed step, metres; NaN where none was executed."""
    ways = [dist(step.start, step.end) for step in episode.steps if step.status == "executed"]
    return sum(ways) / len(ways) if ways else nan


@hookimpl(optionalhook=True)
def humanclaw_metrics(register: Register[Any]) -> None:
    register("example", example, "mean way of the hips in an executed step, metres")
