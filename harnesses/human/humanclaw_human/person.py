"""The agent: shows the view, reads a line, and asks again until the line is a call."""

from __future__ import annotations

import os
import queue
import sys
import threading
import weakref
import webbrowser
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, TextIO

import click
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from humanclaw import CallError, Decision, EpisodeContext, HistoryEntry, HumanclawError, Observation, PluginError, Skill
from humanclaw_human.commands import forms, keys, manual, parse
from humanclaw_human.window import Controls, Moment, Window

_REVISIT: Final = 1.0
"""Seconds in which the page of the episode before may come back to the same port; else a new one is opened."""
_POLL: Final = 0.2
"""Seconds; on some systems Ctrl-C is not heard while one waits without an end."""


class Settings(BaseModel):
    """Options of `--agent human`. Those that only concern a model are accepted, so that one command line serves
    both."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    profile: str = "default"
    browser: bool = True
    """Whether to open the page."""
    port: int = Field(0, ge=0, le=65535)
    """Of the page; 0 takes any free one."""

    @classmethod
    def of(cls, options: Mapping[str, Any]) -> Settings:
        """Read a person's options. Raises HumanclawError for an option that a person does not have."""
        try:
            return cls(**options)
        except ValidationError as error:
            first = error.errors()[0]
            raise HumanclawError(
                f"--option {first['loc'][0]}: {first['msg']}.", "A person's options are browser and port."
            ) from None


class Person:
    """Reads decisions from `ask`, which gets a prompt and returns a line; by default the terminal and the page.

    A person is told what a model is told: `at_terminal` keeps what only the scene knows off the terminal.
    """

    name = "human"
    privileged = False
    at_terminal = True

    def __init__(self, settings: Settings, ask: Callable[[str], str] | None = None) -> None:
        self.settings = settings.model_dump()
        self._settings = settings
        self._lines = Lines()
        self._ask = ask or self._lines.ask
        self._window: Window | None = None

    def begin(self, context: EpisodeContext) -> None:
        self._skills, self._most = context.skills, context.spec.max_steps
        if self._window is None:
            self._window = _opened(self._settings, self._lines.put, self._skills)
            weakref.finalize(self, self._window.close)
        click.echo(
            f"{context.spec.instruction}\n{manual(self._skills)}\nAfter #, say what you see. The view: "
            f"{self._window.address}"
        )

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        assert self._window is not None
        past = tuple((str(entry.executed or "no call"), str(entry.feedback)) for entry in history)
        told = (observation.instruction, str(observation.feedback), past)
        self._window.show(observation.rgb, Moment(observation.step, self._most, *told))
        if observation.feedback:
            click.echo(str(observation.feedback))
        while True:
            line = self._ask(f"step {observation.step} > ")
            if line.strip().lower() in ("help", "?"):
                click.echo(manual(self._skills))
                continue
            try:
                command = parse(line, self._skills)
            except CallError as error:
                click.echo(error)
                continue
            self._window.settle()
            return Decision((command.call,), command.seen, raw=line)


class Lines:
    """Lines from the terminal and from the page, in the order in which they come."""

    def __init__(self) -> None:
        self._queue: queue.Queue[str | None] = queue.Queue()
        self._reading = False

    def put(self, line: str | None) -> None:
        """Take the line of a key or button; None when the person leaves."""
        click.echo(line or "left")
        self._queue.put(line)

    def ask(self, prompt: str) -> str:
        """Wait for the next line. Raises KeyboardInterrupt when the person leaves or the terminal is closed."""
        click.echo(prompt, nl=False)
        if not self._reading and not _is_nothing(sys.stdin):
            self._reading = True
            threading.Thread(target=self._read, daemon=True).start()
        while True:
            try:
                line = self._queue.get(timeout=_POLL)
            except queue.Empty:
                continue
            if line is None:
                raise KeyboardInterrupt
            return line

    def _read(self) -> None:
        for line in sys.stdin:
            self._queue.put(line)
        self._queue.put(None)


def _is_nothing(stream: TextIO) -> bool:
    """Whether there is no terminal behind it, as in the processes of a benchmark: then the page alone is asked."""
    try:
        return os.path.samestat(os.fstat(stream.fileno()), os.stat(os.devnull))
    except (OSError, ValueError):
        return False


def _opened(settings: Settings, submit: Callable[[str | None], None], skills: Mapping[str, Skill]) -> Window:
    controls = Controls(keys(skills), forms(skills))
    try:
        window = Window(settings.port, submit, lambda line: parse(line, skills), controls)
    except OSError as error:
        raise PluginError(
            f"the view cannot be served on port {settings.port}: {error.strerror}.", "Choose another --option port=N."
        ) from error
    if settings.browser:
        threading.Timer(_REVISIT, lambda: window.visited or webbrowser.open(window.address)).start()
    return window
