"""Episode records of a walker's steps, for the tests of reports."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from declared import INFOS
from PIL import Image
from rooms import two_rooms
from walker import PICTURE, SKILLS, Walker

from humanclaw.body import HISTORY, Motion, rest_pose
from humanclaw.plugins import EpisodeContext, HistoryEntry, Observation
from humanclaw.records import (
    Answer,
    Attempt,
    Decision,
    EpisodeRecord,
    EpisodeSpec,
    EpisodeWriter,
    Feedback,
    RecordedEpisode,
    StepRecord,
    Verdict,
    write_record,
)
from humanclaw.skills import Call
from humanclaw.world import GROUND, Contact, Scene, distance_to_box
from humanclaw_scripted.oracle import OracleAgent


def picture(step: int) -> bytes:
    """Return a view that differs from step to step."""
    ramp = np.linspace(40, 220, 256)
    rgb = np.stack([np.tile(ramp, (256, 1)), np.tile(ramp[:, None], (1, 256)), np.full((256, 256), 9 * step % 256)], -1)
    buffer = io.BytesIO()
    Image.fromarray(rgb.astype(np.uint8)).save(buffer, "JPEG")
    return buffer.getvalue()


def foot(obj: int, height: float) -> Contact:
    """Return a contact of the left ankle with an object at a height in the world, metres."""
    return Contact(
        joint="left_ankle", group="leg_foot", object_id=obj, movable=False, frames=(14,), depth=0.004, height=height
    )


def record_episode(
    folder: Path,
    scene: Scene | None = None,
    *,
    instruction: str = "",
    name: str = "couch-0",
    targets: tuple[int, ...] = (20,),
    settings: dict[str, dict[str, object]] | None = None,
) -> Scene:
    """Let the oracle walk to a seat, sit down and stop; write the records that the loop would write."""
    scene = scene or two_rooms()
    record = _record(scene, instruction, name, targets, settings or {})
    writer, walker, oracle = EpisodeWriter(folder, record), Walker(scene, targets), OracleAgent()
    writer.open()
    oracle.begin(EpisodeContext(record.spec, SKILLS, 0, scene, walker.state))
    history: list[HistoryEntry] = []
    heights = [walker.ground + walker.height] * HISTORY
    for number in range(100):
        before, first = walker.state().body, len(walker.track)
        decision = oracle.decide(Observation(number, record.spec.instruction, PICTURE), history)
        walker.execute(decision.calls[0])
        history.append(HistoryEntry(number, decision, Feedback(decision.calls[0]), PICTURE))
        walker.track += [(walker.x, walker.z)] * max(0, 15 - len(walker.track) + first)
        walker.track[first:] = walker.track[first:][-15:]
        heights += [walker.ground + walker.height] * 15
        frame = writer.frame(f"{number:04d}.jpg", picture(number))
        writer.keep(_step(record, number, decision, walker, before, frame))
        if decision.calls[0].skill == "stop":
            break
    track = np.array([(scene.start.x, scene.start.z)] * HISTORY + walker.track)
    motion = Motion(np.stack([track[:, 0], heights, track[:, 1]], -1), rest_pose(len(track)).rotations)
    kinds, parts = ("generated", "simulated"), ("root", "rotations")
    writer.move({f"{kind}_{part}": getattr(motion, part) for kind in kinds for part in parts})
    writer.end(record.model_copy(update={"outcome": "stopped", "steps": number + 1}))
    return scene


def _record(
    scene: Scene, instruction: str, name: str, targets: tuple[int, ...], settings: dict[str, dict[str, object]]
) -> EpisodeRecord:
    spec = EpisodeSpec(
        id=name, instruction=instruction or "find a couch, navigate to it with zero distance, and finally sit on it.",
        scene=scene.name, target_category=scene.by_id[targets[0]].category, target_ids=targets, interact=True,
        start=scene.start,
    )  # fmt: skip
    boxes = {key: scene.aabb(key) for key in targets}
    return EpisodeRecord(
        spec=spec, start=scene.start, agent="oracle", verifier="geometry", versions={"humanclaw": "0"},
        weights={"base": "abc"}, scene_digest=scene.digest,
        targets={key: (tuple(low), tuple(high)) for key, (low, high) in boxes.items()}, skills=INFOS,
        created="2026-01-01T00:00:00+00:00", settings=settings,
        ground=tuple(o.id for o in scene.objects if o.category in GROUND),
    )  # fmt: skip


def _step(
    record: EpisodeRecord, number: int, decision: Decision, walker: Walker, before: Motion, frame: str
) -> StepRecord:
    """Return the record of a step. The verifier replaces the call of step 3."""
    call, after, passed = decision.calls[0], walker.state().body, number != 3
    nearest, (low, high) = next(iter(record.targets.items()))
    return StepRecord(
        step=number, status="stopped" if call.skill == "stop" else "executed", attempts=(Attempt(decision),),
        verdict=Verdict(accepted=passed,
                        replacement=None if passed else Call(skill="walk", params={"z_cm": 60}),
                        answers=(Answer(check="clear", passed=passed, note="too far"),)),
        call=Call(skill=call.skill, params=dict(call.params) if passed else {"z_cm": 60}),
        motion_frames=15,
        frame_file=frame,
        start=tuple(before.root[-1]), end=tuple(after.root[-1]),
        yaw_start=float(before.yaw()[-1]), yaw_end=float(after.yaw()[-1]),
        target_pixels={nearest: 3000 if "A couch" in decision.visible_state else 0},
        target_distance=float(distance_to_box(after.joints()[-1], np.array(low), np.array(high)).min()),
        pelvis_contacts=(nearest,) if walker.sat else (),
        contacts=(foot(record.ground[0], walker.ground), *([foot(nearest, 0.3)] if number > 17 else [])),
        seconds={"observe": 0.08, "decide": 0.01, "verify": 0.02, "generate": 0.09, "simulate": 0.12},
    )  # fmt: skip


def broken_off(folder: Path, **changes: Any) -> None:
    """Turn a closed record into one of a run that broke off, without the digests of its files."""
    record = RecordedEpisode(folder).record
    write_record(folder, record.model_copy(update={"outcome": "running", "files": {}} | changes))
