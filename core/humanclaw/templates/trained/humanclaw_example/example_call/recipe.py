"""How the chunks of `example_call` are found in clips."""

from humanclaw.recipes import Recipe

# Every window within the bounds of schema.json shows it; `windows=lambda w: ...` would narrow that down.
RECIPE = Recipe(name="example_call", retimed=True)
