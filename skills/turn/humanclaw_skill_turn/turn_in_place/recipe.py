"""Recipe of `turn_in_place`: which chunks of clips show it, and how its motion is synthesised."""

import numpy as np

from humanclaw.skills import Draw, GaitParameters, Recipe

RECIPE = Recipe(
    name="turn_in_place",
    description="Turn on the spot.",
    windows=lambda w: (w.flat < 0.18) & (np.abs(w.yaw) > 0.2) & (w.feet > 0.03),
    gait=GaitParameters(width=0.085, clearance=0.045, arms=0.6, gaze_turn=1.0),
    feet="shuffle",
    commands={"yaw": Draw(-1.34, 1.34, jitter=0.05)},
    share=1.5,
    repeats=0.42,
)
