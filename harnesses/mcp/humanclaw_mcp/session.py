"""Bodies and their episodes, one after another: the settings, a client's session, and the sessions of a server.

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
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

import anyio
import anyio.to_thread
import numpy as np
from numpy.typing import NDArray

from humanclaw import Backends, Body, Decision, Episode, HumanclawError, Plugins, StepRecord
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
    max_steps: int
    steps: tuple[StepRecord, ...]
    """Every step of the episode so far."""


class Session:
    """A body and its episodes. Thread-safe: requests run one at a time."""

    def __init__(self, plugins: Plugins, settings: Settings, motion_lock: threading.Lock, client: str = "") -> None:
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
        with self._turn, self._motion_lock:
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
            with self._motion_lock:
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
            max_steps=episode.spec.max_steps,
            steps=episode.steps,
        )


class Bodies:
    """One body for each session, up to a limit. Used from one event loop; the bodies move on worker threads."""

    def __init__(self, settings: Settings, plugins: Plugins | None = None) -> None:
        """plugins: shared by all sessions; by default the installed ones."""
        self.settings = settings
        self.plugins = plugins or Plugins.discover()
        self._motion_lock = threading.Lock()
        self._sessions: dict[str, Session] = {}
        self._evicted: set[str] = set()

    def __len__(self) -> int:
        return len(self._sessions)

    def find(self, key: str) -> Session | None:
        return self._sessions.get(key)

    def of(self, key: str, client: str) -> Session:
        """Return the body of a session; make it if there is none.

        Raises HumanclawError at the limit, and once after an idle body was closed: a client must not take a new body
        for the old one.
        """
        if key in self._evicted:
            self._evicted.remove(key)
            idle = f"your body was put away after {self.settings.idle:g} seconds without a call."
            raise HumanclawError(idle, "Call reset to begin with a new one.")
        if key not in self._sessions:
            if len(self) >= self.settings.bodies:
                raise HumanclawError(
                    f"all {self.settings.bodies} bodies of this server are in use.",
                    "Try again later, end another session, or start the server with a larger --bodies.",
                )
            self._sessions[key] = Session(self.plugins, self.settings, self._motion_lock, client)
        return self._sessions[key]

    async def release(self, key: str) -> None:
        """Close a session's body, if it has one."""
        self._evicted.discard(key)
        session = self._sessions.pop(key, None)
        if session:
            await anyio.to_thread.run_sync(session.close)

    async def evict_idle(self) -> None:
        """Close the bodies without a call for `idle` seconds."""
        oldest = time.monotonic() - self.settings.idle
        for key in [key for key, session in self._sessions.items() if session.used < oldest and not session.busy]:
            await self.release(key)
            self._evicted.add(key)

    async def reap_idle(self) -> None:
        """Release idle bodies while the server runs."""
        while True:
            await anyio.sleep(min(self.settings.idle / 4, 30.0))
            await self.evict_idle()

    async def close(self) -> None:
        """Close all bodies; running calls stop after their current chunk of motion."""
        for session in self._sessions.values():
            session.stop()
        for key in list(self._sessions):
            await self.release(key)
