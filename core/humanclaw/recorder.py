"""From the values of the loop to the records that are kept of them."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

import humanclaw
from humanclaw import pictures
from humanclaw.embodiment import Body, Deed
from humanclaw.episode import EpisodeSpec, StartPose
from humanclaw.geometry import distance_to_nearest
from humanclaw.interfaces import (
    Call,
    Contact,
    Decision,
    DecisionMaker,
    Execution,
    Usage,
    Verdict,
    Verifier,
    View,
    WorldState,
)
from humanclaw.pose import HISTORY, Array, Motion
from humanclaw.records import (
    AnswerRecord,
    AttemptRecord,
    CallRecord,
    ContactRecord,
    EpisodeRecord,
    StepRecord,
    UsageRecord,
    VerdictRecord,
)
from humanclaw.scene import GROUND, Scene


class Film:
    """Collects every frame of an episode for motion.npz: five frames of standing, then each step's."""

    def __init__(self, body: Body) -> None:
        self._scene = body.scene
        self._commanded: list[Motion] = [body.history]
        still = body.state().body
        self._realised: list[Motion] = [
            Motion(np.repeat(still.root, HISTORY, 0), np.repeat(still.rotations, HISTORY, 0))
        ]
        self._paths: dict[int, list[tuple[int, Array]]] = {}
        self._length = HISTORY

    def add(self, deed: Deed) -> None:
        for chunk in deed.chunks:
            self._commanded.append(chunk.commanded)
            self._realised.append(chunk.execution.realised)
            for key, path in chunk.execution.objects.items():
                self._paths.setdefault(key, []).append((self._length, path))
            self._length += len(chunk.commanded)

    def arrays(self) -> dict[str, Array]:
        arrays = {f"object_{key}": self._path(key) for key in sorted(self._paths)}
        for kind, pieces in (("generated", self._commanded), ("realised", self._realised)):
            arrays[f"{kind}_root"] = np.concatenate([piece.root for piece in pieces])
            arrays[f"{kind}_rotations"] = np.concatenate([piece.rotations for piece in pieces])
        return arrays

    def _path(self, key: int) -> Array:
        """(T, 7) pose of an object in every frame; between recorded pieces it rests where the last one left it."""
        thing = self._scene.by_id[key]
        full = np.tile(np.array([*thing.position, *thing.rotation], float), (self._length, 1))
        for first, path in self._paths[key]:
            full[first : first + len(path)] = path
            full[first + len(path) :] = path[-1]
        return full


def episode_record(
    body: Body,
    spec: EpisodeSpec,
    maker: DecisionMaker,
    verifier: Verifier | None,
    options: Mapping[str, Any],
    limits: Mapping[str, float] | None = None,
) -> EpisodeRecord:
    in_force = {
        "decision_maker": getattr(maker, "settings", {}),
        "verifier": getattr(verifier, "settings", {}),
        "limits": limits or {},
        "body": asdict(body.engines) | {"senses": list(body.senses)},
    }
    boxes = {key: body.scene.aabb(key) for key in spec.target_ids}
    return EpisodeRecord(
        spec=spec,
        start=StartPose(**vars(body.start)),
        agent=maker.name,
        verifier=verifier.name if verifier else "",
        options=dict(options),
        settings={part: dict(found) for part, found in in_force.items() if found},
        versions={"humanclaw": humanclaw.__version__} | {i.origin: i.version for i in body.plugins.infos if i.version},
        weights={"base": body.weights},
        scene_digest=body.scene.digest,
        licences=body.scene.licences,
        targets={key: (_vec3(low), _vec3(high)) for key, (low, high) in boxes.items()},
        movable=tuple(thing.id for thing in body.scene.objects if thing.movable),
        ground=tuple(thing.id for thing in body.scene.objects if thing.category in GROUND),
        skills=tuple(sorted(body.skills)),
        created=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    )


def place(state: WorldState, prefix: str = "start") -> dict[str, Any]:
    """Where the pelvis is and where it faces, as fields of a step record: prefix is start or end."""
    return {prefix: _vec3(state.body.root[-1]), f"yaw_{prefix}": float(state.body.yaw()[-1])}


def way_left(state: WorldState, distance: Callable[[Array], float] | None) -> dict[str, Any]:
    """The shortest way to a target as a field of a record; None if nothing measures it or there is none."""
    metres = distance(state.body.root[-1]) if distance else float("inf")
    return {"geodesic": round(metres, 3) if np.isfinite(metres) else None}


def outcome(scene: Scene, targets: Sequence[int], deed: Deed) -> dict[str, Any]:
    last = deed.chunks[-1].execution
    return {
        "motion_frames": sum(len(chunk.commanded) for chunk in deed.chunks),
        "contacts": _contact_records(deed),
        "touches": tuple((start + at, a, b) for start, part in _timed(deed) for at, a, b in part.touches),
        "target_distance": _target_distance(scene, targets, last.realised),
        "pelvis_contacts": _pelvis_contacts(last.contacts, len(last.realised) - 1),
    }


def _timed(deed: Deed) -> Iterator[tuple[int, Execution]]:
    """What became of each chunk, with the frame of the step that it begins at."""
    start = 0
    for chunk in deed.chunks:
        yield start, chunk.execution
        start += len(chunk.commanded)


def _contact_records(deed: Deed) -> tuple[ContactRecord, ...]:
    """One record a (joint, object) pair: the frames in which they touch, counted from the first frame of the step."""
    pairs: dict[tuple[str, int], list[tuple[int, Contact]]] = {}
    for start, part in _timed(deed):
        for contact in part.contacts:
            pairs.setdefault((contact.joint, contact.object_id), []).append((start + contact.frame, contact))
    return tuple(
        ContactRecord(
            joint=joint,
            group=found[0][1].group,
            object_id=object_id,
            movable=found[0][1].movable,
            frames=tuple(sorted({frame for frame, _ in found})),
            depth=round(max(contact.depth for _, contact in found), 5),
            height=round(max(contact.height for _, contact in found), 4),
        )
        for (joint, object_id), found in sorted(pairs.items())
    )


def _pelvis_contacts(contacts: Sequence[Contact], frame: int) -> tuple[int, ...]:
    return tuple(sorted({c.object_id for c in contacts if c.joint == "pelvis" and c.frame == frame}))


def _target_distance(scene: Scene, targets: Sequence[int], realised: Motion) -> float | None:
    """From the nearest joint (pelvis, root and link origins) in the last frame to the nearest target's bounding box."""
    if not targets:
        return None
    return distance_to_nearest(realised[-1:].joints(), map(scene.aabb, targets))


def attempt_record(decision: Decision, error: str = "") -> AttemptRecord:
    return AttemptRecord(
        calls=tuple(CallRecord(skill=str(call.skill), params=_plain(call.params)) for call in decision.calls),
        visible_state=decision.visible_state,
        progress=decision.progress,
        mid_level_goal=decision.mid_level_goal,
        mid_level_change=decision.mid_level_change,
        reasoning=decision.reasoning,
        raw=decision.raw,
        prompt_digest=decision.prompt_digest,
        error=error,
        usage=usage_record(decision.usage),
    )


def decision_of(record: AttemptRecord) -> Decision:
    """The decision that a record was made of."""
    said = record.model_dump(exclude={"calls", "error", "usage"})
    calls = tuple(Call(call.skill, call.params) for call in record.calls)
    return Decision(calls, **said, usage=Usage(**record.usage.model_dump()))


def _plain(params: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters as JSON can hold them: an illegal NaN is kept as the text that it is."""
    return {key: str(v) if isinstance(v, float) and not np.isfinite(v) else v for key, v in params.items()}


def verdict_record(verifier: Verifier | None, verdict: Verdict | None) -> VerdictRecord | None:
    if verifier is None or verdict is None:
        return None
    other = verdict.replacement
    return VerdictRecord(
        verifier=verifier.name,
        accepted=verdict.accepted,
        replacement=CallRecord(skill=other.skill, params=_plain(other.params)) if other else None,
        answers=tuple(AnswerRecord(check=a.check, passed=a.passed, note=a.note) for a in verdict.answers),
        failed_open=verdict.failed_open,
        usage=usage_record(verdict.usage),
    )


def usage_of(step: StepRecord) -> Usage:
    """What all answers of a recorded step took."""
    records = [attempt.usage for attempt in step.attempts] + ([step.verdict.usage] if step.verdict else [])
    return sum((Usage(**record.model_dump()) for record in records), Usage())


def usage_record(usage: Usage) -> UsageRecord:
    return UsageRecord(**vars(usage))


def _vec3(point: Array) -> tuple[float, float, float]:
    x, y, z = (round(float(value), 5) for value in point)
    return x, y, z


def jpeg(view: View) -> bytes:
    return pictures.jpeg(view.rgb, quality=88)
