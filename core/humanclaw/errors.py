"""Errors, sorted by who can fix them: the user, the model, a plugin's author, or the provider."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Final

from humanclaw.text.words import legible

_LONGEST_REASON: Final = 500
"""Characters of an error that are told: some libraries quote the whole of their input."""
passed_interrupts: Final = ContextVar("passed_interrupts", default=False)
"""Whether the main thread passes Ctrl-C on to this one."""


class HumanclawError(Exception):
    """An error that the user can fix. The command line prints it in one sentence with its remedy and exits with 2."""

    def __init__(self, message: str, remedy: str = "") -> None:
        super().__init__(f"{message} {remedy}".strip())
        self.message = message
        self.remedy = remedy


class PluginError(HumanclawError):
    """A plugin that cannot be used. It affects every episode: raised in one, it ends the run."""


class FactoryError(PluginError):
    """An agent or a verifier that could not be made. Its cause is the factory's error."""


class ContractError(PluginError):
    """A skill that breaks the contract. check: name of the failed check (see `humanclaw check --list`)."""

    def __init__(self, check: str, message: str, remedy: str = "") -> None:
        super().__init__(message, remedy)
        self.check = check


class SceneError(HumanclawError):
    """A scene that is unknown, malformed, or differs from its digest."""


class TaskError(HumanclawError):
    """A seed for which no task fits: in other houses, or of another kind, there may be one."""


class CheckpointError(HumanclawError):
    """A checkpoint that is missing, corrupt, of another format, or trained against another base."""


class RecordError(HumanclawError):
    """A record that cannot be written or read."""


class ReplayError(RecordError):
    """A record that cannot be continued: its steps now lead elsewhere than recorded."""


class CallError(Exception):
    """A call that the model should correct. The text goes back to it; nothing was executed."""


class LimitError(Exception):
    """A limit on time, tokens or money was reached. The episode ends as limit_reached.

    scope: 'call', 'episode' or 'run'. After a run's limit no further episode may begin.
    """

    def __init__(self, scope: str, message: str) -> None:
        super().__init__(message)
        self.scope = scope


class PluginRunError(Exception):
    """A plugin's code raised an exception in an episode. It ends as plugin_error, a counted failure with the plugin's
    name."""


class ProviderError(Exception):
    """The model's provider failed after all retries. The episode ends as infra_error; it never becomes a decision."""


class ProviderClosedError(PluginError, ProviderError):
    """The provider serves no further request of the run: no money, a revoked key, a removed model.

    The episode ends as infra_error, to be played again, and the run ends.
    """


ANSWERING: Final = (PluginError, ProviderError, LimitError)
"""Errors that agents and verifiers may raise without being at fault: they depend on a provider."""


@contextmanager
def blaming(plugin: str, *passing: type[BaseException]) -> Iterator[None]:
    """Turn exceptions of the block into PluginRunError with the name of the plugin whose code it runs.

    The caller names the plugin: the exception could name anyone. passing: kinds that pass unchanged. A person's
    KeyboardInterrupt passes too.
    """
    try:
        yield
    except passing:
        raise
    except BaseException as fault:  # Third-party code must not end the program, not even by SystemExit.
        if by_hand(fault):
            raise
        raise PluginRunError(f"{plugin} raised {in_words(fault)}") from fault


def by_hand(fault: BaseException) -> bool:
    """Tell whether a person interrupted: KeyboardInterrupt with a signal handler installed, in the main thread or one
    that is passed its interrupts.

    Workers of a run ignore signals, so there a plugin has raised it.
    """
    heard = any(callable(signal.getsignal(number)) for number in (signal.SIGINT, signal.SIGTERM))
    here = threading.current_thread() is threading.main_thread() or passed_interrupts.get()
    return isinstance(fault, KeyboardInterrupt) and heard and here


def in_words(error: BaseException) -> str:
    """Return type and message of an exception on one line. Even str() of a third-party exception may raise."""
    try:
        return legible(f"{type(error).__name__}: {' '.join(str(error).split())}"[:_LONGEST_REASON])
    except BaseException as another:
        if by_hand(another):
            raise
        return type(error).__name__
