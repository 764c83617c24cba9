"""How the motion model is solved, and what corrects its motion: one record for each profile, resolved here alone.

A chunk passes the corrections in the order of the fields. They act at three places because they need three things. A
heading has to be corrected in the command: a chunk that is turned afterwards would slide its feet. What the next chunk
continues is corrected in the frame of the chunk, before physics. What it must not continue is corrected last. Hands are
laid once more during simulation, by the profile of half-physics: a seat lifts the thighs (Drive.laid).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from humanclaw.body.pose import Array, Motion
from humanclaw.errors import HumanclawError
from humanclaw.motion.drift_correction import correct_drift
from humanclaw.motion.flow import Solver
from humanclaw.motion.foot_locking import lock_feet

Correction = Callable[[Motion, Motion, Array], Motion]
"""Maps a history, its future (canonical frame of the chunk) and the usual pose (24, 3) to the corrected future."""


@dataclass(frozen=True)
class MotionProfile:
    """Settings of generated motion. Every field but the solver is a correction; the defaults are all of them."""

    solver: Solver
    rises: bool = True
    """A body that is down rises before it steps: the model steps from standing alone."""
    steers: bool = True
    """A commanded turn makes up for the heading errors of earlier calls (humanclaw.skills.HeadingCorrection)."""
    redraws: int = 3
    """Maximum redraws of a first step in which both feet slide (best_of_n). Each fails once in twenty."""
    future: tuple[Correction, ...] = (
        # Drift first: feet are locked where the corrected legs have them.
        lambda _, future, usual: correct_drift(future, usual),
        lambda history, future, _: lock_feet(history, future),
    )
    """What the next chunk continues as well."""
    lays_hands: bool = True
    """Hands are laid on the thighs in what only the body is driven through: in a history, flat hands made bodies sink
    as they stood up."""


PROFILES: Final = {
    "default": MotionProfile(Solver("euler", 3, power=2.0)),
    "paper": MotionProfile(Solver("midpoint", 30), rises=False, steers=False, redraws=0, future=(), lays_hands=False),
}
"""`default`: as few evaluations as the feet allow. On a uniform grid, Euler steps average a left-first and a
right-first step. `paper`: the paper's 30 steps, and the model's raw output."""


def motion_profile(name: str) -> MotionProfile:
    """Return the settings of a profile. Raises HumanclawError if there is none of this name."""
    if name not in PROFILES:
        raise HumanclawError(f"There is no motion profile {name!r}.", f"Choose from: {', '.join(PROFILES)}.")
    return PROFILES[name]
