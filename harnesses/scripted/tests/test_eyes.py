"""Tests of the agent that sees only colours, with an external detector program."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from walker import PICTURE, SKILLS

from humanclaw import Agent, EpisodeContext, EpisodeSpec, HumanclawError, Observation, Plugins
from humanclaw.body import rest_pose
from humanclaw.world import View, ego_camera

# Red is a couch, blue a couch with a low score.
DETECTOR = """
import json, sys
while picture := sys.stdin.buffer.read(512 * 512 * 3):
    boxes = []
    for channel, score in ((0, 0.9), (2, 0.2)):
        places = [at // 3 for at in range(channel, len(picture), 3) if picture[at] > 200]
        if places:
            rows, columns = [at // 512 for at in places], [at % 512 for at in places]
            boxes.append([min(columns), min(rows), max(columns) + 1, max(rows) + 1, score, "couch"])
    print(json.dumps(boxes), flush=True)
"""
READING = "import sys; sys.stdin.buffer.read(512 * 512 * 3); "
COUCH = EpisodeSpec(
    id="x", instruction="Find a couch.", scene="test:rooms", target_category="couch", target_ids=(7,), interact=True
)
AWAY = 2.0


def written(tmp_path: Path, program: str) -> str:
    path = tmp_path / "detector.py"
    path.write_text(program)
    words = [sys.executable, str(path)]
    return subprocess.list2cmdline(words) if os.name == "nt" else shlex.join(words)


def view_of(colour: tuple[int, int, int]) -> View:
    """Return a view of a wall 2 m ahead of the eyes with a coloured square of 60 x 60 pixels, and empty ids."""
    rgb = np.full((512, 512, 3), 90, np.uint8)
    rgb[100:160, 300:360] = colour
    return View(rgb, np.full((512, 512), AWAY, np.float32), np.zeros((512, 512), np.int32))


def begun(command: str, view: View, **options: float) -> Agent:
    agent = Plugins.discover().make("agents", "seeing-colour", {"detector": command, **options})
    agent.begin(EpisodeContext(COUCH, SKILLS, 0, view=lambda: view))
    return agent


def says(agent: Agent) -> str:
    return agent.decide(Observation(0, COUCH.instruction, PICTURE), ()).visible_state


def test_it_sees_what_the_program_knows_and_how_far_away_that_is(tmp_path: Path) -> None:
    agent = begun(written(tmp_path, DETECTOR), view_of((255, 0, 0)))
    # Along the optical axis the wall is 2 m away, and the axis points 30 degrees down. The square is 130 of 256 pixels
    # over the axis at its middle: ahead of the eyes by 2 (cos 30 + .508 sin 30) = 2.24 m, 96 at its bottom (2.11).
    eye = float(ego_camera(rest_pose()).position[2])
    left = AWAY * (300 - 256) / 256
    least = np.hypot(left, AWAY * (np.cos(np.radians(30)) + (256 - 160) / 256 * np.sin(np.radians(30))) + eye)
    assert says(agent) == f"A couch is in view, about {least:.1f} m away."


def test_it_does_not_see_what_the_program_does_not_know(tmp_path: Path) -> None:
    command = written(tmp_path, DETECTOR)
    assert says(begun(command, view_of((0, 255, 0)))) == "No couch is in view."
    assert says(begun(command, view_of((0, 0, 255)))) == "No couch is in view."
    assert says(begun(command, view_of((0, 0, 255)), score=0.1)).startswith("A couch is in view")


def test_a_picture_is_asked_about_once_and_the_program_started_once(tmp_path: Path) -> None:
    agent = begun(written(tmp_path, DETECTOR), view_of((255, 0, 0)))
    assert says(agent) == says(agent)


def test_its_settings_are_recorded(tmp_path: Path) -> None:
    command = written(tmp_path, DETECTOR)
    agent = begun(command, view_of((0, 0, 0)), score=0.4)
    assert getattr(agent, "settings", None) == {"detector": command, "score": 0.4, "seconds": 60.0, "words": "eyes"}


@pytest.mark.parametrize("seconds", [0, -1, 3601, float("inf"), float("nan"), "soon"])
def test_a_time_limit_out_of_bounds_is_refused(seconds: object) -> None:
    with pytest.raises(HumanclawError, match=r"--option seconds: .*The options are detector, score, seconds"):
        Plugins.discover().make("agents", "seeing-colour", {"detector": "program", "seconds": seconds})


@pytest.mark.parametrize("options", [{}, {"detector": ""}, {"detector": "  "}])
def test_without_a_program_it_says_what_to_give(options: dict[str, str]) -> None:
    with pytest.raises(HumanclawError, match="needs a program that detects things") as raised:
        Plugins.discover().make("agents", "seeing-colour", options)
    assert "--option detector=" in str(raised.value)


@pytest.mark.parametrize(
    ("program", "told"),
    [
        ("raise SystemExit(3)", "ended with exit status 3"),
        (READING + "print('[[1, 2]]')", r"answered b'\[\[1, 2\]\]"),
        (READING + "print('none')", "answered b'none"),
        (READING + "print('[[NaN, 0, 10, 10, 0.9, \"couch\"]]')", "answered"),
        (READING + "print('[[1e400, 0, 10, 10, 0.9, \"couch\"]]')", "answered"),
        (READING + "print('[[0, 0, 10, 10, 5, \"couch\"]]')", "answered"),
        (READING + "import os, time; os.close(1); time.sleep(60)", "closed its output"),
    ],
)
def test_a_program_that_does_not_answer_is_told_of(tmp_path: Path, program: str, told: str) -> None:
    agent = begun(written(tmp_path, program), view_of((255, 0, 0)))
    with pytest.raises(HumanclawError, match=told):
        says(agent)


SLEEP = "import time; time.sleep(60)"
SLEEPER = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {SLEEP!r}])"


@pytest.mark.parametrize("program", [READING + SLEEP, SLEEP, READING + SLEEPER])
def test_a_program_that_never_answers_is_given_up(tmp_path: Path, program: str) -> None:
    agent = begun(written(tmp_path, program), view_of((255, 0, 0)), seconds=2.0)
    with pytest.raises(HumanclawError, match="has not answered within 2 s"):
        says(agent)


def test_a_box_of_sky_is_no_thing(tmp_path: Path) -> None:
    view = view_of((255, 0, 0))
    sky = View(view.rgb, np.full((512, 512), np.inf, np.float32), view.ids)
    with np.errstate(all="raise"):
        assert says(begun(written(tmp_path, DETECTOR), sky)) == "No couch is in view."


def test_a_program_that_is_not_there_is_told_of() -> None:
    with pytest.raises(HumanclawError, match="cannot be started"):
        says(begun("no-such-program-anywhere", view_of((255, 0, 0))))
