"""Draw every trained skill, in half-physics, as a row of one picture: `make strips`.

python strips.py PICTURE.jpg
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, Final

from PIL import Image

from humanclaw import Plugins, Skill
from humanclaw.skills import from_si
from humanclaw_train.eval.show import filmed, moments, performed, strip

RENDERER: Final = "raster"
CALLS: Final = 3
WIDTH: Final = 1200
"""Width of the picture, pixels."""
USUAL: Final = 0.6
SIDED: Final = 0.8
"""Where in its range a parameter is, 0 to 1; SIDED: one that may be negative."""


def draw(plugins: Plugins) -> Image.Image:
    """Draw one row for each skill."""
    drawing, rows = plugins.make("renderers", RENDERER), []
    for _, skill in sorted(plugins.skills.items()):
        if skill.trained and skill.adapter is not None:
            title, motion, scene = performed(plugins, skill, _asked(skill), CALLS, 0, RENDERER)
            rows.append((title, list(filmed(motion, scene, drawing, moments(len(motion))))))
    drawing.close()
    return Image.fromarray(strip(rows))


def _asked(skill: Skill) -> dict[str, Any]:
    """Return parameters for straight motion: those around zero are zero unless they are the only one."""
    sided = SIDED if len(skill.parameters) == 1 else 0.5
    asked = {}
    for one in skill.parameters:
        share = sided if one.low < 0 else USUAL
        asked[one.key] = round(from_si(one.key, one.low + share * (one.high - one.low)))
    return skill.check(asked)


if __name__ == "__main__":
    picture = draw(Plugins.discover())
    picture.resize((WIDTH, WIDTH * picture.height // picture.width)).save(Path(sys.argv[1]), quality=80)
