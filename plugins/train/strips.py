"""Draw every trained skill, in half-physics, as a row of one picture: `make strips`.

python strips.py PICTURE.jpg
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np
from PIL import Image

from humanclaw import Plugins, Skill
from humanclaw.skills import from_si
from humanclaw_train.show import show

CALLS: Final = 3
WIDTH: Final = 1200
"""Width of the picture, pixels."""
USUAL: Final = 0.6
SIDED: Final = 0.8
"""Where in its range a parameter is, 0 to 1; SIDED: one that may be negative."""


def rows(folder: Path) -> list[Image.Image]:
    """Draw one strip for each skill."""
    plugins = Plugins.discover()
    trained = [skill for _, skill in sorted(plugins.skills.items()) if skill.trained and skill.adapter is not None]
    made = [_show(plugins, skill, folder) for skill in trained]
    return [Image.open(still).convert("RGB") for still in made]


def _show(plugins: Plugins, skill: Skill, folder: Path) -> Path:
    """Draw straight motion: parameters around zero are zero unless they are the only one."""
    sided = SIDED if len(skill.parameters) == 1 else 0.5
    asked = {}
    for one in skill.parameters:
        share = sided if one.low < 0 else USUAL
        asked[one.key] = round(from_si(one.key, one.low + share * (one.high - one.low)))
    return show(plugins, skill.name, skill.check(asked), CALLS, 0, None, folder / f"{skill.name}.gif", "raster")[1]


if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        drawn = np.concatenate([np.asarray(row) for row in rows(Path(folder))])
    picture = Image.fromarray(drawn)
    picture.resize((WIDTH, WIDTH * picture.height // picture.width)).save(Path(sys.argv[1]), quality=80)
