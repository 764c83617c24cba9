"""A motion prior of one's own, from its wheel to episodes beside the shipped one."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from hosting import host_of, plugin

from humanclaw import Backends, Body, HumanclawError, PluginError, Plugins, run_episode
from humanclaw.errors import CheckpointError
from humanclaw.motion import DiTGenerator, read_header
from humanclaw.records import Decision, free_episode
from humanclaw.skills import Call
from humanclaw.world import SceneBuilder

pytestmark = pytest.mark.integration
SOURCE = Path(__file__).parent / "data/prior_tiny"
TINY = read_header(SOURCE / "humanclaw_prior_tiny/base.safetensors")["digest"]
LITE = DiTGenerator.load().digest


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The folder into which the wheel of the prior is installed, on the path."""
    folder = tmp_path_factory.mktemp("prior")
    build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(folder)]
    subprocess.run(build, cwd=SOURCE, check=True, capture_output=True)
    with zipfile.ZipFile(next(folder.glob("*.whl"))) as wheel:
        wheel.extractall(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        yield folder


@pytest.fixture(scope="module")
def plugins(installed):
    return Plugins.discover()


@pytest.fixture(scope="module")
def floor():
    builder = SceneBuilder.on_floor()
    return builder.scene()


@pytest.fixture
def body(plugins, floor):
    with Body(floor, plugins=plugins, backends=Backends(prior="tiny")) as body:
        yield body


class Stroller:
    name, privileged = "stroller", False

    def begin(self, context):
        self.skills = set(context.skills)

    def decide(self, observation, history):
        return Decision((Call("stroll", {"z_cm": 40}),))


def test_a_prior_is_installed_from_its_wheel_with_its_skill(plugins):
    assert plugins.priors.keys() == {LITE, TINY}
    assert "stroll" in plugins.skills
    assert plugins.disabled == {}


def test_without_its_prior_the_skill_is_refused_with_both_digests(tmp_path):
    shutil.copytree(SOURCE / "humanclaw_prior_tiny/stroll", tmp_path / "stroll")

    plugins = host_of("alone", skills=[tmp_path / "stroll"])
    assert f"was trained against base {TINY}; the installed ones are {LITE}." in plugins.disabled["stroll"]
    assert "Install its prior." in plugins.disabled["stroll"]


def test_an_episode_with_the_prior_moves_the_body_and_names_it(body, tmp_path):
    agent = Stroller()
    before = body.state().body.root[-1, 2]
    record = run_episode(body, free_episode("stroll", body.scene, max_steps=3), agent, folder=tmp_path / "one")
    assert "stroll" in agent.skills
    assert "walk" not in agent.skills
    assert body.state().body.root[-1, 2] - before == pytest.approx(1.2, abs=0.4)
    assert record.weights["base"] == TINY
    assert record.settings["body"]["prior"] == "tiny"
    assert "stroll" in record.skills
    assert "walk" not in record.skills


def test_two_priors_live_side_by_side(body, plugins, floor):
    with Body(floor, plugins=plugins) as other:
        assert (body.weights, other.weights) == (TINY, LITE)
        assert "walk" in other.skills
        assert "stroll" not in other.skills
        for _ in range(2):
            body.call("stroll", z_cm=40)
            other.call("walk", z_cm=40)
        with pytest.raises(CheckpointError, match=f"was trained against base {LITE}, and this base is {TINY}"):
            body.call("walk", z_cm=40)


def test_one_skill_may_have_an_adapter_for_each_prior(installed, floor, tmp_path):
    here = SOURCE / "humanclaw_prior_tiny/stroll"
    shutil.copytree(here, tmp_path / "amble")
    walk = Plugins.discover().skill("walk").adapter
    shutil.copy(walk, tmp_path / "amble/adapter.safetensors")
    shutil.copy(here / "adapter.safetensors", tmp_path / "amble/adapter-tiny.safetensors")

    plugins = Plugins.discover()
    plugins.add(plugin(skills=[tmp_path / "amble"]), "amble")
    assert plugins.disabled == {}
    for prior in ("lite", "tiny"):
        with Body(floor, plugins=plugins, backends=Backends(prior=prior)) as body:
            before = body.state().body.root[-1, 2]
            body.call("amble", z_cm=40)
            assert body.state().body.root[-1, 2] > before + 0.15


def test_an_unknown_prior_is_answered_with_the_nearest_name(plugins, floor):
    with pytest.raises(PluginError, match=r"there is no prior 'tny'. Did you mean tiny"):
        Body(floor, plugins=plugins, backends=Backends(prior="tny"))


def test_a_generator_that_takes_no_prior_says_so(plugins, floor):
    own = Plugins.discover()
    own.add(plugin(motion_generators=[("own", lambda profile="default": DiTGenerator.load(profile=profile))]), "own")
    with pytest.raises(HumanclawError, match=r"generator 'own' takes no prior; got 'tiny'. Leave out --prior"):
        Body(floor, plugins=own, backends=Backends(generator="own", prior="tiny"))
