"""A body in a scene, driven by skill calls (the Python door)."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator, Sequence
from dataclasses import replace
from inspect import signature
from pathlib import Path
from typing import Any, Final, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from humanclaw.body.pose import FUTURE, Array, Motion, Pose2D, next_history, re_rooted
from humanclaw.body.resting_hands import lay_hands
from humanclaw.episodes.adapters import Adapters, untrained
from humanclaw.episodes.backends import SENSORS, SHIPPED, VISION, Backends
from humanclaw.episodes.execution import SkillExecution, Watcher, played_parts, working
from humanclaw.episodes.falls import Descent
from humanclaw.episodes.sensors import checked
from humanclaw.episodes.tools import Verified, body_tools
from humanclaw.errors import HumanclawError, blaming
from humanclaw.motion.carrying import Arms
from humanclaw.motion.generator import MotionGenerator
from humanclaw.motion.rising import is_down, rise
from humanclaw.plugins.agents import Moment, Observation, Sense, Verifier
from humanclaw.plugins.host import Plugins
from humanclaw.records.feedback import Feedback, HandAim, Proprioception, Reading, Touch
from humanclaw.skills.aims import Gaze as Aim, Grip
from humanclaw.skills.call import Call
from humanclaw.skills.contract import Skill
from humanclaw.skills.course import Course
from humanclaw.skills.measures import Declaration
from humanclaw.skills.own_body import OwnBody
from humanclaw.skills.plan import Control
from humanclaw.skills.posing import Part, arms_of, posed
from humanclaw.skills.reaching import Reach
from humanclaw.storage.pictures import jpeg
from humanclaw.text.notebook import card
from humanclaw.world.scene import Scene
from humanclaw.world.simulator import Chunk, Simulator, WorldState
from humanclaw.world.view import Gaze, Renderer, View, ego_camera, gaze_of

T = TypeVar("T", bound=np.generic)
_SHORT: Final = 0.03
"""Metres from its target at which a hand is there."""


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
    ) -> None:
        """Put a body into a scene.

        Args:
            scene: a reference such as house:0, or a Scene.
            start: where to stand; by default the scene's own start.
            seed: all randomness of the motion derives from the seed and the number of the step.

        Raises HumanclawError for unknown names.
        """
        self.plugins = plugins or Plugins.discover()
        self.backends = (backends or Backends()).chosen(self.plugins)
        self.sensors = self.backends.sensors
        self._senses: dict[str, Sense] = {
            name: self.plugins.make("senses", name) for name in self.sensors if name != VISION
        }
        self.gaze: Gaze = gaze_of(self.backends.gaze)
        self._adapters = Adapters(self.plugins)
        self._generator: MotionGenerator = self._moved_by(self.backends.generator, self.backends.prior)
        self._simulator: Simulator = self._make("simulators", self.backends.simulator)
        self._renderer: Renderer = self.plugins.make("renderers", self.backends.renderer)
        self._shown: Scene | None = None
        self._turn = threading.Lock()
        self.resets = 0
        """Number of resets. An episode of an earlier count is over."""
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
        self._history = stand(self._simulator, self._generator, self.scene, self.start)
        self._state = self._simulator.state()
        self._descent = Descent(float(self._state.body.root[-1, 1]))
        self._course = Course()
        self._arms = Arms()
        self._pitch: float | None = None

    @property
    def skills(self) -> dict[str, Skill]:
        """Every skill that can be called, by name. A trained skill needs an adapter for the body's prior."""
        return {name: one for name, one in self.plugins.skills.items() if self._adapters.fits(one, self.weights)}

    @property
    def history(self) -> Motion:
        """The five frames that the next motion continues (world frame)."""
        return self._history

    @property
    def feeling(self) -> OwnBody:
        """What the body feels of itself, as a skill is told it."""
        return OwnBody.of(self._arms.pose(self._history), self._state.held)

    @property
    def weights(self) -> str:
        """Digest of the motion prior's weights."""
        return self._generator.digest

    def state(self) -> WorldState:
        """Return the true state of the world: for scoring and for privileged agents, never for models."""
        return self._state

    def view(self) -> View:
        """Render what the eyes see: colours, depth and object ids, as read-only arrays."""
        seen = self._renderer.render(self._state, ego_camera(self._state.body, gaze=self._looking))
        return View(_fixed(seen.rgb), _fixed(seen.depth), _fixed(seen.ids))

    @property
    def _looking(self) -> Gaze:
        """How the eyes look now: as they usually do, or where a part of the last calls has turned them."""
        return self.gaze if self._pitch is None else replace(self.gaze, pitch=self._pitch)

    def views_during(self, chunk: Chunk, count: int) -> Iterator[View]:
        """Render `count` views, evenly spaced, of the half second that the body has just moved; the last frame is not
        among them."""
        for frame in np.linspace(0, FUTURE, count + 1, endpoint=False, dtype=int)[1:]:
            body, paths = chunk.execution.simulated[frame : frame + 1], chunk.execution.objects
            objects = {**self._state.objects, **{key: path[frame] for key, path in paths.items()}}
            yield self._renderer.render(WorldState(body, objects), ego_camera(body, gaze=self._looking))

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
        """Do the same as call() in a thread, so that an event loop goes on. Calls wait for one another."""

        def turn() -> Observation:
            with self._turn:
                return self.call(skill, **params)

        return await asyncio.to_thread(turn)

    def tools(self, framework: str, *, verifier: Verifier | None = None, instruction: str = "") -> Any:
        """Return every skill that can run, and `look`, as tools of an agent framework ("openai", "langchain", ...).

        verifier: checks each call before the body moves, as in an episode, and may replace it. instruction: the task,
        as the verifier is told it.
        Raises PluginError if no plugin knows the framework (with the nearest names), or if it is not installed.
        """
        driven = Verified(self, verifier, instruction) if verifier else self
        return self.plugins.make("frameworks", framework, body_tools(driven))

    def execute(self, call: Call, watch: Watcher | None = None) -> SkillExecution:
        """Execute a checked call, chunk by chunk.

        watch: called after each chunk; if it returns False, the rest is left out.
        """
        skill = self.plugins.skill(call.skill)
        with blaming(self.plugins.owner(call.skill)):
            plan = skill.planned(call.params, self.feeling if skill.feels else None)
        self._limits: list[str] = []
        self._aims: list[HandAim] = []
        self._rise_frames = 0
        before, held, chunks, seconds = self._state.body, self._state.held, [], {"generate": 0.0, "simulate": 0.0}
        played: list[int] = []
        cancelled, moment = False, working()
        for number, commanded, left in self._chunks(skill, plan):
            seconds["generate"] += working() - moment
            moment = working()
            chunks.append(self._simulate(commanded, plan[number]))
            played.append(number)
            seconds["simulate"] += working() - moment
            if watch is not None and not watch(chunks[-1]) and left:
                cancelled = True
                break
            moment = working()
        self.step += 1
        opened = {part.hand for part in plan if isinstance(part, Grip)}
        self._limits += [
            f"what your {side} hand held slipped" for side in sorted(held.keys() - self._state.held - opened)
        ]
        told = played_parts(plan, played) if len(plan) > 1 else ()
        limits = tuple(dict.fromkeys(self._limits))
        self._descent = self._descent.after(chunks)
        body, touch, readings = self._sense(Moment(before, tuple(chunks), self.view))
        self.last = SkillExecution(
            call,
            tuple(chunks),
            seconds,
            body,
            touch,
            told,
            self._rise_frames,
            cancelled,
            limits,
            readings,
            tuple(self._aims),
            self._descent.fall,
            self._descent.falling,
        )
        return self.last

    def _simulate(self, motion: Motion, part: Part) -> Chunk:
        source = self.backends.motion_history
        # A model that goes on from the simulated hands would meet hands that it has never seen.
        corrects = isinstance(part, Control) and source == "generated" and self.backends.profile != "paper"
        laid = lay_hands(motion) if corrects else motion
        commanded = self._arms.over(laid, arms_of(part), self._state.body)
        execution = self._simulator.execute(commanded)
        self._state = self._simulator.state()
        self._arms.after(execution.simulated, self._state.held, arms_of(part))
        self._history = next_history(self._history, motion, execution.simulated, source)
        return Chunk(commanded, execution)

    def _sense(self, moment: Moment) -> tuple[Proprioception | None, tuple[Touch, ...] | None, tuple[Reading, ...]]:
        """Return the readings of body, touch, and the senses of plugins."""
        told: dict[str, Any] = {}
        for name, sense in self._senses.items():
            with blaming(self.plugins.owner(name, "senses")):
                told[name] = sense.feel(moment)
                if name not in SENSORS:
                    told[name] = replace(checked(told[name], name), sense=name)
        return told.get("body"), told.get("touch"), tuple(one for name, one in told.items() if name not in SENSORS)

    def _chunks(self, skill: Skill, plan: Sequence[Part]) -> Iterator[tuple[int, Motion, bool]]:
        """Yield the motion of a plan, 15 frames at a time, each beginning where the chunk before it ended.

        Yields the number of the part, the motion, and whether more follows.
        """
        index = 0
        for number, part in enumerate(plan):
            for commanded, left in self._pieces(skill, part, index):
                yield number, commanded, left or number + 1 < len(plan)
                index += 1

    def _pieces(self, skill: Skill, part: Part, index: int) -> Iterator[tuple[Motion, bool]]:
        """Yield the chunks of one part. index: number of its first chunk within the call."""
        if isinstance(part, Control):
            self._pitch = None
            if part.adapter == skill.adapter and not skill.trained:
                raise untrained(skill)
            declared, key = self._declared(skill, part.adapter), (self.seed, self.step, index)
            if (declared or skill).role == "locomotion" and self._must_rise():
                for piece, _ in self._played(rise(self._state.body, self._generator.start())):
                    self._rise_frames += len(piece)
                    yield piece, True
            yield self._generated(declared, part, key), False
            return
        if isinstance(part, Grip):
            self._grip(part)
        pose = self._arms.pose(self._history)
        motion, limits = posed(part, pose, self._arms.palms)
        self._limits += limits
        yield from self._played(motion)
        if isinstance(part, Reach):
            self._aim(part, pose)
        elif isinstance(part, Aim):
            self._pitch = part.pitch(self._state.body)

    def _grip(self, part: Grip) -> None:
        """Close or open a hand. A simulator of plugin API 1.2 has none."""
        if not hasattr(self._simulator, "grip"):
            self._limits.append("your hands hold nothing in this world")
            return
        self._simulator.grip(part.hand, part.closed)
        self._state = self._simulator.state()
        if part.closed and part.hand not in self._state.held:
            self._limits.append(f"your {part.hand} hand closed on nothing")

    def _aim(self, part: Reach, pose: Motion) -> None:
        """Enter how far a hand is from its target. pose: in whose frame the target is."""
        short = part.short(pose, self._state.body)
        self._aims.append(HandAim(part.hand, part.at, round(short, 4)))
        if short > _SHORT:
            self._limits.append(f"your {part.hand} hand stays {100 * short:.0f} cm short")

    def _must_rise(self) -> bool:
        """Tell whether the body has to rise before it steps: the motion model steps from standing alone."""
        return self.backends.profile != "paper" and is_down(self._state.body)

    def _played(self, motion: Motion) -> Iterator[tuple[Motion, bool]]:
        """Yield a ready motion 15 frames at a time, each from where the body is, and whether more follows."""
        before = self._history[-1:]
        for first in range(0, len(motion), FUTURE):
            piece = motion[first : first + FUTURE]
            yield _moved(piece, _offset(self._history[-1:], before)), first + FUTURE < len(motion)
            before = piece[-1:]

    def _generated(self, declared: Declaration | None, part: Control, key: tuple[int, ...]) -> Motion:
        """Generate the motion of a control. But for the paper's profile, correct the heading error of earlier calls."""
        declared = None if self.backends.profile == "paper" else declared
        values = part.values if declared is None else self._course.steer(declared, part.values)
        adapter = self._adapters.of(part.adapter, self.weights)
        motion = self._generator.generate(self._history, adapter, values, key)
        if declared is not None:
            self._course = self._course.after(declared, part.values, self._history, motion)
        return motion

    def _declared(self, skill: Skill, adapter: Path) -> Declaration | None:
        """Return the declaration of the skill that owns an adapter; None if that skill is not installed."""
        if adapter == skill.adapter:
            return skill.declaration
        return next((one.declaration for one in self.plugins.skills.values() if one.adapter == adapter), None)

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


def _offset(pose: Motion, motion: Motion) -> Array:
    """Return the horizontal offset (3,) from the beginning of a motion to the body."""
    return np.asarray([1.0, 0.0, 1.0] * (pose.root[-1] - motion.root[0]))


def _moved(motion: Motion, by: Array) -> Motion:
    return Motion(motion.root + by, motion.rotations)


def stand(simulator: Simulator, generator: MotionGenerator, scene: Scene, start: Pose2D) -> Motion:
    """Stand a body on its start, in the stance that the motion model begins from.

    A simulator places the body in a pose of its own, so the stance is played first. Returns its five frames, the
    history of the first motion (world frame).
    """
    stance = re_rooted(generator.start(), simulator.reset(scene, start).body)
    return re_rooted(stance, simulator.execute(stance).simulated)
