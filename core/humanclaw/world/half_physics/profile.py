"""The constants of half-physics, by name."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from humanclaw.errors import HumanclawError
from humanclaw.world.joints import GRAVITY

REFERENCE_STIFFNESS: Final = (("ankle", 0.1), ("shoulder", 0.03), ("wrist", 0.1))
"""Where the passive stiffness is not 1: known-good constants of the paper's implementation."""
YIELDING_ARMS: Final = (("ankle", 0.1), ("shoulder", 0.001), ("elbow", 0.001), ("wrist", 0.001), ("hand", 0.001))


@dataclass(frozen=True)
class Profile:
    """Constants of one way to run half-physics. SI units."""

    name: str
    substeps: int = 4
    """Physics steps a frame of 1/30 s: 120 Hz."""
    gravity: float = GRAVITY
    horizontal_every: int = 1
    """The horizontal root velocity is commanded on every Nth substep of a frame; between them friction may brake it."""
    max_turn: float = float(np.radians(30.0))
    """No joint turns further in one frame, radians."""
    max_speed: float = 6.0
    """Horizontal root speed is capped here, m/s, whether a command or a contact causes it: a sprint. Without the cap
    limbs that kick against something throw the body through walls."""
    max_lift: float = 3.0
    """Upward root speed is capped here, m/s, while a contact causes it: legs that straighten as fast as they can."""
    max_rise: float = 0.0
    """Upward root speed that outlasts the contact which caused it, m/s. At 0 legs lift the body and never launch it."""
    max_fall: float = 15.0
    """Downward root speed is capped here, m/s, as after a fall of eleven metres."""
    max_link_speed: float = 20.0
    """A link's speed relative to the pelvis is held below this, m/s, by slowing all joints alike: a kick."""
    max_looks: int = 8
    """The faster the limbs, the more often contacts are looked for in a substep (TRAVEL), but no more often than
    this."""
    step_offset: float = 0.04
    """A foot held back by an edge that is no more than this above its sole is lifted over it, metres; 0: never."""
    yielding: float = 2.0
    """Thighs that carry the body on a seat while the pelvis hovers bend at the hips this fast, rad/s; 0: they do
    not."""
    reaching: float = 0.45
    """Feet of a seated body that hang in the air sink this fast, m/s."""
    push_force: float = 500.0
    """Maximum force with which the body pushes movable objects, newtons: that of an adult."""
    lift: float = 150.0
    """Maximum force of one hand on what it holds, newtons: an arm lifts 15 kg."""
    max_kick: float = 5.0
    """The body makes no object faster than this, m/s; a fall may."""
    friction: float = 0.4
    """Of the body's surface."""
    stiffness: float = 1.0
    """Passive joint stiffness (the paper's lambda): how little a contact turns a link away from its pose."""
    soft: tuple[tuple[str, float], ...] = YIELDING_ARMS
    """Joints whose stiffness differs, left and right."""
    inertia: float = 40.0
    """Rotational inertia of a link with stiffness 1, kg m2."""
    arm_mass: float = 0.1
    """Share of the arms' mass that moves with them; the chest carries the rest."""
    arm_recovery: float = 0.2
    """Share of an arm's pose error, caused by contact, that is corrected in a frame.

    Soft, light and patient arms are pushed aside. Stiff ones would prop up a body that sits down beside its hands.
    """

    def stiffness_of(self, joint: str) -> float:
        return dict(self.soft).get(joint.removeprefix("left_").removeprefix("right_"), self.stiffness)


_DEFAULT: Final = Profile("default")
_PAPER: Final = Profile("paper", soft=(), arm_mass=1.0, arm_recovery=1.0, step_offset=0.0, yielding=0.0)
_REFERENCE: Final = replace(_PAPER, name="reference", horizontal_every=2, soft=REFERENCE_STIFFNESS)
PROFILES: Final = {profile.name: profile for profile in (_DEFAULT, _PAPER, _REFERENCE)}
"""`paper`: 120 Hz and stiffness 1.0 in every joint, as the paper says. `reference`: the constants of its
implementation, where ankles, shoulders and wrists are softer and the root is commanded on every other substep."""


def find_profile(name: str) -> Profile:
    """Find the profile of this name. Raises HumanclawError if there is none."""
    if name not in PROFILES:
        raise HumanclawError(f"there is no half-physics profile {name!r}.", f"Choose one of: {', '.join(PROFILES)}.")
    return PROFILES[name]
