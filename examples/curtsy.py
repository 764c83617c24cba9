"""A new measure, and a skill whose parameter commands it: `humanclaw run --plugin examples/curtsy.py`.

The schema declares the measure that a parameter commands. Records, metrics and agents read it there, so they need to
know no skill by name.
"""

from typing import Annotated

import numpy as np
from pydantic import Field

from humanclaw import Keyframes, hookimpl, skill
from humanclaw.body import JOINT_INDEX
from humanclaw.skills import Measure

KNEES = [JOINT_INDEX["left_knee"], JOINT_INDEX["right_knee"]]
BEND = {"x-measure": "knees.bend"}


def knee_bend(root, rotations):
    """Return the (N,) mean bend of the knees at the end of chunks, radians.

    root: (N, 20, 3), metres; rotations: (N, 20, 24, 3), rotation vectors.
    """
    return np.linalg.norm(rotations[:, -1, KNEES], axis=-1).mean(axis=-1)


@skill(checks=["Is somebody in view who could see it?"], role="posture")
def curtsy(bend_deg: Annotated[int, Field(ge=5, le=60, json_schema_extra=BEND)] = 40) -> Keyframes:
    """Bend the knees in courtesy."""
    rest, bent = (0.0, 0.0, 0.0), (float(np.radians(bend_deg)), 0.0, 0.0)
    return Keyframes((0.0, 0.5), {"left_knee": (rest, bent), "right_knee": (rest, bent)})


@hookimpl
def humanclaw_measures(register):
    register(Measure("knees.bend", "rad", "Mean bend of the knees at the end.", 1, knee_bend))


@hookimpl
def humanclaw_skills(register):
    register(curtsy)
