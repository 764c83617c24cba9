"""Tests of `humanclaw figure`: several bodies in one picture."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

pytest.importorskip("torch")

from humanclaw_train.cli import figure
from humanclaw_train.eval.figures import FIGURES, SEATS, STRIDE, WIDTH

HIPS = slice(None), 2


def test_a_figure_is_a_picture_as_wide_as_a_page(tmp_path: Path):
    out = tmp_path / "pictures" / "seats.png"
    done = CliRunner().invoke(figure, ["5d", "--out", str(out)])
    assert done.exit_code == 0, done.output
    with Image.open(out) as picture:
        assert picture.width == WIDTH


def test_seeds_spread_by_the_prior_alone_and_meet_with_an_adapter(plugins, monkeypatch):
    monkeypatch.setattr("humanclaw_train.eval.figures.BODIES", 3)
    [[alone, led]] = FIGURES["5a"](plugins, 0)
    assert alone.poses.root[HIPS].std() > 5 * led.poses.root[HIPS].std()


def test_a_walk_keeps_to_its_ruler(plugins):
    [[panel]] = FIGURES["5b"](plugins, 0)
    assert np.diff(panel.poses.root[HIPS]) == pytest.approx(2 * STRIDE / 100, abs=0.05)


def test_a_loop_of_skills_ends_where_it_began(plugins):
    [[panel]] = FIGURES["5c"](plugins, 0)
    assert panel.poses.root[-1, [0, 2]] == pytest.approx([0.0, 0.0], abs=0.2)


def test_hips_on_a_seat_are_as_high_as_commanded(plugins):
    [panels] = FIGURES["5d"](plugins, 0)
    assert [panel.poses.root[-1, 1] for panel in panels] == pytest.approx([h / 100 for h in SEATS], abs=0.03)


@pytest.mark.integration
def test_kinematics_passes_the_wall_and_leaves_the_landing(plugins):
    (through, blocked), (aloft, carried) = FIGURES["6"](plugins, 0)
    assert blocked.poses.root[HIPS].max() < 1.3 < through.poses.root[-1, 2]
    # The landing is four steps of 17 cm high, and eight were climbed.
    assert aloft.poses.root[-1, 1] - carried.poses.root[-1, 1] == pytest.approx(4 * 0.17, abs=0.1)
