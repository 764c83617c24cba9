"""Compare the steps of a record with its own motion. Nothing is simulated, so it takes milliseconds an episode."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from humanclaw import RecordedEpisode, StepRecord
from humanclaw.body import HISTORY, Array
from humanclaw.world import distance_to_nearest

_SAME: Final = 0.005
"""Metres by which a recorded place may differ from the motion's: records are rounded."""
_FASTEST: Final = 0.6
"""Largest way of the hips in a frame, metres: half-physics caps a fall at 15 m/s and a sprint at 6 m/s."""


def contradicted(recorded: RecordedEpisode) -> Iterator[str]:
    """Yield what the motion of an episode contradicts: places and distances of its steps, and jumps between frames.

    Nothing for a record without motion. Raises RecordError if the motion cannot be read.
    """
    if not recorded.has_motion:
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
        yield from _distant(step, motion[last - 1 : last].joints())
        frame = last


def _misplaced(step: StepRecord, start: Array, end: Array) -> Iterator[str]:
    for name, told, real in (("begins", step.start, start), ("ends", step.end, end)):
        gap = float(np.linalg.norm(np.array(told) - real))
        if gap > _SAME:
            yield f"step {step.step} {name} {gap:.2f} m from where its motion does"


def _distant(step: StepRecord, joints: Array) -> Iterator[str]:
    if step.target_distance is None or not step.targets:
        return
    boxes = [(np.array(low), np.array(high)) for low, high in step.targets.values()]
    real = distance_to_nearest(joints[0], boxes)
    if abs(real - step.target_distance) > _SAME:
        yield f"step {step.step} tells {step.target_distance:.2f} m to the target, its motion {real:.2f} m"
