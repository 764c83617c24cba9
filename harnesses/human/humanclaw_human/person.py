"""The agent: it shows the view and reads lines until one is a call."""

from __future__ import annotations

import os
import queue
import sys
import threading
import weakref
import webbrowser
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Final, TextIO

import click
from pydantic import BaseModel, ConfigDict, Field

from humanclaw import CallError, Decision, EpisodeContext, HistoryEntry, Observation, Skill
from humanclaw.records import REPORT
from humanclaw_human.commands import forms, in_words, keys, manual, parse
from humanclaw_human.window import Controls, PageServer, PageState

_REVISIT: Final = 1.0
"""Seconds for the last episode's page to reconnect to the same port, before a new page opens."""
_POLL: Final = 0.2
"""Seconds between two looks for a line. Some systems ignore Ctrl-C during a wait without a timeout."""


class Settings(BaseModel):
    """Options of `--agent human`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    profile: str = "default"
    """Ignored; accepted so that one command line serves models and persons."""
    browser: bool = True
    """Whether to open the page in the browser."""
    port: int = Field(0, ge=0, le=65535)
    """Port of the page; 0 for any free port."""
    views_between: int = Field(6, ge=0, le=14)
    """Views that the page shows of each half second of motion. A model sees none, so the record tells their number."""


class Person:
    """Reads decisions from `ask`, which gets a prompt and returns a line; by default from terminal and page.

    A person gets the same information as a model: `at_terminal` keeps facts of the scene off the terminal.
    """

    name = "human"
    privileged = False
    at_terminal = True

    def __init__(self, settings: Settings, ask: Callable[[str], str] | None = None) -> None:
        self.settings = settings.model_dump()
        self._settings = settings
        self._lines = InputQueue()
        self._ask = ask or self._lines.ask
        self._window: PageServer | None = None

    def begin(self, context: EpisodeContext) -> None:
        self._skills, self._most = context.skills, context.spec.max_steps
        if self._window is None:
            self._window, self._link, closing = _opened(self._settings, self._lines.put, self._skills)
            # One page serves all episodes of a run, so it closes with the agent.
            weakref.finalize(self, closing.close)
        click.echo(
            f"{context.spec.instruction}\n{manual(self._skills)}\nAfter #, say what you see. "
            f"Open the view: {self._link}"
        )

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        assert self._window is not None
        past = tuple((str(entry.executed or "no call"), str(entry.feedback)) for entry in history)
        told = (observation.instruction, str(observation.feedback), past)
        self._window.show(observation.rgb, PageState(observation.step, self._most, *told, observation.between))
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
            # The page must not add a second call to one that came from the terminal.
            self._window.settle()
            return Decision((command.call,), command.seen, raw=line)

    def show_result(self, result: str, run: Path) -> None:
        """End the page with the result, and with the run's page once a reporter has written it."""
        if self._window:
            self._window.end(result, run / REPORT)


class InputQueue:
    """InputQueue from the terminal and the page, in order of arrival."""

    def __init__(self) -> None:
        self._queue: queue.Queue[str | None] = queue.Queue()
        self._reading = False

    def put(self, line: str | None) -> None:
        """Add the line of a key or button; None if the person leaves."""
        click.echo(line or "left")
        self._queue.put(line)

    def ask(self, prompt: str) -> str:
        """Wait for the next line. Raises KeyboardInterrupt if the person leaves or the terminal closes."""
        click.echo(prompt, nl=False)
        # The terminal is read on a thread, so that the page can answer while nobody types.
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
    """Tell whether the stream is the null device, as in a benchmark's processes; then only the page gives lines."""
    try:
        return os.path.samestat(os.fstat(stream.fileno()), os.stat(os.devnull))
    except (OSError, ValueError):
        return False


def _opened(
    settings: Settings, submit: Callable[[str | None], None], skills: Mapping[str, Skill]
) -> tuple[PageServer, Path, ExitStack]:
    """Return the page, the file that leads to it, and what closes both."""
    lines, closing = keys(skills), ExitStack()
    controls = Controls(lines, in_words(lines, skills), forms(skills))
    window = PageServer(settings.port, submit, lambda line: parse(line, skills), controls)
    closing.callback(window.close)
    link = closing.enter_context(window.link())
    if settings.browser:
        threading.Timer(_REVISIT, lambda: window.visited or webbrowser.open(link.as_uri())).start()
    return window, link, closing
