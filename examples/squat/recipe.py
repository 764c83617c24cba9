"""Recipe of `squat`: which chunks of clips show it."""

from humanclaw.skills import Recipe

# Every window within the bounds of schema.json shows a squat; `windows=lambda w: ...` could select among them.
RECIPE = Recipe(name="squat", retimed=True)
