"""Fake world, motion generator and agent, for tests of skills, agents and observers in milliseconds.

with fake_body(nod) as body:
    body.call("nod", times=2)
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from humanclaw.body.pose import FPS, FUTURE, HISTORY, Motion, Pose2D, rest_pose, smoothstep
from humanclaw.body.skeleton import Side
from humanclaw.episodes.backends import Backends
from humanclaw.episodes.embodiment import Body
from humanclaw.errors import ProviderError
from humanclaw.plugins.agents import EpisodeContext, HistoryEntry, Observation
from humanclaw.plugins.hookspecs import Register, RegisterMeasure, RegisterSkill, hookimpl
from humanclaw.plugins.host import Plugins
from humanclaw.records.decisions import Decision
from humanclaw.skills.call import Call
from humanclaw.skills.contract import Skill
from humanclaw.skills.measures import Measure
from humanclaw.world.scene import Scene
from humanclaw.world.scene_builder import SceneBuilder
from humanclaw.world.simulator import Execution, WorldState
from humanclaw.world.view import Camera, View

FAKE: Final = "fake"
"""Name of the fake simulator, renderer, generator and scene."""
_SECONDS: Final = FUTURE / FPS


class FakeWorld:
    """A simulator without dynamics: bodies follow their commands, through one another too, and nothing else moves.
    `heard` keeps the commands."""

    shared = True

    def __init__(self) -> None:
        self.heard: list[Motion] = []

    def reset(self, scene: Scene, start: Pose2D) -> WorldState:
        return self.reset_all(scene, [start])[0]

    def reset_all(self, scene: Scene, starts: Sequence[Pose2D]) -> Sequence[WorldState]:
        self._bodies = [start.to_world(rest_pose()) for start in starts]
        return self.states()

    def execute(self, motion: Motion) -> Execution:
        return self.execute_all([motion])[0]

    def execute_all(self, motions: Sequence[Motion]) -> Sequence[Execution]:
        self.heard += motions
        self._bodies = [motion[-1:] for motion in motions]
        return [Execution(motion, (), (), {}) for motion in motions]

    def grip(self, side: Side, closed: bool, body: int = 0) -> None: ...

    def state(self) -> WorldState:
        return self.states()[0]

    def states(self) -> Sequence[WorldState]:
        return [WorldState(body, {}) for body in self._bodies]

    def close(self) -> None: ...


class FakeRenderer:
    """Draws an empty grey picture."""

    def load(self, scene: Scene) -> None: ...

    def render(self, state: WorldState, camera: Camera) -> View:
        grey = np.full((camera.height, camera.width, 3), 128, np.uint8)
        return View(grey, np.full(grey.shape[:2], np.inf, np.float32), np.zeros(grey.shape[:2], np.int32))

    def close(self) -> None: ...


class FakeGenerator:
    """A motion generator without weights: it glides x metres left, z ahead, and turns by yaw. `asked` keeps adapters
    and values."""

    digest = FAKE

    def __init__(self) -> None:
        self.asked: list[tuple[Path, Mapping[str, float]]] = []

    def start(self) -> Motion:
        return rest_pose(HISTORY)

    def generate(self, history: Motion, adapter: Path, values: Mapping[str, float], key: Sequence[int]) -> Motion:
        self.asked.append((adapter, dict(values)))
        share = smoothstep(np.arange(1, FUTURE + 1) / FUTURE)[:, None]
        pose = Pose2D.of_history(history).to_local(history)[-1:]
        way = share * [values.get("x", 0.0), 0.0, values.get("z", 0.0)]
        rotations = np.repeat(pose.rotations, FUTURE, 0)
        rotations[:, 0] += share * [0.0, values.get("yaw", 0.0), 0.0]
        return Pose2D.of_history(history).to_world(Motion(pose.root + way, rotations))


Line = Decision | Call | Exception


class ScriptedAgent:
    """Answers with the next line of a script: a decision, a call, or an exception to raise. `heard` keeps the
    observations."""

    name = "scripted"
    privileged = False

    def __init__(self, script: Iterable[Line]) -> None:
        self._script: Iterator[Line] = iter(script)
        self.heard: list[Observation] = []
        self.context: EpisodeContext | None = None

    def begin(self, context: EpisodeContext) -> None:
        self.context = context

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        self.heard.append(observation)
        line = next(self._script, ProviderError("the script has ended"))
        if isinstance(line, Exception):
            raise line
        return Decision((line,)) if isinstance(line, Call) else line


@dataclass(eq=False)
class Fakes:
    """A plugin that registers the fakes, and the given skills and measures."""

    skills: Sequence[Skill | Path] = ()
    measures: Sequence[Measure] = ()

    @hookimpl
    def humanclaw_skills(self, register: RegisterSkill) -> None:
        for skill in self.skills:
            register(skill)

    @hookimpl
    def humanclaw_measures(self, register: RegisterMeasure) -> None:
        for measure in self.measures:
            register(measure)

    @hookimpl
    def humanclaw_simulators(self, register: Register[Any]) -> None:
        register(FAKE, lambda profile="default": FakeWorld(), "a world without dynamics")

    @hookimpl
    def humanclaw_renderers(self, register: Register[Any]) -> None:
        register(FAKE, FakeRenderer, "grey pictures")

    @hookimpl
    def humanclaw_motion_generators(self, register: Register[Any]) -> None:
        register(FAKE, lambda profile="default": FakeGenerator(), "gliding")

    @hookimpl
    def humanclaw_scenes(self, register: Register[Any]) -> None:
        register(FAKE, lambda argument: fake_scene(), "a floor")


def fake_scene() -> Scene:
    """Return an empty floor of 20 by 20 metres."""
    builder = SceneBuilder.on_floor()
    return builder.scene()


def fake_body(*skills: Skill | Path, measures: Sequence[Measure] = (), seed: int = 0) -> Body:
    """Return a body with only these skills, in a world without dynamics. Raises PluginError for a skill that breaks the
    contract."""
    plugins = Plugins()
    plugins.add(Fakes(skills, measures), FAKE)
    for skill in skills:
        plugins.skill(skill.name)
    return Body(fake_scene(), seed=seed, plugins=plugins, backends=Backends(FAKE, FAKE, FAKE))
