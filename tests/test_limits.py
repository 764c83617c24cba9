"""Limits on time, tokens and money: what crosses one ends by it, says so, and is neither a decision nor a fault."""

import pytest

from humanclaw import Call, run_episode
from humanclaw.cli.options import parse_limits
from humanclaw.errors import HumanclawError, LimitError
from humanclaw.records import Decision, Meter, RecordedEpisode, Usage, Verdict, free_episode
from humanclaw.testing import ScriptedAgent

ANSWER = Usage(tokens_in=900, tokens_out=100, cost=0.25)
STEP = Decision((Call("walk", {"z_cm": 20}),), usage=ANSWER)


class Clock:
    """A clock that is set by hand, seconds."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


# -- the meter ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("unit", ["tokens", "usd"])
@pytest.mark.parametrize("scope", ["call", "episode", "run"])
def test_what_crosses_a_limit_is_noticed(scope, unit):
    meter = Meter({f"{scope}.{unit}": {"tokens": 2000, "usd": 0.5}[unit]})
    for _ in range(2):
        meter.add(ANSWER)
        meter.check()
    meter.add(ANSWER)
    with pytest.raises(LimitError, match=f"the limit {scope}.{unit} is") as reached:
        meter.check()
    assert reached.value.scope == scope


def test_a_new_episode_has_a_new_account_and_the_run_keeps_its_own():
    meter = Meter({"episode.tokens": 1500, "run.tokens": 2500})
    for _ in range(2):
        meter.begin("episode")
        meter.add(ANSWER)
        meter.check()
    assert meter.episode == ANSWER
    meter.begin("episode")
    meter.add(ANSWER)
    with pytest.raises(LimitError) as reached:
        meter.check()
    assert reached.value.scope == "run"


def test_seconds_are_those_of_the_clock():
    clock = Clock()
    meter = Meter({"episode.seconds": 10, "call.seconds": 4}, clock)
    assert meter.seconds_left() == 4
    clock.now = 8.0
    meter.begin("call")
    assert meter.seconds_left() == 2
    clock.now = 10.5
    assert meter.seconds_left() == 0
    with pytest.raises(LimitError, match=r"10\.5 seconds used; the limit episode\.seconds is 10"):
        meter.check()


def test_without_limits_nothing_is_ever_reached():
    meter = Meter()
    meter.add(Usage(10**12, 10**12, 1e9))
    meter.check()
    assert meter.seconds_left() == float("inf")


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        (["episode.dollars=1"], "there is no limit 'episode.dollars'"),
        (["usd=1"], "there is no limit 'usd'"),
        (["run.usd=0"], "takes a number above 0"),
        (["run.usd=nan"], "takes a number above 0"),
        (["run.usd"], "takes scope.unit=number"),
        (["run.usd=five"], "takes scope.unit=number"),
    ],
)
def test_a_limit_that_cannot_be_meant_is_refused(texts, words):
    with pytest.raises(HumanclawError, match=words):
        parse_limits(texts)


def test_limits_are_read_from_the_command_line():
    assert parse_limits(["run.usd=5", "call.seconds=0.5"]) == {"run.usd": 5.0, "call.seconds": 0.5}


# -- an episode --------------------------------------------------------------------------------------------------------
@pytest.fixture
def play(body, house, tmp_path):
    """play(meter, script): the record of an episode under a meter."""

    def run(meter, *script, verifier=None, name="one"):
        spec = free_episode("find a couch and sit on it", house, max_steps=4)
        run_episode(body, spec, ScriptedAgent(script), verifier, folder=tmp_path / name, meter=meter)
        return RecordedEpisode(tmp_path / name)

    return run


def test_a_limit_ends_the_episode_and_every_token_is_recorded(play):
    episode = play(Meter({"episode.tokens": 2500}), *[STEP] * 4)
    record = episode.record
    assert (record.outcome, record.limit, record.steps) == ("limit_reached", "episode", 2)
    assert "3000 tokens used; the limit episode.tokens is 2500" in record.error
    assert [step.call.skill for step in episode.steps] == ["walk", "walk"]  # No stop, and no third walk.
    assert (record.usage.tokens_in, record.usage.tokens_out, record.usage.cost) == (2700, 300, 0.75)
    assert record.settings["limits"] == {"episode.tokens": 2500}


def test_the_verifiers_answers_count_too(play):
    class RecordingVerifier:
        name = "verifier"

        def begin(self, context):
            assert context.meter is not None

        def verify(self, observation, call, skill, goal):
            return Verdict(True, usage=ANSWER)

    record = play(Meter({"episode.usd": 0.6}), *[STEP] * 4, verifier=RecordingVerifier()).record
    assert (record.outcome, record.steps, record.usage.cost) == ("limit_reached", 1, 0.75)


def test_after_the_limit_of_a_run_the_next_episode_ends_unasked(play):
    meter = Meter({"run.tokens": 1500})
    first = play(meter, *[STEP] * 4).record
    assert (first.outcome, first.limit, first.steps) == ("limit_reached", "run", 1)
    second = play(meter, *[STEP] * 4, name="two").record
    assert (second.outcome, second.limit, second.steps) == ("limit_reached", "run", 0)
    assert second.usage.tokens_in == 0


def test_an_episode_within_its_limits_ends_as_ever(play):
    record = play(Meter({"episode.tokens": 4000}), STEP, Call("stop")).record
    assert (record.outcome, record.limit, record.error) == ("stopped", "", "")
    assert record.usage.tokens_out == 100
