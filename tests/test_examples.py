"""Every example runs as its docstring says."""

import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image

from humanclaw import Body, Plugins

EXAMPLES = Path(__file__).parent.parent / "examples"


def test_a_script_drives_a_body_and_keeps_what_it_saw(tmp_path):
    command = [sys.executable, EXAMPLES / "drive.py", tmp_path / "view.png"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    assert "Executed turn_in_place(yaw_deg=45). The hips are at" in done.stdout
    assert Image.open(tmp_path / "view.png").size == (512, 512)


def test_the_ten_line_skill_nods(house):
    plugins = Plugins.discover([EXAMPLES / "nod.py"])
    with Body(house, plugins=plugins) as body:
        body.call("nod", times=2)
        assert len(body.last.chunks) == 2
        commanded = body.last.chunks[0].commanded
        assert np.ptp(commanded.rotations[:, 15, 0]) > 0.3  # 20 degrees are 0.35 rad


def test_the_contact_sheet_shows_houses_from_above_and_from_inside(tmp_path):
    command = [sys.executable, EXAMPLES / "contact_sheet.py", tmp_path, "1"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=300)
    assert "houses.jpg: 1 pictures" in done.stdout
    for name, size in (("houses.jpg", (3 * 460, 330)), ("views.jpg", (4 * 384, 384))):
        picture = Image.open(tmp_path / name)
        assert picture.size == size
        assert np.asarray(picture)[:, :380].std() > 20
