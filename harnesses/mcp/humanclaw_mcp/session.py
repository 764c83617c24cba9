"""One client's body. The client is the decision maker of the same loop that every episode runs in.

The loop asks for a decision and blocks; a client calls whenever it likes. So each session's loop runs on a thread of its own, and
the two meet in an exchange: one order in, one moment out. A stage that all sessions share lets one of them move at a time: the
simulator is not made for threads, and what a body does must not depend on what another one does meanwhile.
"""

from __future__ import annotations

import datetime
import queue
import threading
import time
import uuid
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.embodiment import Body, Engines
from humanclaw.episode import EpisodeSpec
from humanclaw.errors import HumanclawError
from humanclaw.hookspecs import hookimpl
from humanclaw.interfaces import Decision, EpisodeContext, Observation, Past, WorldState
from humanclaw.loop import run_episode
from humanclaw.navigation import geodesics
from humanclaw.plugins import Plugins
from humanclaw.records import Outcome, StepRecord
from humanclaw.scene import Placement
from humanclaw.tasks import free_episode
from humanclaw_mcp.settings import Settings

_MOVING: Final = "The body is moving."


@dataclass(frozen=True)
class NewEpisode:
    """The order to begin again, and the values that were chosen for it."""

    instruction: str
    scene: str
    seed: int


@dataclass(frozen=True)
class Look:
    """The order to say how things are."""


@dataclass(frozen=True)
class Close:
    """The order to put the body away."""


Order = Decision | NewEpisode | Look | Close


@dataclass(frozen=True)
class Moment:
    """How things are between two orders."""

    rgb: NDArray[np.uint8]
    """(512, 512, 3): what the eyes see."""
    world: WorldState
    start: Placement
    feedback: str
    """What became of the order, in words."""
    refused: bool
    """Whether the order was a call that was not executed."""
    outcome: Outcome
    instruction: str
    max_steps: int
    steps: tuple[StepRecord, ...]
    """Every step of the episode so far."""


class _NextOrder(Exception):  # noqa: N818 - it leaves the loop; nothing has failed
    """An order other than a call: the episode is broken off, and the order is carried out."""

    def __init__(self, order: Order) -> None:
        self.order = order


class _Steps:
    """Collects the steps of the episodes that one session plays."""

    def __init__(self) -> None:
        self.taken: list[StepRecord] = []

    @hookimpl
    def humanclaw_step(self, step: StepRecord) -> None:
        self.taken.append(step)


class Session:
    """A body and its episodes, one after another. Thread-safe: orders are carried out one at a time."""

    privileged = False

    def __init__(self, plugins: Plugins, settings: Settings, stage: threading.Lock, client: str = "") -> None:
        """plugins: this session's own, since it observes its episodes through them. stage: shared by all sessions."""
        self.name = f"mcp:{client}" if client else "mcp"
        self.used = time.monotonic()
        self._plugins, self._settings, self._stage = plugins, settings, stage
        self._orders: queue.SimpleQueue[Order] = queue.SimpleQueue()
        self._answers: queue.SimpleQueue[Moment | Exception] = queue.SimpleQueue()
        self._turn = threading.Lock()
        self._closed = False
        self._doing = ""
        self._id = f"{datetime.datetime.now():%Y%m%d-%H%M%S}-{uuid.uuid4().hex[:8]}"
        self._begun = 0
        self._episode = NewEpisode(settings.instruction, settings.scenes[0], settings.seed)
        self._body: Body | None = None
        self._steps = _Steps()
        self._told = 0
        self._pending: Decision | None = None
        self._last: Moment | None = None
        plugins.add(self._steps, f"mcp_{self._id}")
        self._thread = threading.Thread(target=self._live, name=f"body-{self._id}", daemon=True)
        self._thread.start()

    # -- the client's side ---------------------------------------------------------------------------------------------
    @property
    def busy(self) -> bool:
        return self._turn.locked()

    @property
    def title(self) -> str:
        """Names the current episode in its record."""
        return f"mcp-{self._id}-{self._begun}"

    @property
    def doing(self) -> str:
        """What an order under way waits for, in words."""
        return self._doing

    @property
    def episode(self) -> NewEpisode:
        """The current episode, or the one that the first order will begin."""
        return self._episode

    @property
    def steps(self) -> tuple[StepRecord, ...]:
        """The steps of the current episode so far."""
        return tuple(self._steps.taken)

    def look(self) -> Moment:
        """How things are; makes the body if there is none yet."""
        return self._ask(Look())

    def call(self, decision: Decision) -> Moment:
        """Take one step. A call that the loop refuses is a moment with `refused`, not an error."""
        return self._ask(decision)

    def restart(self, episode: NewEpisode) -> Moment:
        """Begin a new episode, whatever the last one had come to."""
        return self._ask(episode)

    def close(self) -> None:
        """Put the body away; an episode under way is recorded as interrupted. Waits for a call under way."""
        with self._turn:
            if not self._closed:
                self._closed = True
                self._orders.put(Close())
                self._thread.join()

    def _ask(self, order: Order) -> Moment:
        with self._turn:
            if self._closed:
                raise HumanclawError("this body has been put away.", "Open a new session.")
            self._orders.put(order)
            answer = self._answers.get()
            self.used = time.monotonic()
        if isinstance(answer, Exception):
            raise answer
        return answer

    # -- the body's side, on its own thread ----------------------------------------------------------------------------
    def _live(self) -> None:
        with self._stage:
            order = self._wait()
            while not isinstance(order, Close):
                order = self._carry_out(order)
            if self._body:
                self._body.close()

    def _carry_out(self, order: Order) -> Order:
        """Outside an episode. Returns the order that comes next, as does every method that gives an answer."""
        if self._last is not None and not isinstance(order, NewEpisode):
            return self._answer(_afterwards(self._last, order))
        try:
            return self._play(order)
        except _NextOrder as turn:
            return turn.order
        except Exception as error:
            if self._last is not None:
                self._last = replace(self._last, outcome="interrupted")
            return self._answer(error)

    def _play(self, order: Order) -> Order:
        """An episode from its beginning to its end, or to an order that breaks it off."""
        if isinstance(order, NewEpisode):
            self._episode = order
        # The order that brings the body into being may be a call already; the loop is given it as soon as it asks.
        self._pending = order if isinstance(order, Decision) else None
        self._steps.taken, self._told, self._last = [], 0, None
        body = self._embody()
        record = run_episode(body, self._spec(body), self, folder=self._folder(), ruler=geodesics)
        return self._answer(self._moment(body.view().rgb, self._steps.taken[-1].feedback, record.outcome))

    def _embody(self) -> Body:
        reference, seed = self._episode.scene, self._episode.seed
        if self._body is None:
            self._doing = "The body is being made."
            asked = self._settings
            engines = Engines(asked.simulator, Engines.renderer, asked.generator, asked.profile, asked.senses)
            self._body = Body(reference, seed=seed, plugins=self._plugins, engines=engines)
            self._doing = _MOVING
        elif self._body.scene.name != reference:
            self._body.reset(reference, seed=seed)
        return self._body

    def _spec(self, body: Body) -> EpisodeSpec:
        self._begun += 1
        episode, limit = self._episode, self._settings.max_steps
        return free_episode(episode.instruction, body.scene, seed=episode.seed, max_steps=limit, name=self.title)

    def _folder(self) -> Path | None:
        return self._settings.out / self.title if self._settings.out else None

    # -- as the loop's decision maker ----------------------------------------------------------------------------------
    def begin(self, context: EpisodeContext) -> None:
        """The client learns its task from the prompt."""

    def decide(self, observation: Observation, history: Sequence[Past]) -> Decision:
        """Tell the client what became of its last call, and wait for the next."""
        order: Order = self._pending or self._answer(self._moment(observation.rgb, observation.feedback))
        self._pending = None
        while isinstance(order, Look) and self._last:
            order = self._answer(_afterwards(self._last, order))
        if not isinstance(order, Decision):
            raise _NextOrder(order)
        return order

    def _moment(self, rgb: NDArray[np.uint8], feedback: str, outcome: Outcome = "running") -> Moment:
        body, steps = self._body, self.steps
        assert body is not None
        new, self._told = steps[self._told :], len(steps)
        executed = any(step.status != "invalid" for step in new)
        self._last = Moment(
            rgb=rgb,
            world=body.state(),
            start=body.start,
            feedback=feedback,
            refused=bool(feedback) and not executed,
            outcome=outcome,
            instruction=self._episode.instruction,
            max_steps=self._settings.max_steps,
            steps=steps,
        )
        return self._last

    # -- the exchange --------------------------------------------------------------------------------------------------
    def _answer(self, answer: Moment | Exception) -> Order:
        self._answers.put(answer)
        return self._wait()

    def _wait(self) -> Order:
        """The next order. The stage is free for other bodies until it comes."""
        self._stage.release()
        try:
            return self._orders.get()
        finally:
            self._doing = "Another body is moving; this one is next."
            self._stage.acquire()
            self._doing = _MOVING


def _afterwards(moment: Moment, order: Order) -> Moment:
    """The same moment again: nothing has happened, and a call that comes after the end is refused."""
    if isinstance(order, Look):
        return replace(moment, refused=False, feedback="")
    ended = f"the episode has ended ({moment.outcome.replace('_', ' ')})"
    return replace(moment, refused=True, feedback=f"Nothing was executed: {ended}. Call reset to begin another.")
