"""Recipe of `step_back`: which chunks of clips show it, and how its motion is synthesised."""

import numpy as np

from humanclaw.skills import Draw, GaitParameters, Recipe

RECIPE = Recipe(
    name="step_back",
    description="Step backwards.",
    windows=lambda w: (w.forward < -0.1) & (np.abs(w.across) < 0.6 * -w.forward) & (np.abs(w.yaw) < 0.5),
    # Real backward steps land toe first.
    gait=GaitParameters(width=0.08, land=0.42, lift_pitch=1.0, land_pitch=0.7, arms=0.6, lean=-0.02, exit=1.0),
    feet="stride",
    commands={"z": Draw(0.03, 0.47, jitter=0.03)},
    share=0.8,
    repeats=0.45,
)
