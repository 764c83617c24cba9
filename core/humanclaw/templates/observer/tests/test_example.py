"""The observer writes what it saw, and keeps nothing of it."""

import humanclaw_example
from humanclaw import Call, EpisodeRecord, EpisodeSpec, Plugins, StepRecord
from humanclaw.pose import Pose2D

SPEC = EpisodeSpec(id="one", instruction="find a couch", scene="house:0")
EPISODE = EpisodeRecord(spec=SPEC, start=Pose2D(0, 0, 0), agent="somebody", scene_digest="")
STEP = StepRecord(step=0, status="executed", attempts=(), call=Call("amble", {"z_cm": 40}), end=(0.0, 0.9, 0.4))


def test_each_step_is_a_line(tmp_path):
    humanclaw_example.humanclaw_step(EPISODE, STEP)
    humanclaw_example.humanclaw_episode_end(EPISODE, tmp_path)
    lines = (tmp_path / humanclaw_example.FILE).read_text().split()
    assert lines == ["step,call,x,y,z", "0,amble(z_cm=40),0.0,0.9,0.4"]


def test_an_episode_without_a_folder_leaves_nothing_behind(tmp_path):
    humanclaw_example.humanclaw_step(EPISODE, STEP)
    humanclaw_example.humanclaw_episode_end(EPISODE, None)
    humanclaw_example.humanclaw_episode_end(EPISODE, tmp_path)
    assert (tmp_path / humanclaw_example.FILE).read_text().split() == ["step,call,x,y,z"]


def test_it_is_found_once_it_is_installed():
    assert "example" in {info.name for info in Plugins.discover().infos}
