"""Tests of `humanclaw show skill`: pictures of a skill, beside the most similar person."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

pytest.importorskip("torch")

from humanclaw import HumanclawError, Motion
from humanclaw_train.cli import show
from humanclaw_train.eval.show import nearest, on_floor, strip
from humanclaw_train.mocap.clips import Clip

STANDING = Motion(np.tile([0.0, 0.9, 0.0], (60, 1)), np.zeros((60, 24, 3)))


def gliding(name: str, speed: float, seconds: float = 2.0) -> Clip:
    frames = round(30 * seconds)
    ahead = np.arange(frames)[:, None] * [0.0, 0.0, speed / 30]
    motion = Motion(STANDING.root[:1] + ahead, np.zeros((frames, 24, 3)))
    return Clip(name, motion, {"walk": [(0, frames - 1)]}, "made", "none")


def test_the_person_beside_is_the_one_with_the_most_similar_speed(plugins):
    walk = plugins.skill("walk").declaration
    asked = {"x": 0.0, "z": 0.4, "yaw": 0.0}
    name, motion = nearest([gliding("slow", 0.3), gliding("right", 0.78), gliding("fast", 1.6)], walk, asked, 3)
    assert name == "right"
    assert len(motion) == 5 + 3 * 15


def test_a_long_clip_is_preferred_to_a_short_one(plugins):
    walk = plugins.skill("walk").declaration
    clips = [gliding("brief", 0.8, 0.7), gliding("on and on", 0.7, 3.0)]
    assert nearest(clips, walk, {"x": 0.0, "z": 0.4, "yaw": 0.0}, 4)[0] == "on and on"


def test_without_a_clip_of_the_skill_nobody_is_drawn_beside(plugins):
    stop = plugins.skill("stop").declaration
    assert nearest([gliding("walks", 0.8)], stop, {}, 2) is None


def test_a_person_is_put_with_the_lowest_sole_on_the_floor():
    aloft = Motion(STANDING.root + [3.0, 2.0, 1.0], STANDING.rotations)
    placed = on_floor(aloft)
    assert placed.root[0, [0, 2]] == pytest.approx([0.0, 0.0])
    assert placed.root[0, 1] < 1.2


def test_a_skill_is_drawn_as_a_moving_picture_and_a_strip(tmp_path: Path):
    out = tmp_path / "pictures" / "walk.gif"
    done = CliRunner().invoke(show, ["skill", "walk", "--z-cm", "40", "--calls", "1", "--out", str(out)])
    assert done.exit_code == 0, done.output
    with Image.open(out) as film, Image.open(out.with_suffix(".png")) as still:
        assert film.n_frames == 10  # 5 frames of standing and 15 of walking, every second one.
        assert still.size == (8 * 240, 320)


def test_a_long_title_is_read_whole_on_a_narrow_picture():
    blank = np.full((120, 240, 3), 255, np.uint8)
    titled = strip([("side_step x_cm 30, distance_ahead_cm 0, heading_deg 0", [blank])])
    dark = titled.min(axis=2) < 128
    assert not dark[:, -8:].any()
    assert dark.any(axis=1)[28:].any()  # A second line.


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--z-cm", "4000"], "greater than the maximum of 80"),
        (["--z_cmm=3"], "z_cmm"),
        (["40"], "It takes: --x-cm NUMBER, --z-cm NUMBER, --yaw-deg NUMBER"),
        (["--z-cm"], "It takes: --x-cm NUMBER"),
        (["--z-cm", "40", "--out", "walk.mp4"], "Expected a GIF file for --out; got walk.mp4"),
    ],
)
def test_unknown_options_are_refused_with_the_skills_own(words, told):
    with pytest.raises(HumanclawError, match=told):
        show(["skill", "walk", *words], standalone_mode=False)
