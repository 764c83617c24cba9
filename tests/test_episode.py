"""An episode in the hands of somebody who makes mistakes: nothing lost, nobody asked in vain, nothing mixed up."""

import asyncio
import signal
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from humanclaw import Body, Call, CallError, Episode, HumanclawError, PluginError, Verdict, run_episode, skill
from humanclaw.errors import LimitError, PluginRunError, ProviderClosedError, ProviderError, RecordError, ReplayError
from humanclaw.records import Answer, Decision, RecordedEpisode, Usage, free_episode
from humanclaw.testing import fake_body

WALK = Decision((Call("walk", {"z_cm": 40}),))
STOP = Decision((Call("stop"),))
HERE = __name__.partition(".")[0]


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
        if isinstance(self.answer, BaseException):
            raise self.answer
        return self.answer


class Verifier:
    """Says what it is told to."""

    name = "judge"

    def __init__(self, says):
        self.says = says

    def begin(self, context):
        pass

    def verify(self, observation, call, skill, goal):
        if isinstance(self.says, BaseException):
            raise self.says
        return self.says


class Unspeakable:
    def __str__(self):
        raise ValueError("no words")

    __repr__ = __str__


class Unlistable(dict):
    def items(self):
        raise RuntimeError("no items")


def nested(levels):
    return {"deeper": nested(levels - 1)} if levels else {}


@pytest.fixture
def spec(house):
    return free_episode("walk", house, max_steps=4)


@pytest.fixture
def recorded(body, spec, tmp_path):
    with Episode(body, spec, folder=tmp_path / "one") as episode:
        episode.submit(WALK)
        episode.submit(WALK)
    return RecordedEpisode(tmp_path / "one")


@pytest.fixture(autouse=True)
def _a_person_can_interrupt():
    """A process in the background inherits that Ctrl-C is ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_a_record_has_the_versions_of_the_plugins_in_use(body, spec, tmp_path):
    with Episode(body, spec, folder=tmp_path / "one"):
        pass
    versions = RecordedEpisode(tmp_path / "one").record.versions
    installed = {info.origin for info in body.plugins.infos}
    assert {"humanclaw", "humanclaw-raster", "humanclaw-skill-walk"} <= versions.keys()
    assert "humanclaw-report" in installed
    assert not {"humanclaw-report", "humanclaw-litellm", "humanclaw-habitat"} & versions.keys()


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


@pytest.mark.integration
@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (Decision((Call("walk", {"z_cm": Unspeakable()}),)), "ValueError: no words"),
        (Decision((Call("walk", Unlistable(z_cm=40)),)), "RuntimeError: no items"),
        (Decision((Call("walk", [1, 2]),)), "calls.0.params: Input should be a valid dictionary; got [1, 2]"),
        (Decision((Call("stop", None),)), "calls.0.params: Input should be a valid dictionary; got None"),
        (Decision(({"skill": "walk"},)), "calls.0: Input should be an instance of Call; got {'skill': 'walk'}"),
        (Decision(None), "calls: Input should be a valid tuple; got None"),
        (replace(WALK, usage=None), "usage: Input should be an instance of Usage; got None"),
        (replace(WALK, usage={"tokens_in": 1}), "usage: Input should be an instance of Usage; got {'tokens_in': 1}"),
        (replace(WALK, usage=Usage(2.5)), "usage.tokens_in: Input should be a valid integer"),
        (replace(WALK, visible_state=None), "visible_state: Input should be a valid string; got None"),
        (replace(WALK, visible_state=7), "visible_state: Input should be a valid string; got 7"),
        (replace(WALK, raw=["couch"]), "raw: Input should be a valid string"),
    ],
)
def test_a_wrong_decision_is_its_plugins_error_and_leaves_a_record(body, spec, tmp_path, answer, message):
    record = run_episode(body, spec, Agent(answer), folder=tmp_path)
    assert (record.outcome, record.steps) == ("plugin_error", 0)
    assert record.error.startswith(f"{HERE} raised ")
    assert message in record.error
    assert RecordedEpisode(tmp_path).record.error == record.error


@pytest.mark.parametrize(
    ("says", "message"),
    [
        (None, "verify() of judge returned None and no Verdict"),
        (Verdict(False), "neither accepts nor replaces"),
        (Verdict(True, usage=None), "usage: Input should be an instance of Usage"),
        (Verdict(False, {"skill": "walk"}), "replacement: Input should be an instance of Call"),
        (Verdict(True, answers=({"check": "x"},)), "answers.0: Input should be an instance of Answer"),
        (Verdict(True, answers=(Answer("x", None),)), "answers.0.passed: Input should be a valid boolean; got None"),
        (asyncio.CancelledError(), "CancelledError"),
    ],
)
def test_a_verdict_that_is_wrong_inside_is_its_plugins_error(body, spec, tmp_path, says, message):
    record = run_episode(body, spec, Agent(WALK), Verifier(says), folder=tmp_path)
    assert record.outcome == "plugin_error"
    assert message in record.error
    assert RecordedEpisode(tmp_path).steps == ()


class Withdrawn(BaseException):
    """Of a framework that ends its tasks by raising."""


@pytest.mark.parametrize(
    "raised",
    [
        asyncio.CancelledError(),
        Withdrawn("x"),
        GeneratorExit(),
        CallError("mend it"),
        HumanclawError("I say so."),
        RecordError("no room"),
        ReplayError("again"),
        PluginRunError("another raised ValueError: x"),
    ],
    ids=lambda raised: type(raised).__name__,
)
def test_whatever_an_agent_raises_is_its_plugins_error(body, spec, tmp_path, raised):
    record = run_episode(body, spec, Agent(raised), folder=tmp_path)
    assert record.outcome == "plugin_error"
    assert record.error.startswith(f"{HERE} raised {type(raised).__name__}")


@pytest.mark.parametrize("raised", [PluginError("no key.", "Set one."), KeyboardInterrupt()])
def test_an_unusable_agent_and_a_tired_person_end_the_run(body, spec, raised):
    with pytest.raises(type(raised)), Episode(body, spec, Agent(raised)) as episode:
        episode.ask()
    assert episode.outcome == "interrupted"


def test_ctrl_c_while_an_agent_decides_interrupts_the_episode(body, spec, tmp_path):
    class Waiting(Agent):
        def decide(self, observation, history):
            signal.raise_signal(signal.SIGINT)
            return WALK

    with pytest.raises(KeyboardInterrupt):
        run_episode(body, spec, Waiting(None), folder=tmp_path)
    assert RecordedEpisode(tmp_path).record.outcome == "interrupted"


def test_an_agent_that_breaks_has_failed_the_episode_it_began(body, spec, tmp_path):
    agent = Agent(WALK)
    episode = Episode(body, spec, agent, folder=tmp_path)
    episode.ask()
    agent.answer = PluginError("no key.", "Set one.")
    with pytest.raises(PluginError):
        episode.ask()
    record = RecordedEpisode(tmp_path).record
    assert (record.outcome, record.error) == ("plugin_error", f"{HERE} raised PluginError: no key. Set one.")


def test_a_provider_that_closes_ends_the_run_and_is_no_failure(body, spec, tmp_path):
    agent = Agent(WALK)
    episode = Episode(body, spec, agent, folder=tmp_path)
    episode.ask()
    agent.answer = ProviderClosedError("no money is left.", "Top it up.")
    with pytest.raises(ProviderClosedError), episode:
        episode.ask()
    record = RecordedEpisode(tmp_path).record
    assert (record.outcome, record.error) == ("infra_error", "no money is left. Top it up.")


@pytest.mark.parametrize(
    ("agent", "verifier", "privileged"),
    [(True, False, {"agent": True, "verifier": False}), (False, True, {"agent": False, "verifier": True}),
     (False, None, {"agent": False})],
)  # fmt: skip
def test_the_record_says_who_was_told_what_only_the_scene_knows(body, spec, agent, verifier, privileged):
    heard = {}

    class Listener:
        def begin(self, context):
            heard[self.role] = context.scene is not None

    agent = type("Told", (Listener, Agent), {"role": "agent", "privileged": agent})(STOP)
    judge = verifier is not None and type("Judge", (Listener, Verifier), {"role": "verifier", "privileged": verifier})
    record = run_episode(body, spec, agent, judge(Verdict(True)) if judge else None)
    assert record.settings["privileged"] == heard == privileged


def test_who_says_later_that_it_is_privileged_is_told_no_more(body, spec):
    class Sly(Agent):
        asked_for = 0

        @property
        def privileged(self):
            self.asked_for += 1
            return self.asked_for > 1

        def begin(self, context):
            self.scene = context.scene

    agent = Sly(STOP)
    record = run_episode(body, spec, agent)
    assert (record.settings["privileged"], agent.scene) == ({"agent": False}, None)


def test_an_agent_is_told_its_task_and_nothing_that_names_the_episode(body, house):
    spec = free_episode("find a couch and sit on it", house, seed=11, max_steps=4, name="house-0-couch-2")

    class Curious(Agent):
        def begin(self, context):
            self.context = context

    for agent, verifier in ((Curious(STOP), None), (Curious(STOP), Curious(None))):
        if verifier is not None:
            verifier.verify = lambda *asked: Verdict(True)
        run_episode(body, spec, agent, verifier)
        for judge in filter(None, (agent, verifier)):
            context = judge.context
            assert context.spec.model_dump(exclude_defaults=True) == {
                "id": "episode", "instruction": "find a couch and sit on it", "scene": "", "target_category": "couch",
                "interact": True, "max_steps": 4,
            }  # fmt: skip
            assert context.seed not in (0, 11)
            assert (context.scene, context.state, context.view) == (None, None, None)
            with pytest.raises(HumanclawError):
                Body(context.spec.scene, context.spec.start, seed=context.seed, plugins=body.plugins)
    oracle = Curious(STOP)
    oracle.privileged = True
    run_episode(body, spec, oracle)
    assert (oracle.context.spec, oracle.context.seed) == (spec, 11)


def test_a_view_that_an_agent_blackens_is_the_same_to_everybody_else(body, spec):
    seen = []

    class Painter(Agent):
        privileged = True

        def begin(self, context):
            self.view = context.view

        def decide(self, observation, history):
            for picture in (observation.rgb, self.view().rgb, self.view().ids, self.view().depth):
                with pytest.raises(ValueError, match="read-only"):
                    picture[:] = 0
                with pytest.raises(ValueError, match="WRITEABLE"):
                    picture.flags.writeable = True
            return STOP

    class Witness(Verifier):
        def verify(self, observation, call, skill, goal):
            seen.append(observation.rgb.mean())
            return self.says

    record = run_episode(body, spec, Painter(None), Witness(Verdict(True)))
    assert (record.outcome, seen) == ("stopped", [body.view().rgb.mean()])


@pytest.mark.integration
def test_a_long_episode_remembers_every_view_in_little_memory(body, house):
    seen = []

    class Seer(Agent):
        def decide(self, observation, history):
            seen.append(observation.rgb)
            assert [past.step for past in history] == list(range(len(history)))
            return WALK

    with Episode(body, free_episode("walk", house, max_steps=40), Seer(None)) as episode:
        episode.ask()  # Loads the weights.
        tracemalloc.start()
        while not episode.done:
            episode.ask()
        first, last = episode.history[0], episode.history[-1]
        assert last.rgb is seen[-1]
        assert np.abs(first.rgb.astype(int) - seen[0]).mean() < 4.0
        view = seen[0].nbytes
        seen.clear()
        assert tracemalloc.get_traced_memory()[0] < 25 * view
    tracemalloc.stop()


@pytest.mark.parametrize(
    "raised",
    [ProviderError("down"), LimitError("run", "enough"), ReplayError("again"), PluginError("no key."),
     PluginRunError("another raised ValueError: x")],
    ids=lambda raised: type(raised).__name__,
)  # fmt: skip
def test_whatever_a_skill_raises_is_its_plugins_error(raised):
    @skill(checks=["Is anybody in view?"])
    def shrug(times: int = 1):
        """Shrug."""
        raise raised

    with (
        fake_body(shrug) as body,
        Episode(body, free_episode("shrug", body.scene), Agent(Decision((Call("shrug"),)))) as episode,
    ):
        episode.ask()
    assert episode.outcome == "plugin_error"
    assert episode.record.error.startswith(f"{body.plugins.owner('shrug')} raised {type(raised).__name__}")


@pytest.mark.parametrize(
    ("raised", "outcome"),
    [(ValueError("cannot parse \ud83d\x1b[2J"), "plugin_error"), (ProviderError("\ud800 503\x1b[2J"), "infra_error")],
)
def test_an_error_that_quotes_half_a_character_is_recorded(body, spec, tmp_path, raised, outcome):
    run_episode(body, spec, Agent(raised), folder=tmp_path)
    record = RecordedEpisode(tmp_path).record
    assert record.outcome == outcome
    assert "\ufffd" in record.error
    assert "\x1b" not in record.error


def test_an_agent_that_breaks_as_it_begins_leaves_a_record(body, spec, tmp_path):
    class Late(Agent):
        def begin(self, context):
            raise Withdrawn("half \ud800")

    record = run_episode(body, spec, Late(WALK), folder=tmp_path)
    assert (record.outcome, RecordedEpisode(tmp_path).record.error) == ("plugin_error", record.error)
    assert "Withdrawn: half \ufffd" in record.error


def raising(self):
    raise ValueError("not now")


@pytest.mark.parametrize(
    ("about", "message"),
    [
        ({"settings": property(raising)}, "ValueError: not now"),
        ({"settings": {"o": object()}}, "settings are a mapping that JSON can hold"),
        ({"settings": nested(300)}, "settings are a mapping that JSON can hold"),
        ({"settings": {"o": "\ud800"}}, "settings are a mapping that JSON can hold"),
        ({"settings": [1]}, "settings are a mapping that JSON can hold"),
        ({"name": property(raising)}, "ValueError: not now"),
        ({"name": None}, "name: Input should be a valid string; got None"),
        ({"name": "a\x1b[2J"}, r"name: '\x1b' is not allowed in it; got"),
    ],
)
def test_what_an_agent_says_and_no_record_holds_is_its_plugins_error(body, spec, tmp_path, about, message):
    agent = type("Odd", (Agent,), about)(WALK)
    record = run_episode(body, spec, agent, folder=tmp_path)
    assert (record.outcome, record.steps, agent.asked) == ("plugin_error", 0, 0)
    assert message in record.error
    assert RecordedEpisode(tmp_path).record.error == record.error


@pytest.mark.parametrize("role", ["agent", "verifier"])
def test_who_knows_the_true_state_is_not_taken_up_in_the_middle(body, recorded, role):
    agent, judge = Agent(STOP), Verifier(Verdict(True))
    {"agent": agent, "verifier": judge}[role].privileged = True
    with pytest.raises(ReplayError, match=f"the {role} of episode .* knows the true state"):
        Episode(body, recorded.record.spec, agent, judge, folder=recorded.folder, replay=recorded.steps)
    assert RecordedEpisode(recorded.folder).digest == recorded.digest


def test_a_wrong_decision_is_handed_back_and_nothing_is_lost(body, spec):
    episode = Episode(body, spec)
    with pytest.raises(TypeError, match="visible_state: Input should be a valid string; got None"):
        episode.submit(replace(WALK, visible_state=None))
    assert episode.submit(WALK).status == "executed"


def test_an_episode_whose_body_began_another_takes_no_decision(body, spec):
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


@pytest.mark.parametrize("count", [0, 3])
def test_an_agent_that_asks_sees_the_half_second_move(body, spec, count):
    seen = []
    agent = Agent(WALK)
    agent.settings = {"views_between": count}
    agent.decide = lambda observation, history: seen.append(observation) or WALK
    run_episode(body, spec, agent)
    assert [len(observation.between) for observation in seen] == [0, *[count] * 3]
    assert len({*seen[1].between, *seen[2].between}) == 2 * count, "no view twice"


@pytest.mark.parametrize("count", [-1, 15, 1.5, "3"])
def test_an_odd_number_of_views_is_the_agents_error(body, spec, count):
    agent = Agent(WALK)
    agent.settings = {"views_between": count}
    record = run_episode(body, spec, agent)
    assert (record.outcome, "a whole number from 0 to 14" in record.error) == ("plugin_error", True)
