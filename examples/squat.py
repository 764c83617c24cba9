"""A skill with an adapter of its own: the folder `squat` beside this file, trained on whatever motion you have.

    humanclaw data chunks --skill examples/squat --clips FOLDER_OF_MOTION
    humanclaw train adapter --skill examples/squat
    humanclaw run --plugin examples/squat.py

Until it is trained it is listed as such and no model is offered it. docs/tutorial-train.md does the same at length.
"""

from pathlib import Path

from humanclaw import hookimpl


@hookimpl
def humanclaw_skills(register):
    register(Path(__file__).parent / "squat")
