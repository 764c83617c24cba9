"""The gym: tasks by seed, rewards by step, and the page about it."""

import re
import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from click.testing import CliRunner
from hosting import plugin

from humanclaw import Decision, Gym, HumanclawError, Plugins, PromptSettings, load_run, opening, situation, tool_call
from humanclaw.cli import build
from humanclaw.errors import PluginRunError
from humanclaw.skills import Call, read_call
from humanclaw_bench.attribution import CAUSES

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "gym.md").read_text("utf-8")
ONE = {"houses": 1}


@pytest.fixture(scope="module")
def host():
    made = Plugins.discover()
    made.add(plugin(rewards=[("nan", lambda transition: float("nan")), ("raises", lambda transition: 1 / 0)]), "broken")
    return made


@pytest.fixture(scope="module")
def gym(host):
    with Gym("approach", options=ONE, plugins=host) as made:
        yield made


def _played(gym, seed):
    """Return what an agent is told, sees and earns on a short way."""
    turns = [gym.reset(seed), *(gym.call("walk", {"thoughts": "", "z_cm": z, "yaw_deg": 10}) for z in (60, 30))]
    return [(turn.words, turn.observation.rgb.tobytes(), turn.reward) for turn in turns]


@pytest.mark.integration
def test_gyms_that_play_at_the_same_time_play_as_each_alone(host):
    gyms = [Gym("approach", options=ONE, plugins=host) for _ in range(3)]
    alone = [_played(gym, seed) for seed, gym in enumerate(gyms)]
    with ThreadPoolExecutor(len(gyms)) as pool:
        together = list(pool.map(_played, gyms, range(len(gyms))))
    for gym in gyms:
        gym.close()
    assert together == alone
    assert alone[0] != alone[1] != alone[2]


@pytest.mark.integration
def test_the_reward_is_the_weighted_sum_of_its_parts(gym):
    gym.reset(1)
    turn = gym.call("walk", {"thoughts": "", "z_cm": 60})
    assert turn.reward == pytest.approx(0.3 * turn.rewards["progress"])
    assert set(turn.rewards) == {"success", "progress"}


@pytest.mark.integration
def test_a_conversation_opens_with_the_benchmarks_prompt(gym):
    system, user = opening(gym, gym.reset(1))
    assert gym.episode.spec.instruction in system["content"]
    assert gym.episode.spec.scene not in system["content"] + str(user["content"][:-1])
    assert [part["type"] for part in user["content"]] == ["text", "image_url"]
    parts = situation(gym, gym.call("walk", {"thoughts": "", "z_cm": 60}))
    assert "result of the last answer: Executed walk" in parts[0]["text"]
    assert "# Step 2 of 15" in parts[0]["text"]


@pytest.mark.integration
def test_a_call_that_cannot_be_read_costs_a_step_and_is_told(gym):
    gym.reset(1)
    turn = gym.call("stop", '{"thoughts": "I stop')
    assert "not valid JSON" in turn.words
    assert not turn.done, "a broken call of stop is no stop"
    text = situation(gym, turn)[0]["text"]
    assert "not valid JSON" in text
    assert "held no call" not in text, "it held one"
    assert "make exactly one skill call" in gym.submit(Decision()).words
    assert len(gym.episode.steps) == 2


@pytest.mark.integration
def test_after_the_end_nothing_is_played(gym):
    gym.reset(1)
    assert gym.call("stop", {"thoughts": ""}).done
    with pytest.raises(HumanclawError, match="the episode has ended"):
        gym.call("walk", {"thoughts": "", "z_cm": 60})
    for seed in (-1, 1.5, "3", None):
        with pytest.raises(HumanclawError, match="from 0"):
            gym.reset(seed)


@pytest.mark.parametrize("weight", [float("nan"), float("inf"), "much", None])
def test_a_weight_that_is_not_finite_is_refused_before_learning(host, weight):
    with pytest.raises(HumanclawError, match="must be a finite number"):
        Gym("approach", {"success": weight}, options=ONE, plugins=host)


@pytest.mark.integration
@pytest.mark.parametrize(("name", "reason"), [("nan", "must be a finite number"), ("raises", "ZeroDivisionError")])
def test_a_broken_reward_is_blamed_on_its_plugin(host, name, reason):
    with Gym("approach", {name: 1.0}, options=ONE, plugins=host) as gym:
        gym.reset(1)
        with pytest.raises(PluginRunError, match=f"broken raised .*{reason}"):
            gym.call("stop", {"thoughts": ""})


@pytest.mark.parametrize("brief", [True, False])
def test_a_decision_is_read_back_from_the_call_that_says_it(brief):
    call = Call("walk", {"z_cm": 40})
    said = Decision((call,), "A couch.", "I begin.", "Get to it.", "keep", "It is near.")
    name, arguments = tool_call(said, PromptSettings(brief=brief))
    words, read = read_call(name, arguments)
    assert read == call
    assert Decision((read,), **vars(words)) == said


# -- the page ----------------------------------------------------------------------------------------------------------
def _section(title):
    return re.search(rf"^## {title}\n(.*?)(?=^## |\Z)", PAGE, re.MULTILINE | re.DOTALL)[1]


def test_the_page_has_sources_rewards_and_tasks_of_causes(host):
    tasks, rewards = (
        re.findall(r"^\* `(\w+)` (?:begins|pays) ", _section(name), re.MULTILINE) for name in ("Tasks", "Rewards")
    )
    assert set(tasks) == {offer.name for offer in host.registered("tasks")}
    assert set(rewards) == {offer.name for offer in host.registered("rewards")} - {"nan", "raises"}
    rows = re.findall(r"^\* `(\w+)`: ((?:find|nav|interact): .*)$", PAGE, re.MULTILINE)
    assert {name for name, _ in rows} <= set(tasks)
    assert sorted(cause for _, causes in rows for cause in causes.split("; ")) == sorted(rule.label for rule in CAUSES)


SHORT = {
    "--train 160": "--train 4 --option houses=1", "--train 200": "--train 2 --option houses=1", "first=2000": "first=1",
    "--agent stopper": "--agent stopper --in-process",
}  # fmt: skip


@pytest.mark.integration
def test_the_tutorial_trains_something_as_written_in_a_short_form(tmp_path, monkeypatch, one_process):
    """The commands of the page, with fewer tasks in fewer houses."""
    blocks = re.findall(r"elsewhere\. tests/test_gym\.py.*?```\n(.*?)```", PAGE, re.DOTALL)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    for line in "".join(blocks).splitlines():
        for long, short in SHORT.items():
            line = line.replace(long, short)
        program, *words = shlex.split(line)
        if program == "python":
            subprocess.run([sys.executable, *words], check=True)
        else:
            done = CliRunner().invoke(build(Plugins.discover), words)
            assert done.exit_code == 0, f"{line}\n{done.output[-4000:]}"
    assert "stopper" in done.stdout
    before, after = (load_run(tmp_path / "runs" / name) for name in ("before", "after"))
    assert [episode.record.settings["agent"]["weights"] for episode in (before[0], after[0])] == ["", "weights.npz"]
    assert {episode.record.spec.scene for episode in after} == {"house:train-1"}
