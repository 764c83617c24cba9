"""A skill with its own adapter: the folder `squat` beside this file, trained on motion that you have.

    humanclaw data chunks --skill examples/squat --clips FOLDER_OF_MOTION
    humanclaw train adapter --skill examples/squat
    humanclaw run --plugin examples/squat.py

Until it is trained, it is listed as untrained, and no model can call it. docs/tutorial-train.md explains every step.
"""

from pathlib import Path

from humanclaw import hookimpl


@hookimpl
def humanclaw_skills(register):
    register(Path(__file__).parent / "squat")
