"""Episode records written by hand, one step a line, for the tests of metrics and root causes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from declared import INFOS

from humanclaw.body import HISTORY, STANDING_HEIGHT, Motion, Pose2D, rest_pose
from humanclaw.records import Attempt, Decision, EpisodeRecord, EpisodeSpec, EpisodeWriter, RecordedEpisode, StepRecord
from humanclaw.skills import Call
from humanclaw.world import Contact

COUCH, LAMP, VASE, BOOK, TABLE = 20, 31, 32, 33, 40
"""The couch is the target; lamp, vase and book can be moved; the table is fixed."""
NOWHERE = (0.0, 0.0, 0.0)
"""The place of a step that names none."""
COUCH_BOX = ((5.0, 0.0, -1.0), (6.0, 0.8, 1.0))


def touch(obj: int, *frames: int, joint: str = "left_knee", group: str = "leg_foot", height: float = 0.5) -> Contact:
    return Contact(
        joint=joint, group=group, object_id=obj, movable=obj in (LAMP, VASE, BOOK), frames=frames or (0,), depth=0.001,
        height=height,
    )  # fmt: skip


def step(skill: str = "walk", says: str = "", pixels: int = 0, *, away: float | None = 4.0, **more: Any) -> StepRecord:
    """Return the record of a step. away: distance to the target after it, metres.

    The skill "stop" ends the episode, and "" stands for an invalid call: nothing moves.
    """
    params = more.pop("params", {"walk": {"z_cm": 40}, "turn_in_place": {"yaw_deg": 30}}.get(skill, {}))
    status = {"stop": "stopped", "": "invalid"}.get(skill, "executed")
    written: dict[str, Any] = {
        "target_pixels": {COUCH: pixels}, "motion_frames": 15 if skill not in ("", "stop") else 0,
        "target_distance": away,
        "attempts": (Attempt(Decision(visible_state=says)),), "call": Call(skill=skill,
        params=params) if skill else None,
    }  # fmt: skip
    return StepRecord(step=0, status=status, **(written | more))


def stuck(count: int, **more: object) -> list[StepRecord]:
    """Return walking calls that move the body by 9 cm each."""
    return [step(start=(0.09 * k, 1, 0), end=(0.09 * k + 0.09, 1, 0), geodesic=4.0, **more) for k in range(count)]


def pacing(count: int, width: float, **more: object) -> list[StepRecord]:
    """Return walking calls back and forth between x = 0 and `width` metres."""
    ends = [(0.0, 1.0, 0.0), (width, 1.0, 0.0)]
    return [step(start=ends[k % 2], end=ends[(k + 1) % 2], geodesic=4.0, **more) for k in range(count)]


def roaming(count: int, **more: object) -> list[StepRecord]:
    """Return walking calls that move the body by 40 cm each."""
    return [step(start=(0.4 * k, 1, 0), end=(0.4 * k + 0.4, 1, 0), **({"geodesic": 4.0} | more)) for k in range(count)]


def placed(steps: Sequence[StepRecord]) -> list[StepRecord]:
    here, records = (0.0, STANDING_HEIGHT, 0.0), []
    for row in steps:
        start = here if row.start == NOWHERE else row.start
        here = start if row.end == NOWHERE else row.end
        records.append(row.model_copy(update={"start": start, "end": here}))
    return records


def gliding(steps: Sequence[StepRecord]) -> Motion:
    motion, frame = rest_pose(HISTORY + sum(row.motion_frames for row in steps)), HISTORY
    for row in steps:
        share = np.linspace(0.0, 1.0, row.motion_frames + 1)[1:, None]
        motion.root[frame : frame + row.motion_frames] = np.array(row.start) * (1 - share) + np.array(row.end) * share
        frame += row.motion_frames
    return motion


def rollout(
    folder: Path, steps: Sequence[StepRecord], *, name: str = "one", outcome: str = "", interact: bool = True,
    category: str = "couch", motion: tuple[Motion, Motion] | None = None, objects: dict[int, np.ndarray] | None = None,
    max_steps: int = 100, agent: str = "model", **record: Any,
) -> RecordedEpisode:  # fmt: skip
    """Write an episode and read it back. motion: generated and simulated frames; by default the body glides from place
    to place of the steps. Steps that name no place begin where the one before them ends, and stay there."""
    steps = placed(steps)
    fields = {
        "start": Pose2D(x=0, z=0, yaw=0), "targets": {COUCH: COUCH_BOX} if category else {}, "scene_digest": "abc",
        "movable": (LAMP, VASE, BOOK), "skills": INFOS,
    } | record  # fmt: skip
    spec = EpisodeSpec(
        id=name, instruction="find a couch", scene="test:rooms", target_category=category,
        target_ids=tuple(fields["targets"]), interact=interact, max_steps=max_steps,
    )  # fmt: skip
    begun = EpisodeRecord(spec=spec, agent=agent, **fields)
    writer = EpisodeWriter(folder / name, begun)
    writer.steps += [step.model_copy(update={"step": k}) for k, step in enumerate(steps)]
    writer.open()
    still = gliding(steps)
    arrays = {f"object_{key}": path for key, path in (objects or {}).items()}
    for kind, frames in zip(("generated", "simulated"), motion or (still, still), strict=True):
        arrays |= {f"{kind}_root": frames.root, f"{kind}_rotations": frames.rotations}
    ending = outcome or ("stopped" if steps and steps[-1].status == "stopped" else "out_of_steps")
    writer.move(arrays)
    writer.end(begun.model_copy(update={"outcome": ending, "steps": len(steps)}))
    return RecordedEpisode(folder / name)
