"""An episode in the hands of somebody who makes mistakes: nothing lost, nobody asked in vain, nothing mixed up."""

import pytest

from humanclaw import Call, HumanclawError
from humanclaw.episode import Episode
from humanclaw.errors import PluginRunError, RecordError, ReplayError
from humanclaw.records import Decision, RecordedEpisode
from humanclaw.tasks import free_episode

WALK = Decision((Call("walk", {"z_cm": 40}),))
STOP = Decision((Call("stop"),))


class Agent:
    """Answers what it is told to, and counts how often it was asked."""

    name = "test"
    privileged = False

    def __init__(self, answer):
        self.answer, self.asked = answer, 0

    def begin(self, context):
        pass

    def decide(self, observation, history):
        self.asked += 1
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer


@pytest.fixture
def spec(house):
    return free_episode("walk", house, max_steps=4)


@pytest.fixture
def recorded(body, spec, tmp_path):
    with Episode(body, spec, folder=tmp_path / "one") as episode:
        episode.submit(WALK)
        episode.submit(WALK)
    return RecordedEpisode(tmp_path / "one")


def test_a_replay_that_goes_another_way_leaves_the_record_as_it_was(body, recorded):
    before = {path: path.read_bytes() for path in recorded.folder.rglob("*") if path.is_file()}
    other = recorded.steps[0].model_copy(update={"end": (9.0, 9.0, 9.0)})
    with pytest.raises(ReplayError, match="now ends at"):
        Episode(body, recorded.record.spec, folder=recorded.folder, replay=[other])
    assert {path: path.read_bytes() for path in recorded.folder.rglob("*") if path.is_file()} == before


def test_a_replay_of_all_steps_writes_the_same_record_again(body, recorded):
    with Episode(body, recorded.record.spec, folder=recorded.folder, replay=recorded.steps) as episode:
        assert len(episode.steps) == 2
    assert RecordedEpisode(recorded.folder).digest == recorded.digest


def test_an_agent_of_an_episode_that_has_ended_is_not_asked_again(body, spec):
    agent = Agent(ValueError("a bug"))
    episode = Episode(body, spec, agent)
    with pytest.raises(PluginRunError):
        episode.ask()
    with pytest.raises(HumanclawError, match=r"has ended \(plugin error\)"):
        episode.ask()
    assert agent.asked == 1


def test_an_answer_that_is_no_decision_is_its_plugins_error(body, spec):
    episode = Episode(body, spec, Agent(None))
    with pytest.raises(PluginRunError, match="returned None and no Decision"):
        episode.ask()
    assert episode.outcome == "plugin_error"


def test_an_episode_whose_body_has_begun_another_one_takes_no_decision(body, spec):
    first, second = Episode(body, spec), Episode(body, spec)
    with pytest.raises(HumanclawError, match="put elsewhere"):
        first.submit(WALK)
    assert first.steps == ()
    assert second.submit(WALK).status == "executed"


def test_an_end_for_which_there_was_no_room_is_written_once_there_is(body, spec, tmp_path):
    episode = Episode(body, spec, folder=tmp_path / "full")
    episode.submit(WALK)
    (tmp_path / "full" / "motion.npz").mkdir()
    with pytest.raises(RecordError, match="cannot write the record"):
        episode.close()
    assert episode.outcome == "running"
    (tmp_path / "full" / "motion.npz").rmdir()
    episode.close()
    assert RecordedEpisode(tmp_path / "full").record.outcome == episode.outcome == "interrupted"


def test_an_episode_that_was_stopped_from_outside_says_so(body, spec):
    episode = Episode(body, spec)
    episode.stop()
    with pytest.raises(HumanclawError, match="stopped from outside"):
        episode.submit(STOP)
