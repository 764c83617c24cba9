"""A client's body and its episodes, one after another.

Requests come on any thread. A session runs one at a time, and a lock that all sessions share lets one body move at a
time: the simulator is not thread-safe, and the motion of a body must not depend on other bodies.
"""

from __future__ import annotations

import datetime
import threading
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import Backends, Body, Decision, Episode, HumanclawError, Plugins, StepRecord
from humanclaw.body import Pose2D
from humanclaw.records import Outcome, free_episode
from humanclaw.world import WorldState, geodesics
from humanclaw_mcp.settings import Settings

_LONGEST_NAME: Final = 64
_MAKING: Final = "The body is being made."
_MOVING: Final = "The body is moving."
_WAITING: Final = "Another body is moving; this one is next."


@dataclass(frozen=True)
class Task:
    """The task of an episode."""

    instruction: str
    scene: str
    seed: int


@dataclass(frozen=True)
class Snapshot:
    """The state between two requests."""

    rgb: NDArray[np.uint8]
    """(512, 512, 3): the view."""
    world: WorldState
    start: Pose2D
    feedback: str
    """Result of the request, as text."""
    refused: bool
    """Whether the request was a call that was not executed."""
    outcome: Outcome
    instruction: str
    max_steps: int
    steps: tuple[StepRecord, ...]
    """Every step of the episode so far."""


def printable(client: str) -> str:
    """Return a client's name for use in tables: one line of at most 64 characters."""
    return "".join(letter if letter.isprintable() else " " for letter in client[:_LONGEST_NAME])


class Session:
    """A body and its episodes. Thread-safe: requests run one at a time."""

    def __init__(self, plugins: Plugins, settings: Settings, stage: threading.Lock, client: str = "") -> None:
        """Make nothing before the first request. stage: lock shared by all sessions."""
        self.used = time.monotonic()
        self.doing = ""
        """Activity of the current request, as text."""
        self.task = Task(settings.instruction, settings.scenes[0], settings.seed)
        """Task of the current episode, or of the first one before it begins."""
        self._name = f"mcp:{printable(client)}" if client else "mcp"
        self._plugins, self._settings, self._stage = plugins, settings, stage
        self._turn = threading.Lock()
        self._id = f"{datetime.datetime.now():%Y%m%d-%H%M%S}-{uuid.uuid4().hex[:8]}"
        self._begun = 0
        self._body: Body | None = None
        self._episode: Episode | None = None
        self._closed = False

    @property
    def busy(self) -> bool:
        return self._turn.locked()

    @property
    def title(self) -> str:
        """Name of the current episode in its record."""
        return f"mcp-{self._id}-{self._begun}"

    @property
    def steps(self) -> tuple[StepRecord, ...]:
        """The steps of the current episode so far."""
        return self._episode.steps if self._episode else ()

    def look(self) -> Snapshot:
        """Return the current state; make the body if there is none yet."""
        with self._acting():
            return self._snapshot(self._episode or self._begin())

    def call(self, decision: Decision) -> Snapshot:
        """Take one step. A refused call returns a snapshot with `refused` and raises nothing."""
        with self._acting():
            episode = self._episode or self._begin()
            if episode.done:
                ended = f"the episode has ended ({episode.outcome.replace('_', ' ')})"
                words = f"Nothing was executed: {ended}. Call reset to begin another."
                return self._snapshot(episode, words, refused=True)
            episode.submit(decision)
            feedback = episode.observe().feedback
            return self._snapshot(episode, str(feedback), refused=bool(feedback.refusal))

    def restart(self, task: Task) -> Snapshot:
        """End the current episode, if any, and begin a new one."""
        with self._acting():
            self.task = task
            return self._snapshot(self._begin())

    def stop(self) -> None:
        """Stop the current call and refuse further ones, without waiting."""
        # Without the lock: the running call holds it until it ends.
        if self._episode:
            self._episode.stop()

    def close(self) -> None:
        """Close the body after the current request; an unfinished episode is recorded as interrupted."""
        with self._turn, self._stage:
            self._closed = True
            self._end()
            if self._body:
                self._body.close()
                self._body = None

    @contextmanager
    def _acting(self) -> Iterator[None]:
        """Run one request of this session and one body of the server at a time."""
        with self._turn:
            if self._closed:
                raise HumanclawError("this body has been put away.", "Open a new session.")
            self.doing = _WAITING
            with self._stage:
                self.doing = _MOVING
                try:
                    yield
                finally:
                    self.used = time.monotonic()

    def _begin(self) -> Episode:
        self._end()
        self._begun += 1
        body, task, settings = self._embody(), self.task, self._settings
        spec = free_episode(task.instruction, body.scene, seed=task.seed, max_steps=settings.max_steps, name=self.title)
        folder: Path | None = settings.out / self.title if settings.out else None
        judge = self._plugins.make("verifiers", settings.verifier, settings.options) if settings.verifier else None
        self._episode = Episode(body, spec, self._name, judge, folder=folder, distance=geodesics)
        return self._episode

    def _end(self) -> None:
        if self._episode:
            self._episode.close()
            self._episode = None

    def _embody(self) -> Body:
        """Return the body in the scene of the task; make or move it there if needed."""
        if self._body is None:
            self.doing, asked = _MAKING, self._settings
            backends = Backends(
                asked.simulator, generator=asked.generator, profile=asked.profile, sensors=asked.sensors,
                prior=asked.prior,
            )  # fmt: skip
            self._body = Body(self.task.scene, plugins=self._plugins, backends=backends)
            self.doing = _MOVING
        elif self._body.scene.name != self.task.scene:
            self._body.reset(self.task.scene)
        return self._body

    def _snapshot(self, episode: Episode, feedback: str = "", refused: bool = False) -> Snapshot:
        return Snapshot(
            rgb=episode.observe().rgb,
            world=episode.body.state(),
            start=episode.body.start,
            feedback=feedback,
            refused=refused,
            outcome=episode.outcome,
            instruction=episode.spec.instruction,
            max_steps=episode.spec.max_steps,
            steps=episode.steps,
        )
