"""What is measured of an episode for its record: where the body went, what it touched, how far it still is."""

from __future__ import annotations

import datetime
import functools
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from humanclaw.body.pose import HISTORY, Array, Motion
from humanclaw.episodes.embodiment import Body
from humanclaw.plugins.distributions import version
from humanclaw.plugins.host import Plugins
from humanclaw.plugins.registry import PluginInfo
from humanclaw.records.specification import EpisodeSpec
from humanclaw.records.steps import EpisodeRecord, SkillInfo
from humanclaw.skills.contract import Skill
from humanclaw.world.scene import GROUND, Scene, Vec3, distance_to_nearest
from humanclaw.world.simulator import Chunk, Contact, DistanceFn, Execution, WorldState


class TrajectoryBuffer:
    """Collects every frame of an episode for motion.npz: five frames of standing, then each step's."""

    def __init__(self, body: Body) -> None:
        self._scene = body.scene
        self._commanded: list[Motion] = [body.history]
        still = body.state().body
        self._simulated: list[Motion] = [
            Motion(np.repeat(still.root, HISTORY, 0), np.repeat(still.rotations, HISTORY, 0))
        ]
        self._paths: dict[int, list[tuple[int, Array]]] = {}
        self._length = HISTORY

    def add(self, chunks: Sequence[Chunk]) -> None:
        """Append the motion of one step."""
        for chunk in chunks:
            self._commanded.append(chunk.commanded)
            self._simulated.append(chunk.execution.simulated)
            for key, path in chunk.execution.objects.items():
                self._paths.setdefault(key, []).append((self._length, path))
            self._length += len(chunk.commanded)

    def arrays(self) -> dict[str, Array]:
        """Name the arrays of motion.npz: {generated,simulated}_{root,rotations} and object_ID, a row a frame."""
        arrays = {f"object_{key}": self._path(key) for key in sorted(self._paths)}
        for kind, pieces in (("generated", self._commanded), ("simulated", self._simulated)):
            arrays[f"{kind}_root"] = np.concatenate([piece.root for piece in pieces])
            arrays[f"{kind}_rotations"] = np.concatenate([piece.rotations for piece in pieces])
        return arrays

    def _path(self, key: int) -> Array:
        """(T, 7) pose of an object in every frame; between recorded pieces it rests where the last one left it."""
        obj = self._scene.by_id[key]
        full = np.tile(np.array([*obj.position, *obj.rotation], float), (self._length, 1))
        for first, path in self._paths[key]:
            full[first : first + len(path)] = path
            full[first + len(path) :] = path[-1]
        return full


# -- an episode --------------------------------------------------------------------------------------------------------
def begin_record(
    body: Body, spec: EpisodeSpec, agent: str, verifier: str, options: Mapping[str, Any], settings: Mapping[str, Any]
) -> EpisodeRecord:
    """Write down what an episode begins with.

    Args:
        body: at the start of the episode.
        options: of the run, as they were given.
        settings: what is in force of agent, verifier and limits; empty ones are left out.
    """
    chosen = {key: list(texts) for key, texts in asdict(body.plugins.choice).items() if texts}
    in_force = {**settings, "plugins": chosen, "body": asdict(body.backends) | {"sensors": list(body.sensors)}}
    objects = body.scene.objects
    return EpisodeRecord(
        spec=spec,
        start=body.start,
        agent=agent,
        verifier=verifier,
        options=dict(options),
        settings={part: dict(found) for part, found in in_force.items() if found},
        versions={"humanclaw": version()} | {i.origin: i.version for i in body.plugins.infos if i.version},
        weights={"base": body.weights},
        scene_digest=body.scene.digest,
        licences=body.scene.licences,
        targets=target_boxes(body.scene, spec.target_ids, body.state()),
        movable=tuple(one.id for one in objects if one.movable),
        ground=tuple(one.id for one in objects if one.category in GROUND),
        skills=skill_infos(body.plugins),
        created=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    )


def skill_infos(plugins: Plugins) -> dict[str, SkillInfo]:
    """Describe every skill that can be called, by name."""
    infos = {info.name: info for info in plugins.infos}
    return {name: _info(skill, plugins, infos) for name, skill in sorted(plugins.skills.items())}


def _info(skill: Skill, plugins: Plugins, infos: Mapping[str, PluginInfo]) -> SkillInfo:
    commands = {one.key: one.measure for one in skill.parameters if one.measure}
    owner = plugins.owner(skill.name)
    found = infos[owner]
    return SkillInfo(
        skill.role, owner, found.version, _digest(skill), found.origin, plugins.overridden(skill.name), commands
    )


def _digest(skill: Skill) -> str:
    told = [skill.name, skill.description, skill.schema, [asdict(check) for check in skill.checks]]
    state = hashlib.sha256(json.dumps(told, sort_keys=True).encode())
    if skill.adapter and skill.trained:
        found = skill.adapter.stat()
        state.update(_file_digest(skill.adapter, found.st_mtime_ns, found.st_size))
    if skill.source and skill.source.is_file():
        state.update(skill.source.read_bytes())
    return state.hexdigest()


@functools.lru_cache(maxsize=256)
def _file_digest(path: Path, changed: int, size: int) -> bytes:
    """Adapters are large and seldom change, and every episode asks for all of them."""
    return hashlib.sha256(path.read_bytes()).digest()


# -- a moment ----------------------------------------------------------------------------------------------------------
def vec3(point: Array) -> Vec3:
    """Round a point (3,) to hundredths of a millimetre."""
    x, y, z = (round(float(value), 5) for value in point)
    return x, y, z


def yaw(state: WorldState) -> float:
    """Heading of the body, radians."""
    return float(state.body.yaw()[-1])


def distance_to_goal(state: WorldState, distance: DistanceFn | None) -> float | None:
    """Shortest way from the pelvis to a target, metres; None if nothing measures it or there is none."""
    metres = distance(state.body.root[-1]) if distance else float("inf")
    return round(metres, 3) if np.isfinite(metres) else None


def target_boxes(scene: Scene, targets: Sequence[int], state: WorldState) -> dict[int, tuple[Vec3, Vec3]]:
    """Return the bounding box of each target where it is now, metres: most chairs can be pushed."""
    boxes = {key: scene.aabb(key, state.objects.get(key)) for key in targets}
    return {key: (vec3(low), vec3(high)) for key, (low, high) in boxes.items()}


def target_distance(scene: Scene, targets: Sequence[int], state: WorldState) -> float | None:
    """From the nearest joint (pelvis, root and link origins) to the nearest target's box, as both are now, metres."""
    if not targets:
        return None
    boxes = [scene.aabb(key, state.objects.get(key)) for key in targets]
    return distance_to_nearest(state.body[-1:].joints(), boxes)


# -- a step ------------------------------------------------------------------------------------------------------------
def contacts(chunks: Sequence[Chunk]) -> tuple[Contact, ...]:
    """Gather one contact a pair of joint and object, with the frames counted from the first of the step."""
    pairs: dict[tuple[str, int], list[tuple[int, Contact]]] = {}
    for start, part in _timed(chunks):
        for contact in part.contacts:
            pairs.setdefault((contact.joint, contact.object_id), []).append((start, contact))
    return tuple(_gathered(found) for _, found in sorted(pairs.items(), key=lambda item: item[0]))


def _gathered(found: Sequence[tuple[int, Contact]]) -> Contact:
    first = found[0][1]
    return Contact(
        tuple(sorted({start + frame for start, contact in found for frame in contact.frames})),
        first.joint,
        first.group,
        first.object_id,
        first.movable,
        depth=round(max(contact.depth for _, contact in found), 5),
        height=round(max(contact.height for _, contact in found), 4),
    )


def touches(chunks: Sequence[Chunk]) -> tuple[tuple[int, int, int], ...]:
    """List (frame of the step, object, object) where a movable object touches another."""
    return tuple((start + frame, a, b) for start, part in _timed(chunks) for frame, a, b in part.touches)


def pelvis_contacts(chunks: Sequence[Chunk]) -> tuple[int, ...]:
    """List the objects that the pelvis touches in the last frame."""
    if not chunks:
        return ()
    last = chunks[-1].execution
    frame = len(last.simulated) - 1
    return tuple(sorted({c.object_id for c in last.contacts if c.joint == "pelvis" and frame in c.frames}))


def _timed(chunks: Sequence[Chunk]) -> Iterator[tuple[int, Execution]]:
    """Yield what became of each chunk, with the frame of the step that it begins at."""
    start = 0
    for chunk in chunks:
        yield start, chunk.execution
        start += len(chunk.commanded)
