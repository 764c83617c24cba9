"""Bodies and their episodes, one after another: the settings, and a client's session.

Requests come on any thread. A session runs one at a time, and a lock that all sessions share lets one body move at a
time: the simulator is not thread-safe, and the motion of a body must not depend on other bodies.
"""

from __future__ import annotations

import datetime
import os
import threading
import time
import uuid
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Final, Literal

import numpy as np
from numpy.typing import NDArray

from humanclaw import Backends, Body, Decision, Episode, HumanclawError, Plugins, StepRecord, Verifier
from humanclaw.body import Pose2D
from humanclaw.cli import legible
from humanclaw.records import Outcome, free_episode
from humanclaw.world import WorldState, geodesics

_SHORTEST_TOKEN: Final = 16
"""Characters: shorter tokens can be guessed."""
SESSION_HEADER: Final = "mcp-session-id"
SESSIONS: Final = 256
"""Most open sessions. A session needs little memory; bodies have their own limit."""


@dataclass(frozen=True)
class Settings:
    """Settings of bodies and their episodes. Raises HumanclawError for invalid values."""

    scenes: tuple[str, ...] = ("house:0",)
    """Scenes that a client may choose; the first is the default."""
    instruction: str = "Do as you are asked."
    """Task in the record, unless the client gives one."""
    seed: int = 0
    max_steps: int = 100
    profile: Literal["default", "paper"] = "default"
    simulator: str = ""
    """Name of the simulator; empty for the default one."""
    generator: str = Backends.generator
    prior: str = Backends.prior
    sensors: tuple[str, ...] = ()
    """Sensors of an answer besides the view (humanclaw.episodes)."""
    reasoning: bool = False
    """Whether a call must also say what is seen and why, as in the benchmark."""
    verifier: str = ""
    """Name of the verifier that checks each call before the body moves; empty for none."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """Options of the verifier, such as its model."""
    bodies: int = 4
    """Most bodies at one time, one for each session."""
    company: int = 0
    """Bodies of the one house that all sessions share; 0 for a house for each session."""
    patience: float = 30.0
    """Seconds that the bodies of a shared house wait for one that is not called; then it stands."""
    idle: float = 900.0
    """Seconds without a call after which a body is closed."""
    progress_every: float = 1.0
    """Seconds between two progress messages to a client that asked for them."""
    auth_env: str = ""
    """Environment variable with the token that every HTTP request must carry; empty for none."""
    out: Path | None = None
    """Folder for the records of the episodes; None keeps none."""

    @property
    def token(self) -> str:
        """Token that HTTP requests must carry; empty for none."""
        return os.environ.get(self.auth_env, "").strip() if self.auth_env else ""

    def __post_init__(self) -> None:
        if self.auth_env and len(self.token) < _SHORTEST_TOKEN:
            fault = f"{self.auth_env} holds no token of {_SHORTEST_TOKEN} letters or more."
            raise HumanclawError(fault, f'For example: export {self.auth_env}="$(openssl rand -hex 32)".')
        if self.options and not self.verifier:
            raise HumanclawError("--option belongs to a verifier, and none is named.", "Add --verifier NAME.")
        if not self.instruction.strip():
            raise HumanclawError("the instruction is empty.", "Say what the body is to do.")
        if self.company and len(self.scenes) > 1:
            raise HumanclawError(f"one house is shared; got {len(self.scenes)} scenes.", "Name one.")

    def backends(self) -> Backends:
        """Return the parts that bodies are made of."""
        return Backends(
            self.simulator, generator=self.generator, profile=self.profile, sensors=self.sensors, prior=self.prior
        )


_MAKING: Final = "The body is being made."
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
    max_steps: int
    steps: tuple[StepRecord, ...]
    """Every step of the episode so far."""


def new_title() -> str:
    """Return a name for new records."""
    return f"mcp-{datetime.datetime.now():%Y%m%d-%H%M%S}-{uuid.uuid4().hex[:8]}"


def verifier_of(plugins: Plugins, settings: Settings) -> Verifier | None:
    """Return a verifier for an episode, if the settings name one."""
    return plugins.make("verifiers", settings.verifier, settings.options) if settings.verifier else None


class Session:
    """A body and its episodes. Thread-safe: requests run one at a time."""

    next_episode: ClassVar = "Call reset to begin another."
    moving: ClassVar = "The body is moving."

    def __init__(
        self, plugins: Plugins, settings: Settings, motion_lock: AbstractContextManager[Any], client: str = ""
    ) -> None:
        """Make nothing before the first request. motion_lock: lock shared by all sessions."""
        self.used = time.monotonic()
        self.doing = ""
        """Activity of the current request, as text."""
        self.task = Task(settings.instruction, settings.scenes[0], settings.seed)
        """Task of the current episode, or of the first one before it begins."""
        # The client names itself, and tables of records show it: one line, without controls.
        self._name = f"mcp:{' '.join(legible(client).split())}" if client else "mcp"
        self._plugins, self._settings, self._motion_lock = plugins, settings, motion_lock
        self._turn = threading.Lock()
        self._title = new_title()
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
        return f"{self._title}-{self._begun}"

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
                words = f"Nothing was executed: {ended}. {self.next_episode}"
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
        with self._turn, self._motion_lock:
            self._closed = True
            self._end()
            self._put_away()

    def _put_away(self) -> None:
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
            with self._motion_lock:
                self.doing = self.moving
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
        judge = verifier_of(self._plugins, settings)
        self._episode = Episode(body, spec, self._name, judge, folder=folder, distance=geodesics)
        return self._episode

    def _end(self) -> None:
        if self._episode:
            self._episode.close()
            self._episode = None

    def _embody(self) -> Body:
        """Return the body in the scene of the task; make or move it there if needed."""
        if self._body is None:
            self.doing = _MAKING
            self._body = Body(self.task.scene, plugins=self._plugins, backends=self._settings.backends())
            self.doing = self.moving
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
            max_steps=episode.spec.max_steps,
            steps=episode.steps,
        )
