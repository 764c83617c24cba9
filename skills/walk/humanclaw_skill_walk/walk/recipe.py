"""Recipe of `walk`: which chunks of clips show it, and how its motion is synthesised."""

import numpy as np

from humanclaw.skills import Draw, GaitParameters, Recipe

RECIPE = Recipe(
    name="walk",
    description="Walk.",
    windows=lambda w: (
        (w.forward > 0.1) & (w.forward < 0.95) & (np.abs(w.across) < 0.7 * w.forward) & (np.abs(w.up) < 0.05)
    ),
    # Width, pitches and times of landing and lift were measured on real walks.
    gait=GaitParameters(
        width=0.088,
        narrowing=0.025,
        clearance=0.045,
        land=0.37,
        lift=0.6,
        lift_pitch=1.5,
        land_pitch=-0.65,
        arms=1.25,
        exit=1.0,
        turn_exit=1.0,
    ),
    feet="stride",
    commands={
        "x": Draw(-0.31, 0.31, usual=0.0, spread=0.05, nought=0.8, jitter=0.015),
        "z": Draw(0.0, 0.82, usual=0.48, spread=0.12, jitter=0.03),
        "yaw": Draw(-0.54, 0.54, usual=0.0, spread=0.16, nought=0.8, jitter=0.05),
    },
    share=2.6,
    repeats=0.65,
)
