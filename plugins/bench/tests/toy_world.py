"""A world for the tests of runs, as a plugin file: no physics, no pictures worth seeing, milliseconds a step."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import numpy as np
from rooms import two_rooms

from humanclaw import (
    Call,
    Decision,
    EpisodeSpec,
    Motion,
    PluginError,
    ProviderError,
    RecordError,
    ReplayError,
    Scene,
    hookimpl,
)
from humanclaw.body import FUTURE, HISTORY, Pose2D, rest_pose
from humanclaw.errors import PluginRunError
from humanclaw.records import Usage
from humanclaw.world import Execution, View, WorldState

FILE = __file__


def scene(argument: str) -> Scene:
    made = two_rooms()
    return Scene(f"toy:{argument}", made.assets, made.objects, made.rooms, made.start)


def specs(count: int, houses: int = 2, steps: int = 4) -> list[EpisodeSpec]:
    """Episodes that a toy agent ends with its fourth call."""
    return [
        EpisodeSpec(
            id=f"toy-{number}", instruction=f"find a couch, toy-{number}", scene=f"toy:{number % houses}",
            target_category="couch",
            target_ids=(20,), start=Pose2D(x=1.0, z=1.0, yaw=0.1 * number), max_steps=steps, seed=number,
        )
        for number in range(count)
    ]  # fmt: skip


class Generator:
    digest = "toy"

    def __init__(self, profile: str = "default") -> None: ...

    def start(self) -> Motion:
        return rest_pose(HISTORY)

    def generate(self, history: Motion, adapter: Path, values: dict[str, float], key: tuple[int, ...]) -> Motion:
        noise = np.random.default_rng(list(key)).normal(0.0, 0.01, 3)
        left, forward = values.get("x", 0.0), values.get("z", 0.0)
        goal = np.array([left, 0.0, forward]) + noise * [1, 0, 1]
        here = Pose2D.of_history(history)
        path = here.to_local(history).root[-1] + np.linspace(0, 1, 16)[1:, None] * goal
        return here.to_world(Motion(path, np.repeat(here.to_local(history).rotations[-1:], 15, 0)))


class Simulator:
    def __init__(self, profile: str = "default") -> None: ...

    def reset(self, scene: Scene, start: object) -> WorldState:
        self._body = Pose2D(start.x, start.z, start.yaw, start.floor).to_world(rest_pose())
        return self.state()

    def execute(self, motion: Motion) -> Execution:
        self._body = motion[-1:]
        return Execution(motion, (), (), {})

    def state(self) -> WorldState:
        return WorldState(self._body, {})

    def close(self) -> None: ...


class Pushing(Simulator):
    """With every chunk the couch (20) goes two metres along x, away from whoever stands at its left end."""

    push = 2.0

    def reset(self, scene: Scene, start: object) -> WorldState:
        thing = scene.by_id[20]
        self._couch = np.array([*thing.position, *thing.rotation])
        return super().reset(scene, start)

    def execute(self, motion: Motion) -> Execution:
        if len(motion) == FUTURE:  # and not as the body takes up its stance
            self._couch = self._couch + [self.push, 0, 0, 0, 0, 0, 0]
        return super().execute(motion)

    def state(self) -> WorldState:
        return WorldState(self._body, {20: self._couch})


class Pulling(Pushing):
    """And here towards them."""

    push = -2.0


class Renderer:
    def load(self, scene: Scene) -> None: ...

    def render(self, state: WorldState, camera: object) -> View:
        shade = int(abs(1000 * state.body.root[-1, 2])) % 256
        return View(np.full((8, 8, 3), shade, np.uint8), np.ones((8, 8), np.float32), np.zeros((8, 8), np.int32))

    def close(self) -> None: ...


class Walker:
    """Walks, and stops with its fourth call. options: what befalls it once, in which episode; told by a file that it
    leaves. each: episode to what befalls it every time. blank: the episode in which a text of its decisions is none."""

    name = "walker"
    privileged = False

    def __init__(self, options: dict) -> None:
        self._options = options

    def begin(self, context: object) -> None:
        # An agent is not told the episode's id, so the instruction holds it.
        self._episode = context.spec.instruction.removeprefix("find a couch, ")
        self._trouble = self._options.get("each", {}).get(self._episode, "")
        if self._trouble == "interrupted as it begins":
            raise KeyboardInterrupt

    def decide(self, observation: object, history: object) -> Decision:
        step = observation.step
        time.sleep(self._options.get("pause", 0.0))
        if step == 2 and self._episode == self._options.get("in") and self._first():
            befall(self._options["what"])
        if step == 2 and self._trouble:
            befall(self._trouble)
        if log := self._options.get("log"):
            with Path(log).open("a") as stream:
                stream.write(f"{self._episode} {step}\n")
        call = Call("stop") if step == 3 else Call("walk", {"z_cm": 20 + 10 * step})
        seen = None if self._options.get("blank") == self._episode else "A wall."
        return Decision((call,), visible_state=seen, usage=Usage(100, 10, 0.25))

    def _first(self) -> bool:
        """Whether it has not befallen yet; always, if no file is named."""
        if "once" not in self._options:
            return True
        try:
            Path(self._options["once"]).open("x").close()
        except FileExistsError:
            return False
        return True


RAISED = {
    "replay": ReplayError("the world has changed"), "interrupt": KeyboardInterrupt(), "record": RecordError("no room"),
    "another's": PluginRunError("another raised ValueError: x"), "plugin": PluginError("no key.", "Set one."),
}  # fmt: skip


def befall(what: str) -> None:
    if what in RAISED:
        raise RAISED[what]
    if what == "provider":
        raise ProviderError("503")
    if what == "bug":
        raise ZeroDivisionError("a bug")
    os.kill(os.getpid(), signal.Signals[what])


@hookimpl
def humanclaw_scenes(register: object) -> None:
    register("toy", scene)


@hookimpl
def humanclaw_motion_generators(register: object) -> None:
    register("toy", Generator)


@hookimpl
def humanclaw_simulators(register: object) -> None:
    register("toy", Simulator)
    register("pushing", Pushing)
    register("pulling", Pulling)


@hookimpl
def humanclaw_renderers(register: object) -> None:
    register("toy", Renderer)


@hookimpl
def humanclaw_agents(register: object) -> None:
    register("walker", Walker)
    made: list[Walker] = []

    def late(options: dict) -> Walker:
        if len(made) >= options["can"]:
            raise ValueError("no weights")
        made.append(Walker(options))
        return made[-1]

    register("late", late)
