"""A skill wheel that was built against plugin API 1.0 and kept: every later version loads it, or refuses it with the
reason."""

import importlib
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from humanclaw import Backends, Body, Call, Decision, Episode, Plugins
from humanclaw.plugins import API_VERSION
from humanclaw.records import free_episode
from humanclaw.testing import examine, fake_scene
from humanclaw.testing.fakes import FAKE, Fakes

KEPT = Path(__file__).parent / "data/plugin_api"
WHEEL = KEPT / "humanclaw_skill_bow-1.0-py3-none-any.whl"


@pytest.fixture
def plugins(tmp_path, monkeypatch):
    """All that is installed, and the wheel as pip unpacks it."""
    zipfile.ZipFile(WHEEL).extractall(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    yield Plugins.discover()
    sys.modules.pop("humanclaw_skill_bow", None)


@pytest.fixture
def info(plugins):
    return plugins.info("humanclaw-skill-bow")


def test_the_kept_wheel_loads_or_is_refused_with_the_reason(info):
    if info.error:
        assert "was made for plugin API 1.0" in info.error or "needs humanclaw" in info.error
        assert API_VERSION.partition(".")[0] != "1"
    else:
        assert info.provides == ("skill bow", "skill bow_and_wave")
        assert info.disabled == {}


def test_the_skills_of_the_kept_wheel_pass_every_check(plugins, info):
    for name in () if info.error else ("bow", "bow_and_wave"):
        assert examine(plugins.skill(name), engines=()).faults == ()


def test_the_kept_wheel_plays_and_observes_an_episode(plugins, info):
    if info.error:
        pytest.skip(info.error)
    plugins.add(Fakes(), FAKE)
    body = Body(fake_scene(), plugins=plugins, backends=Backends(FAKE, FAKE, FAKE))
    with body, Episode(body, free_episode("bow", body.scene, max_steps=2), "tester") as episode:
        episode.submit(Decision((Call("bow", {"degrees": 20}),)))
        episode.submit(Decision((Call("bow_and_wave"),)))
    heard = importlib.import_module("humanclaw_skill_bow").heard
    assert heard == [
        *["chunk of step 0: 15 frames"] * 2, "step 0: executed",
        *["chunk of step 1: 15 frames"] * 4, "step 1: executed", "out_of_steps",
    ]  # fmt: skip


@pytest.mark.skipif(not os.environ.get("HUMANCLAW_SLOW"), reason="builds a wheel: HUMANCLAW_SLOW=1")
def test_the_kept_wheel_is_what_its_source_builds(tmp_path):
    command = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(tmp_path)]
    subprocess.run(command, cwd=KEPT / "bow", check=True, capture_output=True)
    (built,) = tmp_path.glob("*.whl")
    both = [zipfile.ZipFile(wheel) for wheel in (built, WHEEL)]
    modules = [{name: one.read(name) for name in one.namelist() if name.endswith(".py")} for one in both]
    assert modules[0] == modules[1]
