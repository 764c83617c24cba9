"""A new skill in ten lines: `humanclaw run --plugin examples/nod.py`."""

from typing import Literal

from humanclaw import Keyframes, hookimpl, skill


@skill(checks=["Is anybody in view?"])
def nod(times: Literal[1, 2, 3] = 1) -> Keyframes:
    """Nod the head to agree."""
    return Keyframes.cycle("head", axis="x", degrees=20, seconds=0.5, times=times)


@hookimpl
def humanclaw_skills(register):
    register(nod)
