"""What authors of plugins meet first: names, folders, one-line values, verdicts that mean something."""

import asyncio
import json
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from hosting import host_of

from humanclaw import Body, Episode, Keyframes, Observation, Plugins, body_tools, skill
from humanclaw.body import Pose2D
from humanclaw.checks.fakes import FakeWorld
from humanclaw.errors import PluginError
from humanclaw.records import free_episode
from humanclaw.testing import check_target, fake_body

TWO = '''
from humanclaw import Keyframes, hookimpl, skill

@skill()
def nod() -> Keyframes:
    """Nod."""
    return Keyframes.cycle("head", "x", 20, 0.5)

@skill(name="look")
def peer() -> Keyframes:
    """Look closely."""
    return Keyframes.cycle("neck", "x", 20, 0.5)

@hookimpl
def humanclaw_skills(register):
    register(nod)
    register(peer)
'''


@skill()
def nod() -> Keyframes:
    """Nod."""
    return Keyframes.cycle("head", "x", 20, 0.5)


@skill(role="stop")
def done() -> Keyframes:
    """Declare the task complete."""
    return Keyframes.cycle("head", "x", 5, 0.5)


def test_tools_move_the_body_no_more_after_a_stop_until_it_is_reset():
    with fake_body(nod, done) as body:
        tools = {tool.name: tool for tool in body_tools(body)}
        assert tools["nod"]().picture
        assert tools["done"]().picture
        assert "you have stopped" in tools["nod"]().text
        assert body.step == 2
        assert tools["look"]().picture
        body.reset(body.scene)
        assert tools["nod"]().picture


def test_an_observation_is_one_line():
    seen = Observation(3, "find the chair", np.zeros((512, 512, 3), np.uint8))
    assert repr(seen) == "Observation(step=3, 'find the chair', rgb 512 x 512 x 3, '')"


def test_a_package_in_a_folder_is_a_plugin_with_its_own_modules(tmp_path):
    folder = tmp_path / "my_nods"
    folder.mkdir()
    (folder / "skills.py").write_text(TWO.split("@hookimpl")[0])
    (folder / "__init__.py").write_text(
        "from humanclaw import hookimpl\nfrom .skills import nod\nfrom my_nods.skills import peer\n"
        "@hookimpl\ndef humanclaw_skills(register):\n    register(nod)\n"
    )
    try:
        assert "nod" in Plugins.discover([folder]).skills
        assert "nod" in Plugins.discover([folder]).skills  # Also twice in one process.
    finally:
        for name in [name for name in sys.modules if name.partition(".")[0] == "my_nods"]:
            del sys.modules[name]


def test_the_folder_of_a_distribution_stands_for_its_package(plugins, monkeypatch):
    folder = Path(__file__).parents[1] / "skills/gaze"
    assert "gaze" in Plugins.discover([folder]).skills
    monkeypatch.chdir(folder)
    assert Plugins.discover([Path(".")]).owner("gaze") == "humanclaw_skill_gaze"
    monkeypatch.chdir("humanclaw_skill_gaze")
    assert Plugins.discover([Path(".")]).owner("gaze") == "humanclaw_skill_gaze"
    assert [report.passed for report in check_target(str(folder), plugins, engines=())] == [True]


def test_a_folder_without_a_package_is_refused(tmp_path):
    with pytest.raises(PluginError, match=r"there is no plugin file .*__init__\.py"):
        Plugins.discover([tmp_path])


@pytest.mark.parametrize(
    ("wrong", "right"),
    [("skill", "skills"), ("sim", "simulators"), ("agent", "agents"), ("on_step", "step"), ("scene", "scenes"),
     ("renderer", "renderers"), ("report", "reports"), ("episode_ended", "episode_end"),
     ("generators", "motion_generators")],
)  # fmt: skip
def test_a_misspelt_hook_is_matched_to_the_right_one(wrong, right):
    with pytest.raises(PluginError, match=rf"Did you mean humanclaw_{right}\?"):
        host_of("odd", **{wrong: []})


@pytest.mark.integration
@pytest.mark.parametrize("package", ["humanclaw", "humanclaw.skills", "humanclaw.testing"])
def test_dir_names_what_is_public(package):
    code = f"import json, {package} as it; print(json.dumps([dir(it), it.__all__]))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    listed, public = json.loads(done.stdout)
    assert [name for name in listed if not name.startswith("__")] == public


def test_an_event_loop_goes_on_while_the_body_moves(monkeypatch):
    began, goes_on, call = threading.Event(), threading.Event(), Body.call

    def waiting(body, skill, /, **params):
        began.set()
        assert goes_on.wait(10), "the loop waits for the body"
        return call(body, skill, **params)

    async def loop():
        while not began.is_set():
            await asyncio.sleep(0.001)
        goes_on.set()

    async def two():
        return await asyncio.gather(body.acall("nod"), body.acall("nod"), loop())

    monkeypatch.setattr(Body, "call", waiting)
    with fake_body(nod) as body:
        *seen, _ = asyncio.run(two())
        (tool, *_) = body_tools(body)
        assert asyncio.run(tool.acall()).picture
    assert sorted(observation.step for observation in seen) == [1, 2]


def test_calls_and_all_tools_of_a_body_wait_for_one_another(monkeypatch):
    inside, most = [], []

    def alone(body, skill, /, **params):
        inside.append(skill)
        most.append(len(inside))
        time.sleep(0.01)
        inside.pop()
        return Observation(0, "", np.zeros((8, 8, 3), np.uint8))

    async def mixed():
        lists = (body_tools(body), body_tools(body))
        await asyncio.gather(body.acall("nod"), *(tools[0].acall() for tools in lists), body.acall("nod"))

    with fake_body(nod) as body:
        monkeypatch.setattr(Body, "call", alone)
        asyncio.run(mixed())
    assert most == [1] * 4


def test_a_new_body_is_not_placed_again_where_it_stands(monkeypatch):
    loaded = []
    reset = FakeWorld.reset
    monkeypatch.setattr(FakeWorld, "reset", lambda self, *given: loaded.append(given) or reset(self, *given))
    with fake_body(nod) as body:
        Episode(body, free_episode("nod", body.scene, seed=1), "tester").close()
        assert len(loaded) == 1
        body.call("nod")
        body.place(body.scene)
        assert len(loaded) == 2
        body.place(body.scene, Pose2D(1.0, 0.0, 0.0))
        assert (len(loaded), body.start.x) == (3, 1.0)
