"""A model whose answers hold no usable call: told in every table, blamed apart, and stopped early."""

from pathlib import Path

import pytest
import toy_world
from here import Here
from rollouts import roaming, rollout, step

from humanclaw import Backends, Plugins, load_run
from humanclaw_bench.attribution import NO_CALL, also, attribute
from humanclaw_bench.runner import run_split
from humanclaw_bench.scoring import results_of
from humanclaw_bench.tables import chosen_table
from humanclaw_bench.worker import Job

TOY = Backends("toy", "toy", "toy")
PLUGIN = """
from pathlib import Path
from humanclaw import Call, Decision, hookimpl
from humanclaw.errors import ProviderError

class Scripted:
    privileged = False
    name = "talker"

    def __init__(self, options):
        self.script, self.count = Path(__file__).with_name("script").read_text(), 0

    def begin(self, context): ...

    def decide(self, observation, history):
        said = self.script[self.count % len(self.script)]
        self.count += 1
        if said == "!":
            raise ProviderError("the server is down")
        return Decision((Call("walk", {"z_cm": 30}),) if said == "c" else (), left_out=("temperature",))

@hookimpl
def humanclaw_agents(register):
    register("scripted", Scripted)
"""


@pytest.fixture
def play(tmp_path):
    """Play toy episodes with an agent that calls (c), talks (t) or has no provider (!), by turns."""
    (tmp_path / "talker.py").write_text(PLUGIN)
    files = (toy_world.FILE, str(tmp_path / "talker.py"))
    plugins = Plugins.discover(list(map(Path, files)))

    def play(script, stop_after=4, episodes=3, steps=6):
        (tmp_path / "script").write_text(script)
        job = Job("scripted", {}, backends=TOY, files=files, seed=1, stop_after=stop_after, in_process=True)
        status = run_split(toy_world.specs(episodes, steps=steps), job, Here(), tmp_path / "run", plugins=plugins)
        return status, tmp_path / "run"

    return play


def test_a_run_ends_after_answers_without_a_call(play):
    status, run = play("t", stop_after=4)
    assert (status.done, status.left) == (0, 3)
    assert "4 answers in a row held no usable call" in status.halted
    assert "--stop-after 0" in status.halted
    (record,) = [recorded.record for recorded in load_run(run)]
    note = chosen_table(results_of([run], [Path(toy_world.FILE)]), ["refused"], paper=False).notes[0]
    assert "In episodes that did not end, 3 of 3 answers held no usable call." in note
    assert (record.outcome, record.steps) == ("interrupted", 1)  # Three answers cost a step; the fourth ended it.


def test_a_stopped_run_counts_no_episode_and_continues(play):
    play("t", stop_after=4)
    status, run = play("c", stop_after=4)
    assert (status.done, status.halted) == (3, "")
    assert [recorded.steps[0].status for recorded in load_run(run)].count("invalid") == 1  # The lost step stays lost.


@pytest.mark.parametrize(("script", "stop_after"), [("tttc", 4), ("t", 0)], ids=["a call in four", "never"])
def test_a_run_goes_on(play, script, stop_after):
    assert play(script, stop_after)[0].done == 3


def test_a_run_ends_after_failures_of_the_provider(play):
    status, _ = play("!", episodes=4)
    assert (status.failed, status.left) == (3, 1)
    assert "3 episodes in a row failed for want of an answer. The last: the server is down" in status.halted


def test_refused_answers_have_a_column_and_a_note(play):
    _, run = play("ttct", stop_after=0, episodes=1)
    table = chosen_table(results_of([run], [Path(toy_world.FILE)]), ["refused"], paper=False)
    # Six steps: t t c, t t t, c, t t t, c, t t t ...: each call follows two or three refusals.
    (recorded,) = load_run(run)
    answers = [attempt for each in recorded.steps for attempt in each.attempts]
    assert table.rows[0].cells[0].value == sum(bool(each.error) for each in answers) / len(answers) > 0.5
    assert "Asked without temperature, which the model refuses." in table.notes[0]


def _lost(count):
    return [step().model_copy(update={"status": "invalid", "call": None}) for _ in range(count)]


@pytest.mark.parametrize(("lost", "label"), [(30, "call: no usable call"), (2, "find: ineffective exploration")])
def test_no_usable_call_in_half_of_the_steps_is_a_cause_of_its_own(tmp_path, lost, label):
    recorded = rollout(tmp_path, [*_lost(lost), *roaming(30)])
    cause = attribute(recorded)
    assert cause
    assert cause.label == label
    if cause is NO_CALL:
        assert "find: ineffective exploration" in [other.label for other in also(recorded, cause)]
