"""What can go wrong, sorted by who can mend it: the person at the keyboard, the model that decides, or the provider."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from humanclaw._words import legible

_LONGEST_REASON: Final = 500


class HumanclawError(Exception):
    """Something the user can mend. The command line prints it in one sentence with its remedy and exits with 2."""

    def __init__(self, message: str, remedy: str = "") -> None:
        super().__init__(f"{message} {remedy}".strip())
        self.message = message
        self.remedy = remedy


class PluginError(HumanclawError):
    """A plugin that cannot be used, and why. It stands in the way of every episode: raised in one, it ends the run."""


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


@contextmanager
def blaming(plugin: str) -> Iterator[None]:
    """Name the plugin whose code runs in the block in what it raises.

    Five kinds go on as they are: a limit, a provider that failed, a record for which there is no room, a plugin that
    cannot be used at all, and KeyboardInterrupt, which is a person's.
    """
    try:
        yield
    except (PluginError, RecordError, LimitError, ProviderError, PluginRunError, KeyboardInterrupt):
        raise
    except BaseException as fault:  # Code of somebody else does not end the program.
        raise PluginRunError(f"{plugin} raised {in_words(fault)}") from fault


def in_words(error: BaseException) -> str:
    """Return the kind of an error and its words, on one line; an error of somebody else may fail even at saying
    them."""
    try:
        return legible(f"{type(error).__name__}: {' '.join(str(error).split())}"[:_LONGEST_REASON])
    except KeyboardInterrupt:
        raise
    except BaseException:
        return type(error).__name__
