"""A skill with its own schema and the adapter of another skill: `humanclaw run --plugin examples/stroll.py`.

A model that is poor at numbers chooses between three words. The motion is that of `walk`, so nothing is trained.
"""

from pathlib import Path
from typing import Literal

import humanclaw_skill_walk
from humanclaw import Control, hookimpl, skill

ADAPTER = Path(humanclaw_skill_walk.__file__).parent / "walk" / "adapter.safetensors"
METRES = {"slow": 0.2, "easy": 0.4, "brisk": 0.65}


@skill(checks=["Is the floor ahead free for a metre?"], role="locomotion")
def stroll(pace: Literal["slow", "easy", "brisk"] = "easy") -> Control:
    """Walk straight ahead for half a second."""
    return Control(ADAPTER, {"x": 0.0, "z": METRES[pace], "yaw": 0.0})


@hookimpl
def humanclaw_skills(register):
    register(stroll)
