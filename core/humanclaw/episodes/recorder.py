"""Begin the record of an episode, and say how it ends."""

from __future__ import annotations

import datetime
import functools
import hashlib
import json
from collections.abc import Container, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from humanclaw.body.pose import HISTORY, Array, Motion
from humanclaw.episodes.agents import EpisodeAgents
from humanclaw.episodes.embodiment import Body
from humanclaw.episodes.step import target_boxes
from humanclaw.errors import HumanclawError, LimitError, PluginRunError, ProviderError, SceneError
from humanclaw.plugins.choice import PluginInfo
from humanclaw.plugins.distributions import version
from humanclaw.plugins.hookspecs import noun
from humanclaw.plugins.host import Plugins
from humanclaw.records.folder import EpisodeWriter
from humanclaw.records.instructions import require_objects
from humanclaw.records.specification import EpisodeSpec
from humanclaw.records.steps import EpisodeRecord, Outcome, SkillInfo
from humanclaw.skills.contract import Skill
from humanclaw.storage.files import Folder, state_of
from humanclaw.world.scene import GROUND, Scene
from humanclaw.world.simulator import Chunk


def begin_folder(body: Body, record: EpisodeRecord, folder: Path | str | Folder | None) -> EpisodeWriter:
    """Return the writer of an episode whose body stands at its start: five frames, with which motion begins."""
    movable = (obj for obj in body.scene.objects if obj.movable)
    at_rest = {f"object_{obj.id}": np.array([*obj.position, *obj.rotation], float) for obj in movable}
    writer = EpisodeWriter(folder, record, at_rest)
    writer.move(_arrays(body.history, body.state().body.held(HISTORY)))
    return writer


def piece_of(chunk: Chunk) -> dict[str, Array]:
    """Return the motion of a chunk as motion.npz has it."""
    paths = {f"object_{key}": path for key, path in chunk.execution.objects.items()}
    return _arrays(chunk.commanded, chunk.execution.simulated) | paths


def _arrays(generated: Motion, simulated: Motion) -> dict[str, Array]:
    pair = {"generated": generated, "simulated": simulated}
    return {f"{kind}_{part}": getattr(motion, part) for kind, motion in pair.items() for part in ("root", "rotations")}


def stand_at_start(body: Body, spec: EpisodeSpec, scene: Scene | None = None) -> None:
    """Put a body at the start of an episode. scene: that of the specification, if it is loaded already.

    Raises SceneError if the scene has another digest than the episode's, or lacks a target.
    """
    loaded = scene or (body.scene if body.scene.name == spec.scene else spec.scene)
    body.place(loaded, spec.start, seed=spec.seed)
    if spec.scene_digest and body.scene.digest != spec.scene_digest:
        raise SceneError(
            f"scene {spec.scene} has digest {body.scene.digest[:12]}, the episode was made for "
            f"{spec.scene_digest[:12]}.",
            "Install the version of the scene's plugin that the episode was made with.",
        )
    require_objects(spec, body.scene)


def begin_record(
    body: Body, spec: EpisodeSpec, agents: EpisodeAgents, options: Mapping[str, Any], settings: Mapping[str, Any],
    geodesic: float | None, company: Sequence[str] = (),
) -> EpisodeRecord:  # fmt: skip
    """Return the record that an episode begins with.

    Args:
        body: at the start of the episode.
        options: options of the run, as given.
        settings: effective settings besides those of agent, verifier, plugins and body; empty ones are left out.
        geodesic: the remaining way to a target, metres; None if it is not measured.
        company: of several bodies in the scene the ids of all their episodes, in order.
    """
    chosen = {key: list(texts) for key, texts in asdict(body.plugins.choice).items() if texts}
    used = asdict(body.backends) | {"sensors": list(body.sensors)}
    in_force = {**agents.settings, "privileged": agents.privileged, **settings, "plugins": chosen, "body": used}
    objects = body.scene.objects
    return EpisodeRecord(
        spec=spec,
        start=body.start,
        agent=agents.names[0],
        verifier=agents.names[1],
        options=dict(options),
        settings={part: dict(values) for part, values in in_force.items() if values},
        versions=agents.versions | _versions(body, agents.packages),
        weights={"base": body.weights},
        scene_digest=body.scene.digest,
        geodesic=geodesic,
        licences=body.scene.licences,
        targets=target_boxes(body.scene, spec.target_ids, body.state()),
        movable=tuple(item.id for item in objects if item.movable),
        ground=tuple(item.id for item in objects if item.category in GROUND),
        skills=skill_infos(body.plugins, body.skills),
        company=tuple(company),
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
        offer.owner for kind in ("agents", "verifiers") for offer in plugins.registered(kind)
        if offer.owner in packages or getattr(offer.value, "__module__", "").partition(".")[0] in packages
    }  # fmt: skip
    used_plugins = (info for info in plugins.infos if info.name in owners or used & set(info.provides))
    return {"humanclaw": version()} | {info.origin: info.version for info in used_plugins if info.version}


def skill_infos(plugins: Plugins, skills: Mapping[str, Skill]) -> dict[str, SkillInfo]:
    """Describe skills of these plugins, by name."""
    infos = {info.name: info for info in plugins.infos}
    return {name: _info(skill, plugins, infos) for name, skill in sorted(skills.items())}


def _info(skill: Skill, plugins: Plugins, infos: Mapping[str, PluginInfo]) -> SkillInfo:
    commands = {parameter.key: parameter.measure for parameter in skill.parameters if parameter.measure}
    owner = plugins.owner(skill.name)
    plugin = infos[owner]
    return SkillInfo(
        skill.role, owner, plugin.version, _digest(skill), plugin.origin, plugins.overridden(skill.name), commands
    )


def _digest(skill: Skill) -> str:
    contract = [skill.name, skill.description, skill.schema, [asdict(check) for check in skill.checks]]
    state = hashlib.sha256(json.dumps(contract, sort_keys=True).encode())
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
