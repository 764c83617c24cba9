"""A body in a scene, driven by skill calls (the Python door)."""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace
from inspect import signature
from typing import Any, Final, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from humanclaw.body.pose import FUTURE, Motion, Pose2D
from humanclaw.episodes.adapters import Adapters
from humanclaw.episodes.backends import SHIPPED, Backends
from humanclaw.episodes.execution import SkillExecution, Watcher, played_parts
from humanclaw.episodes.falls import Descent
from humanclaw.episodes.moving import STANDING, Mover, Playing
from humanclaw.episodes.sensors import proprioception, tactile
from humanclaw.episodes.tools import body_tools
from humanclaw.errors import HumanclawError, blaming
from humanclaw.motion.protocol import MotionGenerator
from humanclaw.plugins import distributions
from humanclaw.plugins.agents import Observation, Verifier
from humanclaw.plugins.host import Plugins
from humanclaw.records.feedback import Feedback
from humanclaw.skills.call import Call
from humanclaw.skills.contract import Skill
from humanclaw.skills.gaze_grip_speech import Grip
from humanclaw.skills.proprioception import ProprioceptiveState
from humanclaw.storage.pictures import jpeg
from humanclaw.text.notebook import card
from humanclaw.world.scene import Scene
from humanclaw.world.simulator import Chunk, Execution, Simulator, WorldState
from humanclaw.world.view import CameraMount, Renderer, View, ego_camera, gaze_of

T = TypeVar("T", bound=np.generic)
_LOG: Final = logging.getLogger(__name__)


class Body:
    """A human body in a scene. Not thread-safe; close it, or use it as a context manager."""

    def __init__(
        self,
        scene: str | Scene = "house:0",
        start: Pose2D | None = None,
        *,
        seed: int = 0,
        plugins: Plugins | None = None,
        backends: Backends | None = None,
        simulator: Simulator | None = None,
    ) -> None:
        """Put a body into a scene.

        Args:
            scene: a reference such as house:0, or a Scene.
            start: where to stand; by default the scene's own start.
            seed: all randomness of the motion derives from the seed and the number of the step.
            simulator: one that is made already; by default a new one, as `backends` names it.

        Raises HumanclawError for unknown names.
        """
        self.plugins = plugins or Plugins.discover()
        self.backends = (backends or Backends()).chosen(self.plugins)
        self.sensors = self.backends.sensors
        self.gaze: CameraMount = gaze_of(self.backends.gaze)
        self._adapters = Adapters(self.plugins)
        self._generator: MotionGenerator = self._moved_by(self.backends.generator, self.backends.prior)
        self._simulator: Simulator = simulator or self._make("simulators", self.backends.simulator)
        self._renderer: Renderer = self.plugins.make("renderers", self.backends.renderer)
        self._shown: Scene | None = None
        self._waiting: tuple[Scene, Pose2D] | None = None
        """The scene and the start where the body still stands as it was placed; None once it was called."""
        self._stood: list[Chunk] = []
        """Half seconds in which the world of a company went on before the next call."""
        self.turn = threading.Lock()
        """Held during a call by acall() and by every list of tools: a body does one thing at a time."""
        self.resets = 0
        """Number of resets. An episode of an earlier count is over."""
        papers = distributions.table()["paper"].keys()
        if self.backends.profile == "paper" and (more := ", ".join(sorted(self.skills.keys() - papers))):
            _LOG.warning("The paper's model had no %s: leave out what a task does not need (--skills).", more)
        self.place(scene, start, seed=seed)

    def _make(self, kind: str, name: str) -> Any:
        return self.plugins.make(kind, name, profile=self.backends.profile)

    def _moved_by(self, generator: str, prior: str) -> MotionGenerator:
        """Make the generator with a prior. Raises HumanclawError for a generator that takes none, and without a skill
        that fits."""
        if prior == SHIPPED:
            made: MotionGenerator = self._make("motion_generators", generator)
            return made
        checkpoint = self.plugins.offered("priors", prior)
        if "prior" not in signature(self.plugins.offered("motion_generators", generator)).parameters:
            raise HumanclawError(f"generator {generator!r} takes no prior; got {prior!r}.", "Leave out --prior.")
        made = self.plugins.make("motion_generators", generator, profile=self.backends.profile, prior=checkpoint)
        if not any(skill.adapter and self._adapters.fits(skill, made.digest) for skill in self.plugins.skills.values()):
            raise HumanclawError(
                f"no skill has an adapter for prior {prior!r}.",
                f"Train one with `humanclaw train adapter --skill FOLDER --base {checkpoint}`.",
            )
        return made

    def reset(self, scene: str | Scene, start: Pose2D | None = None, *, seed: int = 0) -> Observation:
        """Stand at a start of a scene, with every object at rest, and return the view."""
        self.place(scene, start, seed=seed)
        return self.observe()

    def place(self, scene: str | Scene, start: Pose2D | None = None, *, seed: int = 0) -> None:
        """Stand at a start of a scene, with every object at rest. Nothing is rendered."""
        wanted: Scene = self.plugins.scene(scene) if isinstance(scene, str) else scene
        if self._shown is not wanted:
            self._renderer.load(wanted)
        self.scene = self._shown = wanted
        self.start = start or self.scene.start
        self.seed = seed
        self.step = 0
        self.resets += 1
        self.last: SkillExecution | None = None
        # An episode places a new body again, mostly where it stands already, and loading a scene takes up to .2 s.
        if self._waiting is None or self._waiting[0] is not wanted or self._waiting[1] != self.start:
            self._waiting = None
            self._mover = Mover(self.backends, self._adapters, self._generator, self._simulator, wanted, self.start)
            self._waiting = wanted, self.start
        self._stood = []
        self._descent = Descent(float(self._mover.state.body.root[-1, 1]))

    @property
    def skills(self) -> dict[str, Skill]:
        """Every skill that can be called, by name. A trained skill needs an adapter for the body's prior."""
        return {name: skill for name, skill in self.plugins.skills.items() if self._adapters.fits(skill, self.weights)}

    @property
    def history(self) -> Motion:
        """The five frames that the next motion continues (world frame)."""
        return self._mover.history

    @property
    def feeling(self) -> ProprioceptiveState:
        """What the body feels of itself, as a skill is told it."""
        return self._mover.feeling

    @property
    def weights(self) -> str:
        """Digest of the motion prior's weights."""
        return self._generator.digest

    def state(self) -> WorldState:
        """Return the true state of the world: for scoring and for privileged agents, never for models."""
        return self._mover.state

    def view(self) -> View:
        """Render what the eyes see: colours, depth and object ids, as read-only arrays."""
        state = self._mover.state
        seen = self._renderer.render(state, ego_camera(state.body, gaze=self._looking))
        return View(_fixed(seen.rgb), _fixed(seen.depth), _fixed(seen.ids))

    @property
    def _looking(self) -> CameraMount:
        """How the eyes look now: as they usually do, or where a part of the last calls has turned them."""
        return self.gaze if self._mover.pitch is None else replace(self.gaze, pitch=self._mover.pitch)

    def views_during(self, chunk: Chunk, count: int) -> Iterator[View]:
        """Render `count` views, evenly spaced, of the half second that the body has just moved; the last frame is not
        among them."""
        for frame in np.linspace(0, FUTURE, count + 1, endpoint=False, dtype=int)[1:]:
            body, paths = chunk.execution.simulated[frame : frame + 1], chunk.execution.objects
            objects = {**self._mover.state.objects, **{key: path[frame] for key, path in paths.items()}}
            people = {key: way[frame : frame + 1] for key, way in chunk.execution.people.items()}
            yield self._renderer.render(WorldState(body, objects, people=people), ego_camera(body, gaze=self._looking))

    def observe(self, instruction: str = "", feedback: Feedback | None = None) -> Observation:
        """Return the view, and the feedback of the last call."""
        return Observation(self.step, instruction, self.view().rgb, feedback or Feedback())

    def call(self, skill: str, /, **params: Any) -> Observation:
        """Check a call, execute it, and return the view. `last` holds the result.

        Raises PluginError for an unknown skill, CallError for parameters outside its schema.
        """
        done = self.execute(Call(skill, self.plugins.skill(skill).check(params)))
        return self.observe(feedback=done.feedback)

    async def acall(self, skill: str, /, **params: Any) -> Observation:
        """Do the same as call() in a thread, so that an event loop goes on. Calls and tools wait for one another."""

        def turn() -> Observation:
            with self.turn:
                return self.call(skill, **params)

        return await asyncio.to_thread(turn)

    def tools(self, framework: str, *, verifier: Verifier | None = None, instruction: str = "") -> Any:
        """Return every skill that can run, and `look`, as tools of an agent framework ("openai", "langchain", ...).

        verifier: checks each call before the body moves, as in an episode, and may replace it. instruction: the task,
        as the verifier is told it.
        Raises PluginError if no plugin knows the framework (with the nearest names), or if it is not installed.
        """
        return self.plugins.make("frameworks", framework, body_tools(self, verifier, instruction))

    def execute(self, call: Call, watch: Watcher | None = None, waited: int = 0) -> SkillExecution:
        """Execute a checked call, chunk by chunk.

        watch: called after each chunk; if it returns False, the rest is left out. waited: half seconds to stand before,
        among them those that the world has gone on for already.
        """
        with getattr(self._simulator, "called", nullcontext)():
            return self._execute(call, watch, waited)

    def hurry(self) -> None:
        """Let the world of a company go on while the mind, asked now, thinks. The world of one body waits."""
        getattr(self._simulator, "hurry", lambda: None)()

    def stands(self) -> Motion:
        """Return half a second of standing, for a world that does not wait for a call: it tells stood() the outcome."""
        return self._mover.stands()

    def stood(self, execution: Execution, late: bool) -> None:
        """Go on from half a second of standing. late: whether it belongs to the next call, as time waited."""
        if not self._stood:
            self._before = self._mover.state, self.feeling
        self._waiting = None
        chunk = self._mover.stood(execution)
        self._stood += [chunk] * late

    def _execute(self, call: Call, watch: Watcher | None, waited: int) -> SkillExecution:
        skill = self.plugins.skill(call.skill)
        before, feeling = self._before if self._stood else (self._mover.state, self.feeling)
        with blaming(self.plugins.owner(call.skill)):
            plan = skill.planned(call.params, feeling if skill.feels else None)
        chunks, self._stood = self._stood, []
        waited = max(waited, len(chunks))
        plan = (*[STANDING] * waited, *plan)
        self._waiting = None
        playing = Playing(self._mover, skill, plan, (self.seed, self.step), len(chunks))
        seconds = {"generate": 0.0, "simulate": 0.0}
        played = list(range(len(chunks)))
        cancelled, moment = False, time.perf_counter()
        for number, commanded, left in playing.chunks():
            seconds["generate"] += time.perf_counter() - moment
            moment = time.perf_counter()
            chunks.append(self._mover.simulate(commanded, plan[number]))
            played.append(number)
            seconds["simulate"] += time.perf_counter() - moment
            if watch is not None and not watch(chunks[-1]) and left:
                cancelled = True
                break
            moment = time.perf_counter()
        self.step += 1
        opened = {part.hand for part in plan if isinstance(part, Grip)}
        slipped = sorted(before.held.keys() - self._mover.state.held - opened)
        limits = [*playing.limits, *(f"what your {side} hand held slipped" for side in slipped)]
        parts = played_parts(plan, played) if len(plan) > 1 else ()
        self._descent = self._descent.after(chunks)
        moved = [(chunk.commanded, chunk.execution) for chunk in chunks]
        feedback = Feedback(
            call,
            proprioception=proprioception(before.body, moved) if "body" in self.sensors and moved else None,
            tactile=tactile([chunk.execution for chunk in chunks]) if "touch" in self.sensors and chunks else None,
            cancelled=cancelled,
            limits=tuple(dict.fromkeys(limits)),
            fall=self._descent.fall,
            falling=self._descent.falling,
            waited=waited,
            heard=tuple(heard for chunk in chunks for heard in chunk.execution.heard),
        )
        aims = tuple(playing.aims)
        self.last = SkillExecution(call, before, tuple(chunks), seconds, feedback, parts, playing.rise_frames, aims)
        return self.last

    def _repr_html_(self) -> str:
        """Return what the eyes see now, for a notebook."""
        last = str(self.last.feedback) if self.last else "Nothing was called yet."
        return card(f"Body in {self.scene.name}, step {self.step}", [last], [("view", jpeg(self.view().rgb))])

    def close(self) -> None:
        self._simulator.close()
        self._renderer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _fixed(picture: NDArray[T]) -> NDArray[T]:
    """Return a read-only copy, so that agent, verifier and record see the same picture."""
    return np.frombuffer(picture.tobytes(), picture.dtype).reshape(picture.shape)
