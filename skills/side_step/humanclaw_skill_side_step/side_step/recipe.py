"""Recipe of `side_step`: which chunks of clips show it, and how its motion is synthesised."""

import numpy as np

from humanclaw.skills import Draw, GaitParameters, Recipe

RECIPE = Recipe(
    name="side_step",
    description="Step sideways.",
    windows=lambda w: (np.abs(w.across) > 0.1) & (np.abs(w.forward) < 0.6 * np.abs(w.across)) & (np.abs(w.yaw) < 0.7),
    gait=GaitParameters(width=0.085, clearance=0.045, arms=0.6, exit=0.3),
    feet="shuffle",
    commands={"x": Draw(-0.42, 0.42, jitter=0.015)},
    repeats=0.4,
)
