"""The agent: it shows the view on a page and takes the calls that the person makes there."""

from __future__ import annotations

import queue
import threading
import weakref
import webbrowser
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Final

import click
from pydantic import BaseModel, ConfigDict, Field

from humanclaw import Decision, EpisodeContext, HistoryEntry, Observation, Skill
from humanclaw.cli import Handler, Server
from humanclaw.records import REPORT
from humanclaw_human.commands import forms, keys, read
from humanclaw_human.window import Controls, PageServer, PageState

_REVISIT: Final = 1.0
"""Seconds for the last episode's page to reconnect to the same port, before a new page opens."""
_POLL: Final = 0.2
"""Seconds between two looks for a call. Some systems ignore Ctrl-C during a wait without a timeout."""


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
    """Takes decisions from the page, which shows what a model gets.

    `at_terminal` keeps facts of the scene off the terminal, which the person sees too.
    """

    name = "human"
    privileged = False
    at_terminal = True

    def __init__(self, settings: Settings) -> None:
        self.settings = settings.model_dump()
        self._settings = settings
        self._decisions: queue.Queue[Decision | None] = queue.Queue()
        self._window: PageServer | None = None

    def ready(self, instruction: str) -> None:
        """Raise HumanclawError if the page's port is taken: better now than once the body is made."""
        Server(Handler, self._settings.port).server_close()

    def begin(self, context: EpisodeContext) -> None:
        self._most = context.spec.max_steps
        if self._window is None:
            self._window, self._link, closing = _opened(self._settings, self._decisions.put, context.skills)
            # One page serves all episodes of a run, so it closes with the agent.
            weakref.finalize(self, closing.close)
        click.echo(f"{context.spec.instruction}\nOpen the view: {self._link}")

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        """Show the view and wait for a call. Raises KeyboardInterrupt if the person leaves."""
        assert self._window is not None
        past = tuple((str(entry.executed or "no call"), str(entry.feedback)) for entry in history)
        words = (observation.instruction, str(observation.feedback), past)
        self._window.show(observation.rgb, PageState(observation.step, self._most, *words, observation.between))
        while True:
            with suppress(queue.Empty):
                decision = self._decisions.get(timeout=_POLL)
                if decision is None:
                    raise KeyboardInterrupt
                return decision

    def show_result(self, result: str, run: Path) -> None:
        """End the page with the result, and with the run's page once a reporter has written it."""
        if self._window:
            self._window.end(result, run / REPORT)


def _opened(
    settings: Settings, submit: Callable[[Decision | None], None], skills: Mapping[str, Skill]
) -> tuple[PageServer, Path, ExitStack]:
    """Return the page, the file that leads to it, and what closes both."""
    closing = ExitStack()
    controls = Controls(keys(skills), forms(skills))
    window = PageServer(settings.port, submit, lambda sent: read(sent, skills), controls)
    closing.callback(window.close)
    link = closing.enter_context(window.link())
    if settings.browser:
        threading.Timer(_REVISIT, lambda: window.visited or webbrowser.open(link.as_uri())).start()
    return window, link, closing
