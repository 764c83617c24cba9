"""Targets that move count at their current place, which every step of the record states."""

from __future__ import annotations

from pathlib import Path

import pytest
from toy_world import FILE

from humanclaw import Backends, Body, Call, Decision, Episode, EpisodeSpec, Plugins, RecordedEpisode
from humanclaw.body import Pose2D
from humanclaw.records import end_distance
from humanclaw_bench.scores import score


@pytest.fixture(scope="module")
def plugins() -> Plugins:
    return Plugins.discover([Path(FILE)])


@pytest.mark.parametrize(
    ("simulator", "x", "before", "after"), [("pushing", 6.5, True, False), ("pulling", 4.5, False, True)]
)
def test_a_pushed_target_is_reached_where_it_is(
    plugins: Plugins, tmp_path: Path, simulator: str, x: float, before: bool, after: bool
) -> None:
    """The couch's end is at x = 7.05; a walk of no length pushes it on by 2 m, or pulls it up."""
    spec = EpisodeSpec(
        id="one", instruction="find a couch", scene="toy:0", target_category="couch", target_ids=(20,),
        start=Pose2D(x=x, z=2.5, yaw=0.0), interact=False,
    )  # fmt: skip
    with (
        Body("toy:0", plugins=plugins, backends=Backends(simulator, "toy", "toy")) as body,
        Episode(body, spec, "a test", folder=tmp_path) as episode,
    ):
        assert (episode.target_distance() <= 0.2) is before
        episode.submit(Decision((Call("walk", {"z_cm": 0}),)))
        episode.submit(Decision((Call("stop"),)))
        assert episode.success is after
    recorded = RecordedEpisode(tmp_path)
    scores = score(recorded)
    assert (scores.nav, scores.geo_nav) == (after, after)
    moved = recorded.steps[0].targets[20][0][0] - recorded.record.targets[20][0][0]
    assert moved == pytest.approx(2.0 if simulator == "pushing" else -2.0)
    assert recorded.steps[1].targets == recorded.steps[0].targets
    assert end_distance(recorded) == recorded.steps[-1].target_distance
