"""Every example runs as its docstring says."""

import runpy
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from humanclaw import (
    Body,
    Decision,
    EpisodeContext,
    HistoryEntry,
    Observation,
    Plugins,
    StepRecord,
    load_run,
    run_episode,
)
from humanclaw.body import rest_pose
from humanclaw.records import Feedback, free_episode

EXAMPLES = Path(__file__).parent.parent / "examples"


@pytest.mark.integration
def test_a_script_drives_a_body_and_keeps_what_it_saw(tmp_path):
    command = [sys.executable, EXAMPLES / "drive.py", tmp_path / "view.png"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    assert "Executed turn_in_place(yaw_deg=45). The hips are at" in done.stdout
    assert Image.open(tmp_path / "view.png").size == (512, 512)


@pytest.mark.integration
def test_a_hand_opens_a_fridge(tmp_path):
    command = [sys.executable, EXAMPLES / "fridge.py", tmp_path / "strip.jpg"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=240)
    opened = int(done.stdout.splitlines()[-1].removeprefix("The door is open by ").removesuffix(" degrees."))
    assert 40 < opened < 95
    strip = np.asarray(Image.open(tmp_path / "strip.jpg")).astype(int)
    assert strip.shape == (800, 1200, 3)
    shirt = strip[..., 2] - strip[..., 0] > 60  # Blue, and in the middle: the sky is above.
    assert shirt.reshape(2, 400, 3, 400)[:, 100:].mean(axis=(1, 3)).min() > 0.02


def test_the_fridge_takes_hands_that_are_installed_already(tmp_path, monkeypatch):
    """As docs/hands.md installs them."""
    for name in ("handle", "hands"):
        info = tmp_path / f"humanclaw_skill_{name}-0.1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: humanclaw-skill-{name}\nVersion: 0.1.0\n")
        (info / "entry_points.txt").write_text(f"[humanclaw]\n{name} = humanclaw_skill_{name}\n")
    monkeypatch.syspath_prepend(tmp_path)
    packages = runpy.run_path(str(EXAMPLES / "fridge.py"))["PACKAGES"]
    assert {"reach", "pull"} <= Plugins.discover(packages).skills.keys()


def test_the_ten_line_skill_nods(house):
    plugins = Plugins.discover([EXAMPLES / "nod.py"])
    with Body(house, plugins=plugins) as body:
        body.call("nod", times=2)
        assert len(body.last.chunks) == 2
        commanded = body.last.chunks[0].commanded
        assert np.ptp(commanded.rotations[:, 15, 0]) > 0.3  # 20 degrees are 0.35 rad


def test_third_parties_bring_an_adapter_an_observer_and_an_agent(house, tmp_path, capsys):
    files = [EXAMPLES / name for name in ("stroll.py", "bumps.py", "rover.py")]
    plugins = Plugins.discover(files)
    with Body(house, plugins=plugins) as body:
        brisk = body.call("stroll", pace="brisk")
        assert str(brisk.feedback) == "Executed stroll(pace=brisk)."
        assert 0.5 < np.linalg.norm(np.diff(body.last.chunks[0].commanded.root[[0, -1]][:, [0, 2]], axis=0)) < 0.8
        body.reset(house)
        agent = plugins.make("agents", "rover", {})
        run_episode(body, free_episode("wander", house, max_steps=3), agent, folder=tmp_path / "episode")
    (episode,) = load_run(str(tmp_path))
    assert [step.call.skill for step in episode.steps] == ["walk", "walk", "stop"]
    assert "free-0 (stopped): of 3 steps touched " in capsys.readouterr().out
    assert set(episode.record.skills) >= {"stroll", "walk"}


def test_the_rover_turns_where_the_view_stays_as_it_was(plugins, house):
    rover = Plugins.discover([EXAMPLES / "rover.py"]).make("agents", "rover", {})
    grey = np.full((512, 512, 3), 90, np.uint8)
    rover.begin(EpisodeContext(free_episode("wander", house, max_steps=9), plugins.skills, 0))
    before = [HistoryEntry(0, Decision(), Feedback(), grey)]
    assert rover.decide(Observation(1, "", grey), before).calls[0].skill == "turn_in_place"
    assert rover.decide(Observation(1, "", grey + 60), before).calls[0].skill == "walk"


def test_a_measure_of_a_third_party_is_what_its_skill_commands():
    plugins = Plugins.discover([EXAMPLES / "curtsy.py"])
    curtsy, standing = plugins.skill("curtsy"), rest_pose(5)
    assert [parameter.measure for parameter in curtsy.parameters] == ["knees.bend"]
    chunk = standing.then(curtsy.plan({"bend_deg": 30}).over(standing))
    bend = plugins.measures["knees.bend"](chunk.root[None], chunk.rotations[None])
    at_rest = np.linalg.norm(standing.rotations[-1, 4:6], axis=-1).mean()
    assert abs(float(bend[0]) - np.radians(30)) <= at_rest + 1e-6


def test_a_metric_of_a_third_party_sums_the_turning():
    plugins = Plugins.discover([EXAMPLES / "turning.py"])
    metric = next(offer for offer in plugins.registered("metrics") if offer.name == "turning")
    steps = [StepRecord(step=0, status="executed", attempts=(), yaw_start=0.5, yaw_end=-0.25)] * 2
    assert metric.value(SimpleNamespace(steps=steps)) == 1.5


@pytest.mark.integration
def test_the_contact_sheet_shows_houses_and_rooms(tmp_path):
    command = [sys.executable, EXAMPLES / "contact_sheet.py", tmp_path, "1", "2"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=300)
    assert "1 houses and 2 views" in done.stdout
    above, within = (np.asarray(Image.open(tmp_path / name)) for name in ("houses.webp", "views.webp"))
    assert above.shape[:2] == (330, 460)
    assert above[:, :380].std() > 20
    assert (within[:, :320].std() > 20, within[:, 320:].std() > 20) == (True, True)
