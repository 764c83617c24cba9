"""How the chunks of `squat` are found in clips."""

from humanclaw.skills import Recipe

# Every window within the bounds of schema.json shows it; `windows=lambda w: ...` would narrow that down.
RECIPE = Recipe(name="squat", retimed=True)
