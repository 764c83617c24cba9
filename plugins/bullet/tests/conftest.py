"""A workshop for small scenes, and motions that are easy to reason about."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from humanclaw.body import JOINT_INDEX, OFFSETS, SOLE
from humanclaw.pose import FPS, Motion, rest_pose
from humanclaw_bullet.simulator import HalfPhysics
from humanclaw_bullet.workshop import Workshop

THIGH = float(-OFFSETS[JOINT_INDEX["left_knee"]][1])
SHIN = float(-OFFSETS[JOINT_INDEX["left_ankle"]][1])
HIP_DROP = float(-OFFSETS[JOINT_INDEX["left_hip"]][1])


@dataclass(frozen=True)
class Played:
    commanded: Motion
    realised: Motion
    contacts: tuple
    touches: tuple
    objects: dict

    def touched(self, thing):
        return [contact for contact in self.contacts if contact.object_id == thing]


@pytest.fixture
def workshop():
    return Workshop()


@pytest.fixture
def play():
    """Drive a body through a motion in chunks of half a second, each begun where the one before has ended."""

    def run(scene, motion, profile="default"):
        simulator = HalfPhysics(profile)
        here = simulator.reset(scene, scene.start).body
        origin, chunks = here.root[0] * [0, 1, 0], []
        for first in range(0, len(motion), 15):
            piece = motion[first : first + 15]
            gap = (here.root[-1] - origin) * [1, 0, 1]
            chunks.append(simulator.execute(Motion(piece.root + gap, piece.rotations)))
            here, origin = chunks[-1].realised, piece.root[-1]
        objects = simulator.state().objects
        simulator.close()
        realised = Motion(
            *(np.concatenate([getattr(c.realised, part) for c in chunks]) for part in ("root", "rotations"))
        )
        contacts, touches = (tuple(x for c in chunks for x in getattr(c, part)) for part in ("contacts", "touches"))
        return Played(motion, realised, contacts, touches, objects)

    return run


def _hold(motion, frames):
    return motion.then(Motion(np.repeat(motion.root[-1:], frames, 0), np.repeat(motion.rotations[-1:], frames, 0)))


def _bent(pelvis, ankles):
    """Rotations of a body whose left and right ankle are at given points (y, z), arms hanging, soles level."""
    rotations = rest_pose().rotations[0].copy()
    for side, (y, z) in zip(("left", "right"), ankles, strict=True):
        down, ahead = pelvis[1] - HIP_DROP - y, z - pelvis[2]
        reach = min(np.hypot(down, ahead), THIGH + SHIN - 1e-4)
        knee = np.pi - np.arccos((THIGH**2 + SHIN**2 - reach**2) / (2 * THIGH * SHIN))
        hip = -np.arctan2(ahead, down) - np.arccos((THIGH**2 + reach**2 - SHIN**2) / (2 * THIGH * reach))
        for joint, angle in (("hip", hip), ("knee", knee), ("ankle", -hip - knee)):
            rotations[JOINT_INDEX[f"{side}_{joint}"], 0] = angle
    return rotations


@pytest.fixture
def glide():
    """Standing, moved at a constant velocity (x, z) in m/s: the simplest command with a known path."""

    def make(velocity, frames=15):
        motion = rest_pose(frames)
        path = np.arange(1, frames + 1)[:, None] / FPS * [velocity[0], 0.0, velocity[1]]
        return Motion(motion.root + path, motion.rotations)

    return make


@pytest.fixture
def gait():
    """Steps forward from standing, one foot after the other, each rise metres above the last; a step is 0.6 s and run metres."""

    def make(count, run, rise=0.0, first=0.45):
        feet, pelvis = [np.zeros(3), np.zeros(3)], np.array([0.0, 0.93, 0.0])
        roots, turns = [], []
        for step in range(count + 1):
            moving, start, from_pelvis = step % 2, feet[step % 2], pelvis
            goal = np.array([0.0, rise * min(step + 1, count), first + run * min(step, count - 1)])
            other = feet[1 - moving]
            over = np.array(
                [0.0, min(goal[1], other[1]) + 0.93, goal[2] if step == count else (goal[2] + other[2]) / 2]
            )
            for t in np.arange(1, 19) / 18:
                smooth = t * t * (3 - 2 * t)
                foot = start + (goal - start) * smooth
                foot[1] = start[1] + (goal[1] - start[1]) * min(1.0, 1.6 * smooth) + 0.06 * np.sin(np.pi * t)
                feet[moving], pelvis = foot, from_pelvis + (over - from_pelvis) * smooth
                roots.append(pelvis)
                turns.append(_bent(pelvis, [foot[1:] + [SOLE, 0] for foot in feet]))
        return _hold(Motion(np.array(roots), np.array(turns)), 15 + (-len(roots)) % 15)

    return make


@pytest.fixture
def sitting_down():
    """From standing, in 1.5 s, to a pelvis over the place (height, z), feet where they were; then 1 s of sitting."""

    def make(height, z):
        share = (np.arange(1, 46) / 45)[:, None]
        standing, seated = np.array([0.0, 0.96, 0.0]), np.array([0.0, height, z])
        roots = standing + (seated - standing) * share
        turns = np.array([_bent(root, [(SOLE, 0.0)] * 2) for root in roots])
        return _hold(Motion(roots, turns), 30)

    return make
