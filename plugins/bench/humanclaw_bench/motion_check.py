"""Compare the steps of a record with its own motion. Nothing is simulated, so it takes milliseconds an episode."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Final

import numpy as np

from humanclaw import RecordedEpisode, RecordError, StepRecord
from humanclaw.body import HISTORY, Array
from humanclaw.records import Vec3
from humanclaw.world import distance_to_nearest
from humanclaw_bench.scores import ended

_SAME: Final = 0.005
"""Metres by which a recorded place may differ from the motion's: records are rounded."""
_PELVIS: Final = 0.25
"""Farthest distance of the pelvis joint from what its link touches, metres."""
_FASTEST: Final = 0.6
"""Largest way of the hips in a frame, metres: half-physics caps a fall at 15 m/s and a sprint at 6 m/s."""


def moved(episodes: Iterable[RecordedEpisode]) -> Iterator[str]:
    """Yield of each record the first contradiction to its own motion, or that this cannot be read."""
    for one in episodes:
        try:
            yield from (f"{one.folder}: {fault}." for fault in islice(contradicted(one), 1))
        except RecordError as error:
            yield error.message


def contradicted(recorded: RecordedEpisode) -> Iterator[str]:
    """Yield what the motion of an episode contradicts: places, distances, seats, and jumps between frames.

    An episode that did not end may have no motion. Raises RecordError if the motion cannot be read.
    """
    if not recorded.has_motion:
        if ended(recorded.record.outcome, recorded.record.limit):
            yield "it ended, and its motion is missing"
        return
    motion, frame = recorded.motion("simulated"), HISTORY
    if len(motion) != HISTORY + sum(step.motion_frames for step in recorded.steps):
        yield f"its steps last {sum(step.motion_frames for step in recorded.steps)} frames, its motion another time"
        return
    jumps = np.linalg.norm(np.diff(motion.root[HISTORY - 1 :], axis=0), axis=1)
    if jumps.max(initial=0.0) > _FASTEST:
        yield f"its body jumps by {jumps.max():.2f} m in frame {int(jumps.argmax()) + 1}"
    for step in recorded.steps:
        last = frame + step.motion_frames
        yield from _misplaced(step, motion.root[frame - 1], motion.root[last - 1])
        joints = motion[last - 1 : last].joints()[0]
        yield from _distant(step, joints)
        yield from _off_seat(step, joints[:1])
        frame = last


def _misplaced(step: StepRecord, start: Array, end: Array) -> Iterator[str]:
    for name, told, real in (("begins", step.start, start), ("ends", step.end, end)):
        gap = float(np.linalg.norm(np.array(told) - real))
        if gap > _SAME:
            yield f"step {step.step} {name} {gap:.2f} m from where its motion does"


def _distant(step: StepRecord, joints: Array) -> Iterator[str]:
    if step.target_distance is None or not step.targets:
        return
    real = _distance(joints, step.targets.values())
    if abs(real - step.target_distance) > _SAME:
        yield f"step {step.step} tells {step.target_distance:.2f} m to the target, its motion {real:.2f} m"


def _off_seat(step: StepRecord, pelvis: Array) -> Iterator[str]:
    for key in sorted(step.targets.keys() & {*step.pelvis_contacts}):
        gap = _distance(pelvis, [step.targets[key]])
        if gap > _PELVIS:
            yield f"step {step.step} has the pelvis on target {key}, its motion {gap:.2f} m from it"


def _distance(points: Array, boxes: Iterable[tuple[Vec3, Vec3]]) -> float:
    return float(distance_to_nearest(points, [(np.array(low), np.array(high)) for low, high in boxes]))
