"""Recipe of `sit_in_place`: which chunks of clips show it, and how its motion is synthesised."""

from humanclaw.skills import Draw, GaitParameters, Recipe

RECIPE = Recipe(
    name="sit_in_place",
    description="Sit down.",
    windows=lambda w: (w.up < -0.1) & (w.flat < 0.6) & (w.feet < 0.1),
    gait=GaitParameters(width=0.09, clearance=0.03, land=0.3, lift=0.5, lift_pitch=0.5),
    commands={"h": Draw(0.19, 0.81, usual=0.54, spread=0.05)},
    share=0.8,
    repeats=0.45,
)
