"""The current step: its view, the submitted calls, the seconds of each stage, and the measured record."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from humanclaw.body.pose import Array
from humanclaw.episodes.execution import SkillExecution
from humanclaw.records.decisions import Attempt, Verdict
from humanclaw.records.feedback import Feedback
from humanclaw.records.steps import StepRecord
from humanclaw.skills.call import Call
from humanclaw.world.scene import Scene, Vec3, distance_to_nearest
from humanclaw.world.simulator import Chunk, Contact, DistanceFn, Execution, WorldState, person_id
from humanclaw.world.view import View


@dataclass
class Step:
    """A step from its first view to its record."""

    number: int
    attempts: list[Attempt] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)
    view: View | None = None
    """The view that the decision is made from; drawn once."""
    frame_file: str = ""
    jpeg: bytes = b""
    """The view as the record keeps it."""
    asked: float | None = None
    """Time at which the agent was asked; None if no question is open."""

    def ask(self) -> None:
        """Start the clock of a question."""
        self.asked = time.perf_counter()

    def answered(self, part: str) -> None:
        """Enter the time of the open question, if there is one."""
        if self.asked is not None:
            self._add(part, time.perf_counter() - self.asked)
            self.asked = None

    @contextmanager
    def timed(self, part: str) -> Iterator[None]:
        """Enter the time of the block."""
        began = time.perf_counter()
        yield
        self._add(part, time.perf_counter() - began)

    def _add(self, part: str, seconds: float) -> None:
        self.seconds[part] = self.seconds.get(part, 0.0) + seconds

    def record(
        self,
        view: View,
        scene: Scene,
        targets: Sequence[int],
        before: WorldState,
        after: WorldState,
        *,
        call: Call | None,
        verdict: Verdict | None,
        done: SkillExecution | None,
        resting: tuple[int, ...],
        geodesic: float | None,
        partner: bool = False,
    ) -> StepRecord:
        """Return the record of the step.

        Args:
            view: the view that the decision was made from.
            call: the executed call; None if there was none.
            done: the motion of the call; None without motion: of no call, and of an active stop.
            resting: ids that the pelvis touched when the last motion ended.
            geodesic: remaining shortest way to a target, metres.
            partner: whether the second body is looked for, too.
        """
        chunks, feedback = (done.chunks, done.feedback) if done else ((), Feedback())
        return StepRecord(
            step=self.number,
            status=("executed" if done else "stopped") if call else "invalid",
            attempts=tuple(self.attempts),
            verdict=verdict,
            call=call,
            target_pixels={key: int((view.ids == key).sum()) for key in (*targets, *[person_id(1)] * partner)},
            frame_file=self.frame_file,
            motion_frames=sum(len(chunk.commanded) for chunk in chunks),
            rise_frames=done.rise_frames if done else 0,
            parts=done.parts if done else (),
            held=dict(after.held),
            aims=done.aims if done else (),
            joints=joint_states(scene, chunks),
            **feedback.felt,
            waypoints=tuple(vec3(chunk.execution.simulated.root[-1]) for chunk in chunks[:-1]),
            start=vec3(before.body.root[-1]),
            end=vec3(after.body.root[-1]),
            yaw_start=yaw(before),
            yaw_end=yaw(after),
            contacts=contacts(chunks),
            touches=touches(chunks),
            targets=target_boxes(scene, targets, after),
            target_distance=target_distance(scene, targets, after),
            pelvis_contacts=pelvis_contacts(chunks) if chunks else resting,
            geodesic=geodesic,
            seconds={part: round(seconds, 4) for part, seconds in self.seconds.items()},
        )


# -- a moment ----------------------------------------------------------------------------------------------------------
def vec3(point: Array) -> Vec3:
    """Round a point (3,) to hundredths of a millimetre."""
    x, y, z = (round(float(value), 5) for value in point)
    return x, y, z


def yaw(state: WorldState) -> float:
    """Return the heading of the body, radians."""
    return float(state.body.yaw()[-1])


def distance_to_goal(state: WorldState, distance: DistanceFn | None) -> float | None:
    """Return the shortest way from the pelvis to a target, metres; None if it is not measured or there is none."""
    metres = distance(state.body.root[-1]) if distance else float("inf")
    return round(metres, 3) if np.isfinite(metres) else None


def target_boxes(scene: Scene, targets: Sequence[int], state: WorldState) -> dict[int, tuple[Vec3, Vec3]]:
    """Return the current bounding box of each target, metres. Most chairs can be pushed, so boxes move."""
    boxes = {key: scene.aabb(key, state.objects.get(key)) for key in targets}
    return {key: (vec3(low), vec3(high)) for key, (low, high) in boxes.items()}


def target_distance(scene: Scene, targets: Sequence[int], state: WorldState) -> float | None:
    """Return the distance from the nearest joint (pelvis, root, link origins) to the nearest target's box, metres."""
    if not targets:
        return None
    boxes = [scene.aabb(key, state.objects.get(key)) for key in targets]
    return distance_to_nearest(state.body[-1:].joints(), boxes)


# -- a step ------------------------------------------------------------------------------------------------------------
def contacts(chunks: Sequence[Chunk]) -> tuple[Contact, ...]:
    """Merge contacts to one for each pair of joint and object; frames count from the first of the step."""
    pairs: dict[tuple[str, int], list[tuple[int, Contact]]] = {}
    for start, part in _timed(chunks):
        for contact in part.contacts:
            pairs.setdefault((contact.joint, contact.object_id), []).append((start, contact))
    return tuple(_gathered(meetings) for _, meetings in sorted(pairs.items(), key=lambda item: item[0]))


def _gathered(meetings: Sequence[tuple[int, Contact]]) -> Contact:
    first = meetings[0][1]
    return Contact(
        tuple(sorted({start + frame for start, contact in meetings for frame in contact.frames})),
        first.joint,
        first.group,
        first.object_id,
        first.movable,
        depth=round(max(contact.depth for _, contact in meetings), 5),
        height=round(max(contact.height for _, contact in meetings), 4),
    )


def touches(chunks: Sequence[Chunk]) -> tuple[tuple[int, int, int], ...]:
    """Return (frame of the step, object, object) for each touch of a movable object and another."""
    return tuple((start + frame, a, b) for start, part in _timed(chunks) for frame, a, b in part.touches)


def joint_states(scene: Scene, chunks: Sequence[Chunk]) -> dict[int, float]:
    """Return the state of each object on a joint that moved, at the end of it."""
    paths = {key: path for chunk in chunks for key, path in chunk.execution.objects.items()}
    hung = {key: path for key, path in paths.items() if scene.by_id[key].joint}
    return {key: round(scene.by_id[key].state_at(path[-1]), 5) for key, path in sorted(hung.items())}


def pelvis_contacts(chunks: Sequence[Chunk]) -> tuple[int, ...]:
    """Return the ids of the objects that the pelvis touches in the last frame."""
    if not chunks:
        return ()
    last = chunks[-1].execution
    frame = len(last.simulated) - 1
    return tuple(sorted({c.object_id for c in last.contacts if c.joint == "pelvis" and frame in c.frames}))


def _timed(chunks: Sequence[Chunk]) -> Iterator[tuple[int, Execution]]:
    """Yield each chunk's first frame within the step, and its execution."""
    start = 0
    for chunk in chunks:
        yield start, chunk.execution
        start += len(chunk.commanded)
