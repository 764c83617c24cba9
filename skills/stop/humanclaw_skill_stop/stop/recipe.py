"""Recipe of `stop`: which chunks of clips show it, and how its motion is synthesised."""

from humanclaw.skills import GaitParameters, Recipe

RECIPE = Recipe(
    name="stop",
    description="Stand still.",
    windows=lambda w: w.idle & w.neutral,
    gait=GaitParameters(width=0.085, land=0.38, lift=0.55, lift_pitch=1.0, land_pitch=-0.1),
    repeats=0.3,
    stays_seated=True,
)
