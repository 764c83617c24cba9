"""Recipe of `climb_upstairs`: which chunks of clips show it, and how its motion is synthesised."""

from humanclaw.skills import GaitParameters, Recipe
from humanclaw_skill_climb.stair import STAIR

RECIPE = Recipe(
    name="climb_upstairs",
    description="Climb a stair step.",
    windows=lambda w: (w.forward > 0.12) & (w.up > 0.05),
    gait=GaitParameters(
        width=0.08,
        clearance=0.07,
        land=0.42,
        lift=0.5,
        lift_pitch=1.1,
        land_pitch=-0.1,
        arms=1.1,
        lean=0.14,
        gaze_pitch=0.1,
        exit=1.0,
    ),
    feet="stride",
    commands=STAIR,
    share=0.8,
    repeats=0.66,
)
