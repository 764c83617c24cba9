"""Half-physics, whatever engine carries it (paper, section "Locomotion-Decoupled Physical Simulation").

An engine brings a World: rigid bodies, contacts and one time step. All that makes a body follow commanded poses, what
bounds its pushes and what it does of its own accord is here, so that every engine keeps the same checks.
`HalfPhysics(open_world)` is a Simulator; `humanclaw.testing.physics` holds the checks that it has to pass.
"""

from humanclaw.half_physics.pose import Pose
from humanclaw.half_physics.profile import PROFILES, Profile, find_profile
from humanclaw.half_physics.simulator import HalfPhysics
from humanclaw.half_physics.skeleton import LINK_OF, capsule_frame, link_inertia, link_mass
from humanclaw.half_physics.solids import box_of, centre_of_mass, inertia
from humanclaw.half_physics.swing import Swing
from humanclaw.half_physics.world import TOUCHING, ObjectMotion, Touch, World

__all__ = [
    "LINK_OF",
    "PROFILES",
    "TOUCHING",
    "HalfPhysics",
    "ObjectMotion",
    "Pose",
    "Profile",
    "Swing",
    "Touch",
    "World",
    "box_of",
    "capsule_frame",
    "centre_of_mass",
    "find_profile",
    "inertia",
    "link_inertia",
    "link_mass",
]
