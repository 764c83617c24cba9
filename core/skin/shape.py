"""The body's shape: a smooth union of round cones and ellipsoids along the bones, as signed distances in metres.

Every primitive is given in the frame of a joint and evaluated in the bind pose. Only the left half is described; the
right half is its mirror image.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from humanclaw.body import JOINT_INDEX, JOINTS, Array, forward_kinematics, matrix_from_vector

BIND = {
    "left_shoulder": (0.0, 0.0, -0.85), "left_elbow": (0.0, -0.15, 0.0), "left_hip": (0.0, 0.0, 0.07),
    "right_shoulder": (0.0, 0.0, 0.85), "right_elbow": (0.0, 0.15, 0.0), "right_hip": (0.0, 0.0, -0.07),
    "left_ankle": (0.0, 0.0, -0.07), "right_ankle": (0.0, 0.0, 0.07),
}  # fmt: skip
"""The bind pose: rotation vectors of the joints that are not at rest. Arms and legs stand away from one another."""


BIND_POSE = np.zeros((len(JOINTS), 3))
for _joint, _turn in BIND.items():
    BIND_POSE[JOINT_INDEX[_joint]] = _turn
POSITIONS, ORIENTATIONS = forward_kinematics(np.zeros(3), BIND_POSE)
"""Of the joints in the bind pose; the pelvis is at the origin."""


def local(points: Array, joint: str) -> Array:
    """Return (N, 3) points of the bind pose in the frame of a joint."""
    index = JOINT_INDEX[joint]
    return np.asarray((points - POSITIONS[index]) @ ORIENTATIONS[index])


@dataclass(frozen=True)
class Build:
    """What differs between bodies, metres (except shares)."""

    waist: float = 0.0
    """Added to the belly's radii."""
    chest: float = 0.0
    bust: float = 0.0
    hips: float = 0.0
    limbs: float = 1.0
    """Share of the usual thickness of arms and legs."""
    jaw: float = 1.0
    neck: float = 1.0
    hair: str = "short"


def cone(p: Array, a: tuple, b: tuple, ra: float, rb: float) -> Array:
    """Return distances to a cone with round ends: sphere ra at a, sphere rb at b."""
    a, b = np.array(a), np.array(b)
    way = b - a
    along = np.clip((p - a) @ way / (way @ way), 0, 1)
    return np.asarray(np.linalg.norm(p - a - along[:, None] * way, axis=1) - (ra + (rb - ra) * along))


def ball(p: Array, centre: tuple, radii: tuple, turn: tuple = (0, 0, 0)) -> Array:
    """Return distances to an ellipsoid (a close bound). turn: rotation vector of its axes."""
    q = (p - np.array(centre)) @ matrix_from_vector(np.array(turn, float))
    r = np.array(radii)
    k0, k1 = np.linalg.norm(q / r, axis=1), np.linalg.norm(q / r**2, axis=1)
    return np.asarray(k0 * (k0 - 1) / np.maximum(k1, 1e-9))


def slab(p: Array, centre: tuple, half: tuple, round_: float) -> Array:
    """Return distances to a box with round edges."""
    q = np.abs(p - np.array(centre)) - np.array(half) + round_
    return np.asarray(np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0) - round_)


def join(k: float, *parts: Array) -> Array:
    """Return the smooth union (polynomial, width k) of distances."""
    total = parts[0]
    for part in parts[1:]:
        blend = np.maximum(k - np.abs(total - part), 0) / k
        total = np.minimum(total, part) - blend * blend * k / 4
    return total


def carve(k: float, body: Array, hollow: Array) -> Array:
    return -join(k, -body, hollow)


def ramp(share: Array) -> Array:
    share = np.clip(share, 0, 1)
    return np.asarray(share * share * (3 - 2 * share))


# -- parts -------------------------------------------------------------------------------------------------------------
def torso(p: Array, b: Build) -> Array:
    """Return the trunk under a shirt, down to the hips."""
    c, w, h = b.chest, b.waist, b.hips
    trunk = join(
        0.06,
        ball(p, (0, -0.025, -0.008), (0.168 + h, 0.125, 0.112 + 0.6 * h)),
        ball(p, (0, 0.10, 0.004 + 0.5 * w), (0.143 + w, 0.15, 0.096 + w)),
        ball(p, (0, 0.265, -0.006), (0.158 + c, 0.20, 0.106 + 0.6 * c)),
    )
    seat = ball(p, (0.072, -0.075, -0.058), (0.083 + h / 2, 0.09, 0.072 + h / 2))
    breast = ball(p, (0.072, 0.318 - 0.45 * b.bust, 0.066 + 0.3 * b.bust), (0.076, 0.058, 0.036 + b.bust))
    blade = ball(p, (0.078, 0.32, -0.070), (0.075, 0.10, 0.038))
    girdle = cone(p, (0.0, 0.385, -0.020), (0.150, 0.403, -0.010), 0.062, 0.045 + c / 2)
    slope = cone(p, (0.012, 0.470, -0.026), (0.135, 0.420, -0.014), 0.040, 0.033)
    return join(0.05, trunk, seat, breast, blade, girdle, slope)


def arm(p: Array, b: Build) -> Array:
    """Return a bare arm down to the wrist."""
    q, f, k = local(p, "left_shoulder"), local(p, "left_elbow"), b.limbs
    upper = join(
        0.03,
        ball(q, (0.028, -0.004, -0.002), (0.082, 0.047 * k, 0.052 * k)),
        cone(q, (0.03, 0, 0), (0.27, 0, 0), 0.046 * k, 0.036 * k),
        ball(q, (0.145, -0.002, 0.012), (0.085, 0.038 * k, 0.036 * k)),
        ball(q, (0.13, 0.0, -0.014), (0.10, 0.038 * k, 0.034 * k)),
    )
    lower = join(
        0.03,
        cone(f, (0.0, 0, 0), (0.235, 0, 0), 0.037 * k, 0.022),
        ball(f, (0.075, 0.0, 0.004), (0.095, 0.038 * k, 0.042 * k)),
        ball(f, (0.215, 0.0, 0.0), (0.06, 0.020, 0.027)),
    )
    return join(0.035, upper, lower)


FINGERS = ((0.009, 0.0295, 0.044, 0.040), (0.012, 0.0098, 0.048, 0.044), (0.009, -0.0100, 0.044, 0.041),
           (0.002, -0.0290, 0.034, 0.034))  # fmt: skip
"""Index to little finger, metres: the knuckle's x and z in the frame of the hand, and the lengths of two parts.

A hand is 0.108 of the stature long (Drillis and Contini 1966) and 0.048 wide (women in ANSUR II, men 0.050:
Gordon et al. 2014, NATICK/TR-15/007).
"""


def finger(p: Array, x: float, z: float, near: float, far: float) -> Array:
    """Return a finger at ease: bent by 8 and by 22 degrees, and a little away from its neighbours."""
    spread = 5.0 * z
    knuckle = np.array((x, 0.002, z))
    middle = knuckle + near * np.array((0.99, -0.14, spread))
    tip = middle + far * np.array((0.90, -0.38, 0.6 * spread))
    return join(0.004, cone(p, knuckle, middle, 0.0098, 0.0088), cone(p, middle, tip, 0.0088, 0.0076))


def hand(p: Array) -> Array:
    """Return a hand at ease, the thumb ahead; the palm looks down in the wrist's frame."""
    w, h = local(p, "left_wrist"), local(p, "left_hand")
    palm = join(
        0.02,
        slab(w, (0.047, 0.0, 0.0), (0.047, 0.0135, 0.040), 0.013),
        ball(w, (0.034, -0.009, 0.020), (0.034, 0.016, 0.018)),
        ball(w, (0.036, -0.008, -0.024), (0.036, 0.013, 0.014)),
        ball(w, (-0.005, 0.0, 0.0), (0.03, 0.018, 0.026)),
    )
    thumb = join(
        0.006,
        cone(w, (0.014, -0.006, 0.022), (0.052, -0.018, 0.049), 0.0155, 0.0118),
        cone(w, (0.052, -0.018, 0.049), (0.080, -0.026, 0.060), 0.0112, 0.0100),
        cone(w, (0.080, -0.026, 0.060), (0.101, -0.033, 0.061), 0.0100, 0.0075),
    )
    # The blend between fingers fills gaps of less than 4 mm: webs, and no folds that a triangle cannot follow.
    return join(0.012, join(0.008, palm, join(0.008, *(finger(h, *one) for one in FINGERS))), thumb)


def leg(p: Array, b: Build) -> Array:
    """Return a leg in trousers, down to where it enters the shoe."""
    q, s, k = local(p, "left_hip"), local(p, "left_knee"), b.limbs
    thigh = join(
        0.05,
        cone(q, (0.0, -0.02, -0.004), (0.0, -0.39, 0.002), 0.084 * k, 0.055 * k),
        ball(q, (0.004, -0.16, 0.014), (0.074 * k, 0.20, 0.072 * k)),
        ball(q, (0.012, -0.06, -0.006), (0.080 * k, 0.15, 0.085 * k)),
    )
    # Girths of calf and ankle are 0.22 and 0.13 of the stature (ANSUR II); the calf is fullest at a third of the shin.
    shank = join(
        0.03,
        cone(s, (0.0, 0.0, 0.002), (0.0, -0.385, -0.012), 0.054 * k, 0.041 * k),
        ball(s, (-0.012, -0.135, -0.026), (0.045 * k, 0.125, 0.046 * k)),
        ball(s, (0.014, -0.120, -0.024), (0.044 * k, 0.115, 0.044 * k)),
        ball(s, (0.0, 0.005, 0.014), (0.044 * k, 0.05, 0.046 * k)),
    )
    return join(0.05, thigh, shank)


def ankle(p: Array, b: Build) -> Array:
    """Return the bare ankle between trousers and shoe."""
    a, k = local(p, "left_ankle"), b.limbs
    shaft = cone(a, (0, 0.09, -0.008), (0, -0.03, -0.004), 0.034 * k, 0.033 * k)
    return join(0.015, shaft, cone(a, (0, 0.09, -0.030), (0, -0.02, -0.034), 0.014 * k, 0.012 * k))


def shoe(p: Array) -> Array:
    """Return a shoe with a flat sole."""
    a, f = local(p, "left_ankle"), local(p, "left_foot")
    upper = join(
        0.03,
        ball(a, (0, -0.043, -0.020), (0.038, 0.046, 0.047)),
        cone(a, (0, -0.036, 0.005), (0.002, -0.052, 0.115), 0.040, 0.033),
        ball(f, (0.001, -0.002, 0.030), (0.043, 0.034, 0.068)),
    )
    outline = join(
        0.05,
        ball(a * [1, 0, 1], (0, 0, -0.020), (0.038, 1, 0.042)),
        cone(a * [1, 0, 1], (0, 0, -0.01), (0.001, 0, 0.10), 0.036, 0.038),
        ball(a * [1, 0, 1], (0.001, 0, 0.160), (0.0455, 1, 0.066)),
    )
    height = a[:, 1] + 0.0748
    sole = np.maximum(outline - 0.002, np.abs(height - 0.0115) - 0.0115)
    return join(0.006, np.maximum(upper, -height), sole)


def face(p: Array, b: Build) -> Array:
    """Return head and neck without hair."""
    h = local(p, "head")
    skull = join(
        0.035,
        ball(h, (0, 0.120, -0.004), (0.0755, 0.089, 0.096)),
        ball(h, (0, 0.070, 0.034), (0.0650, 0.082, 0.060)),
        ball(h, (0, 0.022, 0.044), (0.048 * b.jaw, 0.046, 0.046)),
        ball(h, (0.036, 0.022, 0.010), (0.024 * b.jaw, 0.036, 0.046), (-0.3, 0, 0)),
    )
    chin = ball(h, (0, -0.012, 0.076), (0.020 * b.jaw, 0.016, 0.015))
    cheek = ball(h, (0.038, 0.060, 0.060), (0.022, 0.020, 0.020))
    brow = ball(h, (0.026, 0.103, 0.082), (0.028, 0.009, 0.012), (0, 0.35, 0))
    skull = join(0.022, skull, chin, cheek, brow)
    skull = carve(0.016, skull, ball(h, (0.033, 0.082, 0.106), (0.019, 0.013, 0.014)))
    eye = ball(h, (0.0315, 0.082, 0.078), (0.0135, 0.0135, 0.0135))
    nose = join(
        0.010,
        cone(h, (0, 0.088, 0.094), (0, 0.052, 0.112), 0.0065, 0.0095),
        ball(h, (0.0095, 0.048, 0.101), (0.0075, 0.0065, 0.0085)),
    )
    lips = join(
        0.006,
        ball(h, (0, 0.0215, 0.0915), (0.022, 0.0050, 0.0075)),
        ball(h, (0, 0.0140, 0.0905), (0.018, 0.0055, 0.0072)),
    )
    skull = join(0.003, join(0.012, skull, nose), eye)
    skull = join(0.008, skull, lips)
    ear = ball(h, (0.0775, 0.074, -0.008), (0.0085, 0.031, 0.018), (0.15, 0.35, -0.12))
    ear = carve(0.006, ear, ball(h, (0.088, 0.077, -0.004), (0.0060, 0.018, 0.009), (0.15, 0.35, -0.12)))
    neck = cone(p, (0, 0.40, -0.022), (0, 0.555, -0.006), 0.051 * b.neck, 0.046 * b.neck)
    head = skull if b.hair == "long" else join(0.008, skull, ear)
    return join(0.024, head, neck)


def hairline(p: Array, b: Build) -> Array:
    """Return metres above the line where the hair begins; positive is hair."""
    h = local(p, "head")
    y, z = h[:, 1], h[:, 2]
    low, front = {"short": (0.035, 0.005), "bun": (0.03, 0.005), "long": (-0.10, 0.018), "bald": (1.0, 0)}[b.hair]
    burn = 0.0 if b.hair == "long" else 0.03
    temple = low + burn * ramp((z + 0.03) / 0.02) + (0.150 - low - burn) * ramp((z - front) / 0.060)
    return np.asarray(y - temple - 0.012 * ramp((np.abs(h[:, 0]) - 0.02) / 0.05) * (z > 0.04))


def hair(p: Array, b: Build) -> Array:
    h = local(p, "head")
    cap = ball(h, (0, 0.124, -0.006), (0.0835, 0.0955, 0.1045))
    cap = join(0.03, cap, ball(h, (0.0, 0.190, 0.038), (0.050, 0.028, 0.052), (0.3, 0, 0)))
    if b.hair == "bun":
        cap = join(0.012, cap, ball(h, (0, 0.175, -0.105), (0.040, 0.036, 0.038)))
    if b.hair == "long":
        cap = join(0.04, cap, ball(h, (0, 0.045, -0.066), (0.074, 0.085, 0.046)))
        cap = join(0.03, cap, ball(h, (0, -0.020, -0.068), (0.070, 0.060, 0.034)))
        cap = join(0.03, cap, ball(h, (0.064, 0.040, -0.022), (0.024, 0.085, 0.050)))
    return -join(0.012, -cap, hairline(p, b) + 0.002)


SLEEVE, HEM, CUFF, SOLE = 0.165, -0.018, -0.345, 0.021
"""Where cloth ends: the sleeve along the upper arm; shirt and sole by height; the trousers along the shin."""


def mirrored(part: Callable[[Array, Build], Array], points: Array, b: Build, width: float) -> Array:
    """Return the distances of a part and its mirror image, blended where the two meet."""
    near, found = points[:, 0] < 0.1, part(points, b)
    found[near] = join(width, found[near], part(points[near] * [-1, 1, 1], b))
    return found


def layers(points: Array, b: Build, steep: float = 1.0) -> dict[str, Array]:
    """Return the (N,) distances to each piece of a clothed body. points: x >= 0, bind pose, pelvis at the origin.

    steep: Slope of the planes at which cloth ends; a steep one makes straight borders.
    """
    trunk, bare, thigh = mirrored(torso, points, b, 0.03), arm(points, b), mirrored(leg, points, b, 0.02)
    along, down = local(points, "left_shoulder")[:, 0] - SLEEVE, CUFF - local(points, "left_knee")[:, 1]
    below = HEM - points[:, 1]
    sleeve = np.maximum(bare - 0.007, steep * along)
    limb = np.maximum(join(0.012, bare, hand(points)), -steep * along if steep > 1 else -1.0)
    bare_ankle = np.maximum(ankle(points, b), -steep * down if steep > 1 else -1.0)
    found = {
        "shirt": np.maximum(join(0.055, join(0.05, trunk, thigh) - 0.004, sleeve), steep * below),
        "trousers": np.max([join(0.05, trunk, thigh), steep * down - 0.002, -steep * below - 0.1 / steep], axis=0),
        "shoes": shoe(points),
        "skin": np.min([limb, bare_ankle, mirrored(face, points, b, 0.012)], axis=0),
    }
    if b.hair != "bald":
        found["hair"] = mirrored(hair, points, b, 0.01)
    return found


def body(points: Array, b: Build) -> Array:
    """Return (N,) distances to the clothed body."""
    return join(0.005, *layers(points, b).values())
