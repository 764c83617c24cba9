"""Reflexes of the body: it lifts a toe over an edge, its thighs give way to a seat, and its feet reach for the floor.

A generated motion does not know the scene: its feet clear a step by millimetres or miss it by millimetres, its thighs
slope where a seat is level, and a seat is higher than it was told. A person would not notice. Half-physics without
reflexes would lose the stair, leave the body on its thighs with the hips in the air, and its shoes over the floor. All
reflexes are bounded: an edge higher than a toe still blocks.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from humanclaw.body.limits import SHOES
from humanclaw.body.pose import FPS, forward_kinematics
from humanclaw.body.skeleton import JOINT_INDEX, OFFSETS
from humanclaw.world.half_physics.profile import Profile
from humanclaw.world.half_physics.quaternions import Pose, motion_of
from humanclaw.world.half_physics.world import LEVEL, TOUCHING, Touch, World

_PUSH: Final = 50.0
"""A foot that meets less than this is not held back, newtons."""
_REACH: Final = 0.02
"""How far behind an edge its upper side is looked for, metres."""
_PELVIS: Final = JOINT_INDEX["pelvis"]
LEG_OF: Final[Mapping[int, tuple[int, int, int]]] = {
    JOINT_INDEX[f"{side}_hip"]: (JOINT_INDEX[f"{side}_knee"], JOINT_INDEX[f"{side}_ankle"], JOINT_INDEX[f"{side}_foot"])
    for side in ("left", "right")
}
"""Joint of each hip to knee, ankle and foot of its leg."""
_SHIN_UPRIGHT, _TOES_DOWN = 0.05, 0.75
"""Sines of the slopes of a shin that is upright, and of toes that point down as far as they go."""
_SHIN, _SHOE = float(np.linalg.norm(OFFSETS[JOINT_INDEX["left_ankle"]])), 0.2
"""Lengths from knee to ankle and from ankle to the tip of the shoe, metres."""
_PATIENCE: Final = 0.2
"""A pelvis or thigh that has carried nothing for so long carries no more, seconds."""
_HANGS, _HURRIES = 0.05, 0.1
"""A foot that has touched nothing for so long begins to reach for the floor, and so much later does so at full speed,
seconds."""
_OFF, _LIGHTLY = 0.04, 0.1
"""A pelvis that has carried nothing for so long (seconds) is off its seat. A hip whose foot holds it up bends at this
share of the speed of one whose thigh does."""
_CARRIERS: Final = (_PELVIS, *LEG_OF)


@dataclass(frozen=True)
class Reflex:
    """The reflexes that the last physics step calls for."""

    lift: float = 0.0
    """How far the body must rise for a foot to clear the edge that holds it back, metres."""
    borne: Mapping[int, float] = field(default_factory=dict)
    """Pelvis and joints of the hips whose thighs carry weight, or did a moment ago, to the seconds since."""
    free: Mapping[int, float] = field(default_factory=dict)
    """Joints of the hips of a body that sits to the seconds since their feet touched anything."""

    def gives(self, hip: int) -> float:
        """Return how fast a hip bends, 0 to 1, because its thigh carries the body while the pelvis hovers, or its foot
        does."""
        pelvis = self.borne.get(_PELVIS, np.inf)
        if pelvis > 0.0 and self.borne.get(hip) == 0.0:
            return 1.0
        return _LIGHTLY if pelvis > _OFF and self.free[hip] == 0.0 else 0.0

    def hangs(self, hip: int) -> float:
        """Return how fast the foot of a hip's leg reaches for the floor, 0 to 1: the faster the longer it hangs. It
        waits while the seat carries nothing: it would push the body up."""
        return min(max((self.free[hip] - _HANGS) / _HURRIES, 0.0), 1.0) if 0.0 in self.borne.values() else 0.0


CALM: Final = Reflex()


def feel(world: World, profile: Profile, movable: Collection[int], touches: Sequence[Touch], before: Reflex) -> Reflex:
    """Read the contacts of the body that one physics step has left. movable: ids of the objects that are."""
    touches = [touch for touch in touches if touch.distance <= TOUCHING]
    carrying = {touch.joint for touch in touches if touch.normal[1] > LEVEL}
    lift = _lift(world, profile, movable, touches)
    if not profile.yielding:
        return Reflex(lift)
    step = 1 / (FPS * profile.substeps)
    borne = {part: seconds for part, seconds in _since(carrying, before.borne, step, _CARRIERS) if seconds < _PATIENCE}
    standing = {hip for hip, leg in LEG_OF.items() if carrying.intersection(leg)}
    return Reflex(lift, borne, dict(_since(standing, before.free, step, LEG_OF)) if borne else {})


def reach_down(pose: Pose, hip: int, speed: float) -> tuple[float, float]:
    """Return how fast knee and ankle of a leg turn, rad/s, for its foot to sink at a speed, m/s.

    First the shin turns upright and the foot stays level; then the toes point down.
    """
    motion = motion_of([pose])
    _, turns = forward_kinematics(motion.root[0], motion.rotations[0])
    knee, ankle, _ = LEG_OF[hip]
    ahead = float(-turns[knee, :, 1] @ np.cross(turns[0, :, 0], [0.0, 1.0, 0.0]))
    if abs(ahead) > _SHIN_UPRIGHT:
        rate = float(np.copysign(speed / max(_SHIN * abs(ahead), _SHOE / 2), ahead))
        return rate, -rate
    return 0.0, speed / _SHOE * float(turns[ankle, 1, 2] > -_TOES_DOWN)


def _since(
    touching: set[int], before: Mapping[int, float], step: float, parts: Iterable[int]
) -> Iterator[tuple[int, float]]:
    """Yield the seconds since each part touched.

    A thigh that loses touch for a moment stays down: else it would come back down and push the body off the seat. A
    foot waits: else it would push the body up as it flickers between touch and none.
    """
    for part in parts:
        yield part, 0.0 if part in touching else before.get(part, np.inf) + step


def _lift(world: World, profile: Profile, movable: Collection[int], touches: Sequence[Touch]) -> float:
    held = [touch for touch in touches if _holds_back(touch) and touch.object_id > 0 and touch.object_id not in movable]
    if not held or not profile.step_offset:
        return 0.0
    soles = _soles(world.pose())
    return max(_missing(world, profile.step_offset, soles[touch.joint], touch) for touch in held)


def _holds_back(touch: Touch) -> bool:
    return touch.joint in SHOES and touch.normal[1] <= LEVEL and touch.force >= _PUSH


def _soles(pose: Pose) -> Mapping[int, float]:
    """Height of the lowest corner of each part of a foot."""
    motion = motion_of([pose])
    joints, turns = forward_kinematics(motion.root[0], motion.rotations[0])
    return {joint: float((corners @ turns[joint].T)[:, 1].min() + joints[joint, 1]) for joint, corners in SHOES.items()}


def _missing(world: World, offset: float, sole: float, touch: Touch) -> float:
    """How far a foot that something holds back is too low to pass over it; 0 if that is more than a step's offset."""
    x, _, z = touch.normal
    ahead = np.array(touch.point) - _REACH * np.array([x, 0.0, z]) / max(float(np.hypot(x, z)), 1e-9)
    above, below = ahead.copy(), ahead
    above[1], below[1] = sole + offset, sole - TOUCHING
    top = world.top(touch.object_id, above, below)
    return 0.0 if top is None else top - sole + TOUCHING
