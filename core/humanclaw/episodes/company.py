"""Several bodies in one scene. Each is driven as if it were alone, and the world waits for all of them.

with Company("house:0", [start, other]) as company:
    records = company.play([lambda body: run_episode(body, spec, agent) for agent in agents])

All bodies decide at the same time, from what they see at the start of the half second; then their chunks are simulated
together. A call of several chunks goes on while the others decide anew. Nothing depends on which of them is faster:
hands that open or close do so before the half second, in the order of the starts.
"""

from __future__ import annotations

import ctypes
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final, Self, TypeAlias, TypeVar

import numpy as np

from humanclaw.body.pose import FPS, FUTURE, Motion, Pose2D
from humanclaw.body.skeleton import JOINT_INDEX, Side
from humanclaw.episodes.backends import Backends
from humanclaw.episodes.embodiment import Body
from humanclaw.errors import HumanclawError, SceneError, passed_interrupts
from humanclaw.plugins.host import Plugins
from humanclaw.skills.gaze_grip_speech import Grip
from humanclaw.world.navigation.approach import voice_distance
from humanclaw.world.navigation.search import MultiFloorMap
from humanclaw.world.scene import Scene
from humanclaw.world.simulator import Execution, Heard, SharedSimulator, WorldState, shared

T = TypeVar("T")
HEARING: Final = 8.0
"""Metres that a voice carries, along the shortest way through the air: round corners and through open doors."""
_HALF: Final = FUTURE / FPS
"""Seconds of the world that are simulated together."""
_Act: TypeAlias = "Motion | Grip | tuple[Scene, Pose2D]"
"""What a body does next: half a second of motion, what a hand does before it, or standing at a start of a scene."""


class Company:
    """Bodies in one scene, each with skin, skills, eyes, hands and feedback of its own."""

    def __init__(
        self,
        scene: str | Scene,
        starts: Sequence[Pose2D],
        *,
        seed: int = 0,
        plugins: Plugins | None = None,
        backends: Backends | None = None,
        patience: float | None = None,
    ) -> None:
        """Put a body on each start.

        Args:
            seed: of the first body; each further one has the next.
            patience: seconds that the others wait for a body that thinks; then it stands until it is called, which its
                next step records as time waited. None waits for ever, and so nothing depends on who is faster.

        Raises SceneError if a body does not fit on its start, HumanclawError for a simulator whose worlds hold one.
        """
        if not starts:
            raise HumanclawError("a company has one body at least; got no start.", "Give each body a start.")
        host = plugins or Plugins.discover()
        chosen = (backends or Backends()).chosen(host)
        place: Scene = host.scene(scene) if isinstance(scene, str) else scene
        simulator = host.make("simulators", chosen.simulator, profile=chosen.profile)
        self._world = _World(shared(simulator), len(starts))

        def embodied(number: int) -> Body:
            seat = Seat(self._world, number)
            return Body(place, starts[number], seed=seed + number, plugins=host, backends=chosen, simulator=seat)

        self.bodies = self._world.bodies = self._together([partial(embodied, k) for k in range(len(starts))])
        self._world.patience = patience  # From now on: to make the bodies may take long.

    def play(self, parts: Sequence[Callable[[Body], T]]) -> tuple[T, ...]:
        """Let each body play its part, in a thread of its own, and return what the parts return.

        A body whose part has ended stands while the others go on. Raises the first error of a part once all have ended.
        Ctrl-C ends every part, as it ends that of one body.
        """
        if len(parts) != len(self.bodies):
            raise HumanclawError(
                f"{len(self.bodies)} bodies play together; got {len(parts)} parts.", "Give each body a part."
            )
        return self._together([partial(part, body) for part, body in zip(parts, self.bodies, strict=True)])

    def join(self, *numbers: int) -> None:
        """Let bodies, by default all, be called from threads of your own, each until it leaves. Who has left may join
        again. Do so or play(), not both."""
        self._world.enter(*numbers)

    def leave(self, number: int) -> None:
        """Let a body stand from now on."""
        self._world.leave(number)

    def _together(self, parts: Sequence[Callable[[], T]]) -> tuple[T, ...]:
        threads: set[int] = set()
        interrupted = threading.Event()

        def played(number: int, part: Callable[[], T]) -> T:
            passed_interrupts.set(True)
            threads.add(threading.get_ident())
            try:
                if interrupted.is_set():
                    raise KeyboardInterrupt
                return part()
            finally:
                threads.discard(threading.get_ident())
                self._world.leave(number)

        self._world.enter()
        with ThreadPoolExecutor(len(parts)) as pool:
            playing = [pool.submit(played, number, part) for number, part in enumerate(parts)]
            try:
                for ended in as_completed(playing):  # The first to fail is the cause, where others fail for want of it.
                    ended.result()
            except KeyboardInterrupt:  # Python tells the main thread alone, or a person has left at a page.
                interrupted.set()
                for thread in map(ctypes.c_ulong, tuple(threads)):
                    ctypes.pythonapi.PyThreadState_SetAsyncExc(thread, ctypes.py_object(KeyboardInterrupt))
                raise
        return tuple(part.result() for part in playing)

    def close(self) -> None:
        """Free the world and every body's eyes."""
        with ExitStack() as stack:
            stack.callback(self._world.close)
            for body in self.bodies:
                stack.callback(body.close)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@dataclass(frozen=True)
class Seat:
    """The Simulator of one body of a company: what it is asked is done when all the others have asked, too."""

    world: _World
    number: int

    @contextmanager
    def called(self) -> Iterator[None]:
        """Let the others wait, however long the call takes."""
        self.world.called(self.number, True)
        try:
            yield
        finally:
            self.world.called(self.number, False)

    def hurry(self) -> None:
        """Go on by the wall clock from now, as a mind is asked: the body stands until it is called."""
        self.world.hurry(self.number)

    def reset(self, scene: Scene, start: Pose2D) -> WorldState:
        state: WorldState = self.world.do(self.number, (scene, start))
        return state

    def execute(self, motion: Motion) -> Execution:
        execution: Execution = self.world.do(self.number, motion)
        return execution

    def grip(self, side: Side, closed: bool) -> None:
        self.world.do(self.number, Grip(side, closed))

    def speak(self, text: str) -> bool:
        """Let the others hear a text in their next half second, the first alone. Return whether this one is it."""
        heard = self.number not in self.world.said
        self.world.said.setdefault(self.number, text)
        return heard

    def state(self) -> WorldState:
        return self.world.state(self.number)

    def close(self) -> None:
        """Stand from now on."""
        self.world.leave(self.number)


class _World:
    """The clock of a company: it moves on once every body that plays has said what it does next."""

    def __init__(self, simulator: SharedSimulator, count: int) -> None:
        self._simulator, self._count = simulator, count
        self.patience: float | None = None
        self._changed = threading.Condition()
        self.bodies: Sequence[Body] = ()
        self._playing: set[int] = set()
        self._called: set[int] = set()
        self._late: set[int] = set()
        self._due: dict[int, float] = {}
        """Of each body by the wall clock when the others go on without it, until it is called."""
        self._acts: dict[int, _Act] = {}
        self._answers: dict[int, Any] = {}
        self.said: dict[int, str] = {}
        self._scene: Scene | None = None

    def enter(self, *numbers: int) -> None:
        """Wait from now on for these bodies, or for every one."""
        with self._changed:
            for number in numbers or range(self._count):
                self._playing.add(number)
                self._due.pop(number, None)

    def leave(self, number: int) -> None:
        """Wait no longer for a body."""
        with self._changed:
            self._playing.discard(number)
            self._move_on()

    def called(self, number: int, begins: bool) -> None:
        """Hold a body for late no more, since its call begins; or perhaps again, since it ends."""
        with self._changed:
            self._late.discard(number)
            (self._called.add if begins else self._called.discard)(number)
            self._move_on()

    def hurry(self, number: int) -> None:
        """Wait for a body half a second, unless that began earlier in this half second of the world."""
        with self._changed:
            self._due.setdefault(number, time.monotonic() + _HALF)
            self._changed.notify_all()

    def do(self, number: int, act: _Act) -> Any:
        """Return the outcome of an act, once it is done together with those of the others."""
        with self._changed:
            if number not in self._playing:
                raise HumanclawError("this body plays no part now.", "Give it one with Company.play().")
            self._acts[number] = act
            self._move_on()
            while number in self._acts:
                wait = self._wait
                if not self._changed.wait(wait):
                    self._late |= self._thinking if wait == self.patience else set()
                    self._move_on()
            answer = self._answers[number]
        if isinstance(answer, Exception):
            raise answer
        return answer

    def state(self, number: int) -> WorldState:
        with self._changed:
            return self._simulator.states()[number]

    def close(self) -> None:
        with self._changed:
            self._simulator.close()

    @property
    def _thinking(self) -> set[int]:
        return self._playing - self._acts.keys() - self._called

    @property
    def _wait(self) -> float | None:
        """Seconds until one who thinks may be late; None for ever."""
        now = time.monotonic()
        left = [due - now for due in self._due.values() if due > now]
        return min(left if self.patience is None else [*left, self.patience], default=None)

    def _move_on(self) -> None:
        """Do what all have asked for, if all have but those who are late."""
        now = time.monotonic()
        late = self._late | {number for number in self._thinking if self._due.get(number, now + 1) <= now}
        if self._acts and self._playing - late <= self._acts.keys():
            self._do_now()

    def _do_now(self) -> None:
        """Do what was asked for; if hands are to grip, that alone, since who grips has a motion to ask for."""
        grips = {number: act for number, act in sorted(self._acts.items()) if isinstance(act, Grip)}
        acts = grips or self._acts
        self._acts = {number: act for number, act in self._acts.items() if number not in acts}
        try:
            self._answers |= self._gripped(grips) if grips else self._done(acts)
        except Exception as error:
            self._answers |= dict.fromkeys(acts, error)
        self._changed.notify_all()

    def _gripped(self, grips: Mapping[int, Grip]) -> Mapping[int, None]:
        for number, grip in grips.items():
            self._simulator.grip(grip.hand, grip.closed, number)
        return dict.fromkeys(grips)

    def _done(self, acts: Mapping[int, _Act]) -> Mapping[int, Execution | WorldState]:
        motions = {number: act for number, act in acts.items() if isinstance(act, Motion)}
        if len(motions) == len(acts):
            return self._executed(motions)
        starts = [act for _, act in sorted(acts.items()) if isinstance(act, tuple)]
        if len(starts) < self._count or len({scene.digest for scene, _ in starts}) > 1:
            places = ", ".join(f"{scene.name} (x {start.x:.2f}, z {start.z:.2f})" for scene, start in starts)
            raise HumanclawError(
                f"{len(starts)} of {self._count} bodies of a company begin; all do at once, in one scene: {places}.",
                "Let all begin together; an episode begins where its body stands already with spec.start=body.start.",
            )
        self._scene, self.said = starts[0][0], {}
        return dict(enumerate(self._simulator.reset_all(self._scene, [start for _, start in starts])))

    def _executed(self, motions: dict[int, Motion]) -> Mapping[int, Execution]:
        standing = [number for number in range(self._count) if number not in motions]
        motions = motions | {number: self.bodies[number].stands() for number in standing}
        executions = self._simulator.execute_all([motions[number] for number in range(self._count)])
        self._due = {number: due + _HALF for number, due in self._due.items() if number in standing}
        said, self.said = self.said, {}
        if said:
            after = self._simulator.states()
            executions = [replace(done, heard=self._heard(k, said, after)) for k, done in enumerate(executions)]
        for number in standing:
            self.bodies[number].stood(executions[number], number in self._playing)
        return dict(enumerate(executions))

    def _heard(self, listener: int, said: Mapping[int, str], states: Sequence[WorldState]) -> tuple[Heard, ...]:
        """Return what a body hears of what was said, in the order of the speakers' seats."""
        here = states[listener].body
        heads = {k: states[k].body.joints()[-1, JOINT_INDEX["head"]] for k in said.keys() - {listener}}
        voices = {k: Pose2D.of(here).point_to_local(head).round(4).tolist() for k, head in heads.items()}
        near = {k for k in heads if self._carries(states[k], states[listener])}
        return tuple(Heard(text, (*voices[k],)) for k, text in sorted(said.items()) if k in near)

    def _carries(self, speaker: WorldState, listener: WorldState) -> bool:
        source, ear = speaker.body.root[-1], listener.body.root[-1]
        if np.linalg.norm(source - ear) > HEARING:
            return False
        assert self._scene is not None
        return voice_distance(self._scene, speaker.objects, source, ear) <= HEARING


def places_together(scene: Scene, count: int) -> list[Pose2D]:
    """Return the start of a scene and free places beside it, so many in all: 1.5 m away, 3 m and so on, looking at it.

    Raises SceneError if there is none within 5 m.
    """
    # So they are apart from one another, too.
    return [scene.start, *(_place_beside(scene, scene.start, 1.5 * number) for number in range(1, count))]


def _place_beside(scene: Scene, start: Pose2D, metres: float) -> Pose2D:
    where = np.array([start.x, start.floor, start.z])
    ways = MultiFloorMap.of(scene).starts(where)
    free = np.concatenate(ways) if ways else np.empty((0, 3))
    far = np.linalg.norm(free - where, axis=1)
    if not (near := (far > metres / 2) & (far < 5)).any():
        raise SceneError(f"there is no free place beside the start of scene {scene.name!r}.", "Choose another scene.")
    x, floor, z = map(float, free[near][np.abs(far[near] - metres).argmin()])
    return Pose2D(x, z, float(np.arctan2(start.x - x, start.z - z)), floor)
