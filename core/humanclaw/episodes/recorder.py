"""Write the record of an episode: its first fields, each step in memory and in its folder, and its end."""

from __future__ import annotations

import datetime
import functools
import hashlib
import json
import os
import weakref
from collections.abc import Container, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numpy as np

from humanclaw.body.pose import HISTORY, Array, Motion
from humanclaw.episodes.embodiment import Body
from humanclaw.episodes.panel import Panel
from humanclaw.episodes.step import target_boxes
from humanclaw.errors import HumanclawError, LimitError, PluginRunError, ProviderError, RecordError, SceneError
from humanclaw.plugins.choice import PluginInfo
from humanclaw.plugins.distributions import version
from humanclaw.plugins.hookspecs import noun
from humanclaw.plugins.host import Plugins
from humanclaw.records.folder import EpisodeWriter, joined
from humanclaw.records.specification import EpisodeSpec
from humanclaw.records.steps import EpisodeRecord, Outcome, SkillInfo, StepRecord
from humanclaw.skills.contract import Skill
from humanclaw.storage.files import Folder, state_of
from humanclaw.world.scene import GROUND, Scene
from humanclaw.world.simulator import Chunk


class Recording:
    """What an episode keeps: its record, its steps, its frames and its motion."""

    def __init__(self, body: Body, record: EpisodeRecord, folder: Path | Folder | None) -> None:
        """folder: where to write; None keeps nothing on disk."""
        self.record = record
        self.steps: list[StepRecord] = []
        self._files = Folder.of(folder) if folder else None
        self.folder = self._files.path if self._files else None
        self._trajectory = TrajectoryBuffer(body) if folder else None
        self._writer: EpisodeWriter | None = None
        self._drawn: dict[str, bytes] = {}
        """Frames of replayed steps, held back until the replay has succeeded."""

    def open(self) -> None:
        """Begin the folder. Call it after a replay, so that a failed one leaves the folder as it was."""
        if self._files and self._trajectory is not None:
            self._writer = EpisodeWriter(self._files, self.record, self.steps)
            for name, data in self._drawn.items():
                self._writer.frame(name, data)
            self._drawn.clear()
            for piece in self._trajectory.pieces():
                self._writer.move(piece)

    def frame(self, name: str, data: bytes) -> str:
        """Write a frame, or hold it back until the folder is open. Returns its path relative to the folder."""
        if self._writer:
            return self._writer.frame(name, data)
        self._drawn[name] = data
        return f"frames/{name}"

    def move(self, chunks: Sequence[Chunk]) -> None:
        """Append the motion of a step."""
        if self._trajectory is None:
            return
        for chunk in chunks:
            piece = self._trajectory.add(chunk)
            if self._writer:
                self._writer.move(piece)

    def keep(self, step: StepRecord, replayed: bool = False) -> None:
        """Append a step. replayed: open() writes it to the folder."""
        if self._writer and not replayed:
            self._writer.step(step)
        self.steps.append(step)

    def end(self, record: EpisodeRecord) -> None:
        """Write the final record. If the disk was full, call it again."""
        if self._writer and self._trajectory is not None:
            self._writer.end(record, self._trajectory)
        self.record = record

    @property
    def outcome(self) -> Outcome:
        """The outcome that follows from the steps so far: 'interrupted' as long as none of them ends the episode."""
        if self.steps and self.steps[-1].status == "stopped":
            return "stopped"
        return "out_of_steps" if len(self.steps) >= self.record.spec.max_steps else "interrupted"

    @property
    def is_over(self) -> bool:
        """Whether the steps so far end the episode."""
        return self.outcome != "interrupted"


class TrajectoryBuffer(Mapping[str, Array]):
    """Every frame of an episode for motion.npz: five frames of standing, then each chunk's.

    Arrays by name, made when they are asked for: {generated,simulated}_{root,rotations} and object_ID, one row a frame.
    Until then they lie in a file without a name: they take 23 kB a step.
    """

    def __init__(self, body: Body) -> None:
        """Begin with a body that stands. Raises RecordError, as add() does, if temporary files have no room."""
        self._scene = body.scene
        still = body.state().body
        standing = Motion(np.repeat(still.root, HISTORY, 0), np.repeat(still.rotations, HISTORY, 0))
        self._places: list[Mapping[str, int]] = []
        """Where the file holds the arrays of the beginning and of each chunk; of objects only those that moved in
        it."""
        with _room():
            self._file = TemporaryFile()  # noqa: SIM115 (closed below)
        weakref.finalize(self, self._file.close)
        self._keep(_arrays(body.history, standing))

    def add(self, chunk: Chunk) -> Mapping[str, Array]:
        """Append the motion of a chunk. Returns it as a piece."""
        paths = {f"object_{key}": path for key, path in chunk.execution.objects.items()}
        return self._keep(_arrays(chunk.commanded, chunk.execution.simulated) | paths)

    def _keep(self, piece: Mapping[str, Array]) -> Mapping[str, Array]:
        places = {}
        with _room():
            self._file.seek(0, os.SEEK_END)
            for name, array in piece.items():
                places[name] = self._file.tell()
                np.save(self._file, array)
            self._file.flush()
        self._places.append(places)
        return piece

    def _read(self, place: int) -> Array:
        self._file.seek(place)
        return np.asarray(np.load(self._file))

    def pieces(self) -> Iterator[Mapping[str, Array]]:
        """Yield the beginning and each chunk."""
        for places in self._places:
            yield {name: self._read(place) for name, place in places.items()}

    def __iter__(self) -> Iterator[str]:
        return iter(sorted({name for places in self._places for name in places}))

    def __len__(self) -> int:
        return len(list(iter(self)))

    def __getitem__(self, name: str) -> Array:
        kind, _, key = name.partition("_")
        obj = self._scene.by_id[int(key)] if kind == "object" else None
        held = []
        for places in self._places:
            one = name if name in places else "generated_root"  # It tells how long the piece is.
            held.append({one: self._read(places[one])})
        return joined(held, name, np.array([*obj.position, *obj.rotation], float) if obj else None)


@contextmanager
def _room() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        told = f"cannot keep the episode's motion in a temporary file: {error.strerror or error}."
        raise RecordError(told, "Make room there, or name another folder in TMPDIR.") from error


def _arrays(generated: Motion, simulated: Motion) -> dict[str, Array]:
    pair = {"generated": generated, "simulated": simulated}
    return {f"{kind}_{part}": getattr(one, part) for kind, one in pair.items() for part in ("root", "rotations")}


def stand_at_start(body: Body, spec: EpisodeSpec, scene: Scene | None = None) -> None:
    """Put a body at the start of an episode. scene: that of the specification, if it is loaded already.

    Raises SceneError if the scene has another digest than the episode's.
    """
    loaded = scene or (body.scene if body.scene.name == spec.scene else spec.scene)
    body.place(loaded, spec.start, seed=spec.seed)
    if spec.scene_digest and body.scene.digest != spec.scene_digest:
        raise SceneError(
            f"scene {spec.scene} has digest {body.scene.digest[:12]}, the episode was made for "
            f"{spec.scene_digest[:12]}.",
            "Install the version of the scene's plugin that the episode was made with.",
        )


def begin_record(
    body: Body, spec: EpisodeSpec, panel: Panel, options: Mapping[str, Any], settings: Mapping[str, Any],
    geodesic: float | None,
) -> EpisodeRecord:  # fmt: skip
    """Return the record that an episode begins with.

    Args:
        body: at the start of the episode.
        options: options of the run, as given.
        settings: effective settings besides those of agent, verifier, plugins and body; empty ones are left out.
        geodesic: the remaining way to a target, metres; None if it is not measured.
    """
    chosen = {key: list(texts) for key, texts in asdict(body.plugins.choice).items() if texts}
    told = panel.settings | {"privileged": panel.privileged, **settings}
    in_force = {**told, "plugins": chosen, "body": asdict(body.backends) | {"sensors": list(body.sensors)}}
    objects = body.scene.objects
    return EpisodeRecord(
        spec=spec,
        start=body.start,
        agent=panel.names[0],
        verifier=panel.names[1],
        options=dict(options),
        settings={part: dict(found) for part, found in in_force.items() if found},
        versions=panel.versions | _versions(body, panel.packages),
        weights={"base": body.weights},
        scene_digest=body.scene.digest,
        geodesic=geodesic,
        licences=body.scene.licences,
        targets=target_boxes(body.scene, spec.target_ids, body.state()),
        movable=tuple(one.id for one in objects if one.movable),
        ground=tuple(one.id for one in objects if one.category in GROUND),
        skills=skill_infos(body.plugins, body.skills),
        created=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    )


def _versions(body: Body, packages: Container[str]) -> dict[str, str]:
    """Return the versions of humanclaw and of the plugins in use. A plugin that is only installed changes no record."""
    backends, plugins = body.backends, body.plugins
    items = {
        "simulators": backends.simulator, "renderers": backends.renderer, "motion_generators": backends.generator,
        "priors": backends.prior, "scenes": body.scene.name.partition(":")[0],
    }  # fmt: skip
    used = {f"{noun(kind)} {name}" for kind, name in items.items()} | {f"skill {name}" for name in body.skills}
    owners = {
        one.owner for kind in ("agents", "verifiers") for one in plugins.registered(kind)
        if one.owner in packages or getattr(one.value, "__module__", "").partition(".")[0] in packages
    }  # fmt: skip
    found = (info for info in plugins.infos if info.name in owners or used & set(info.provides))
    return {"humanclaw": version()} | {info.origin: info.version for info in found if info.version}


def skill_infos(plugins: Plugins, skills: Mapping[str, Skill]) -> dict[str, SkillInfo]:
    """Describe skills of these plugins, by name."""
    infos = {info.name: info for info in plugins.infos}
    return {name: _info(skill, plugins, infos) for name, skill in sorted(skills.items())}


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
        state.update(_file_digest(skill.adapter, state_of(skill.adapter.stat())))
    if skill.source and skill.source.is_file():
        state.update(skill.source.read_bytes())
    return state.hexdigest()


@functools.lru_cache(maxsize=256)
def _file_digest(path: Path, state: tuple[int, ...]) -> bytes:
    """Cache digests: adapters are large, seldom change, and every episode asks for all of them."""
    return hashlib.sha256(path.read_bytes()).digest()


def ending(fault: BaseException | None) -> tuple[Outcome | None, str, str]:
    """Return the outcome that an exception gives an episode, its text, and the scope of a limit. Outcome None: the
    steps decide."""
    if isinstance(fault, ProviderError):
        return "infra_error", str(fault), ""
    if isinstance(fault, PluginRunError):
        return "plugin_error", str(fault), ""
    if isinstance(fault, LimitError):
        return "limit_reached", str(fault), fault.scope
    if isinstance(fault, HumanclawError):
        return "interrupted", str(fault), ""
    return ("interrupted" if fault else None), "", ""
