"""What can go wrong, sorted by who can mend it: the person at the keyboard, the model that decides, or the provider."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from humanclaw.text.words import legible

_LONGEST_REASON: Final = 500


class HumanclawError(Exception):
    """Something the user can mend. The command line prints it in one sentence with its remedy and exits with 2."""

    def __init__(self, message: str, remedy: str = "") -> None:
        super().__init__(f"{message} {remedy}".strip())
        self.message = message
        self.remedy = remedy


class PluginError(HumanclawError):
    """A plugin that cannot be used, and why. It stands in the way of every episode: raised in one, it ends the run."""


class FactoryError(PluginError):
    """An agent or a verifier that could not be made; its cause is what the factory raised."""


class ContractError(PluginError):
    """A skill that breaks the contract. check: the name of the check that it fails, as `humanclaw check --list` has
    it."""

    def __init__(self, check: str, message: str, remedy: str = "") -> None:
        super().__init__(message, remedy)
        self.check = check


class SceneError(HumanclawError):
    """A scene that is unknown, malformed or not what its digest says."""


class CheckpointError(HumanclawError):
    """A checkpoint that is missing, corrupt, of another format, or trained against another base."""


class RecordError(HumanclawError):
    """A record that cannot be written or read."""


class ReplayError(RecordError):
    """A record that cannot be continued: the world no longer does what it did when the record was made."""


class CallError(Exception):
    """A call that the model should mend. The text is handed back to it; nothing was executed."""


class LimitError(Exception):
    """A limit on time, tokens or money was reached. The episode ends as limit_reached: no decision, no fault of
    anybody's.

    scope: 'call', 'episode' or 'run'; after a run's limit no further episode may begin.
    """

    def __init__(self, scope: str, message: str) -> None:
        super().__init__(message)
        self.scope = scope


class PluginRunError(Exception):
    """A plugin's code raised something in an episode. It ends as plugin_error: a failure, counted, with the plugin's
    name."""


class ProviderError(Exception):
    """The model's provider failed for good, after all retries. The episode ends as infra_error; it is never a
    decision."""


ANSWERING: Final = (PluginError, ProviderError, LimitError)
"""What agents and verifiers raise that is no error of theirs: they are asked, and may have to ask a provider."""


@contextmanager
def blaming(plugin: str, *passing: type[BaseException]) -> Iterator[None]:
    """Name the plugin whose code runs in the block in what it raises. Who it is says the caller: what it raises may
    name anybody.

    passing: kinds that go on as they are. So does KeyboardInterrupt where it can be a person's.
    """
    try:
        yield
    except passing:
        raise
    except BaseException as fault:  # Code of somebody else does not end the program.
        if by_hand(fault):
            raise
        raise PluginRunError(f"{plugin} raised {in_words(fault)}") from fault


def by_hand(fault: BaseException) -> bool:
    """Tell whether a person may have ended something: KeyboardInterrupt in the main thread, where a signal raises it.

    A worker of a run hears no signal, so that there a plugin has raised it.
    """
    heard = any(callable(signal.getsignal(number)) for number in (signal.SIGINT, signal.SIGTERM))
    return isinstance(fault, KeyboardInterrupt) and heard and threading.current_thread() is threading.main_thread()


def in_words(error: BaseException) -> str:
    """Return the kind of an error and its words, on one line; an error of somebody else may fail even at saying
    them."""
    try:
        return legible(f"{type(error).__name__}: {' '.join(str(error).split())}"[:_LONGEST_REASON])
    except BaseException as another:
        if by_hand(another):
            raise
        return type(error).__name__
