"""Tests of `humanclaw show skill`: pictures of a skill."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

pytest.importorskip("torch")

from humanclaw import HumanclawError
from humanclaw_train.cli import show
from humanclaw_train.eval.show import strip


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
