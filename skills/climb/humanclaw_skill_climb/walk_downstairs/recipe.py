"""Recipe of `walk_downstairs`: which chunks of clips show it, and how its motion is synthesised."""

from humanclaw.skills import GaitParameters, Recipe
from humanclaw_skill_climb.stair import STAIR

RECIPE = Recipe(
    name="walk_downstairs",
    description="Descend a stair step.",
    windows=lambda w: (w.forward > 0.12) & (w.up < -0.05),
    gait=GaitParameters(
        width=0.08,
        clearance=0.05,
        land=0.47,
        lift_pitch=0.9,
        land_pitch=0.9,
        arms=1.0,
        lean=0.08,
        gaze_pitch=0.2,
        exit=1.0,
    ),
    feet="stride",
    commands=STAIR,
    share=0.8,
    repeats=0.66,
)
