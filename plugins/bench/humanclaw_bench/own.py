"""Tasks of one's own: episodes, and a function of an episode's record that decides success (hook humanclaw_splits)."""

from __future__ import annotations

import reprlib
from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches
from inspect import getdoc, iscoroutinefunction, isfunction, signature
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from humanclaw import EpisodeSpec, RecordedEpisode

    Success: TypeAlias = Callable[[RecordedEpisode], bool]


@dataclass(frozen=True)
class Task:
    """A split of one's own. Calling it calls its function. Raises TypeError if that returns neither True nor False."""

    name: str
    description: str
    """When an episode has succeeded."""
    episodes: tuple[EpisodeSpec, ...]
    success: Success

    @property
    def __wrapped__(self) -> Success:
        """The function, for `inspect`: where it is written, and what it takes."""
        return self.success

    def __call__(self, episode: RecordedEpisode) -> bool:
        import numpy as np  # Here: lists of commands load this file.

        try:
            done = self.success(episode)
        except AttributeError as error:
            raise AttributeError(f"{error}{_meant(error)}").with_traceback(error.__traceback__) from None
        if not isinstance(done, bool | np.bool_):  # A distance, say, would count as a success.
            raise TypeError(f"{self.name} returned {done!r}; return True or False")
        return bool(done)


def _meant(error: AttributeError) -> str:
    """Return where what an episode, a record or a step was asked for is held; empty if nothing has such a name."""
    from humanclaw import RecordedEpisode  # Here: lists of commands load this file.

    held = {name: name for name in dir(error.obj) if not name.startswith("_")}
    if isinstance(error.obj, RecordedEpisode):
        record = error.obj.record
        held = {name: f"record.spec.{name}" for name in type(record.spec).model_fields} | held
        held = {name: f"record.{name}" for name in type(record).model_fields} | held
    near = get_close_matches(str(error.name), held, 1)
    return f"; did you mean {held[near[0]]}?" if near else ""


def task(*episodes: EpisodeSpec) -> Callable[[Success], Task]:
    """Make a function decide the success of these episodes. Register the result in the hook humanclaw_splits.

    The function gets the record of a finished episode and returns whether it succeeded. `--split` takes its name; the
    first line of its docstring explains a failure. Raises PluginError for anything but EpisodeSpecs, and for a function
    that has no name (a lambda, a partial), that is async, or that cannot be called with one argument.
    """
    from humanclaw import EpisodeSpec, PluginError  # Here: lists of commands load this file.

    for spec in episodes:
        if not isinstance(spec, EpisodeSpec):
            got = "stands without parentheses" if isfunction(spec) else f"takes EpisodeSpecs; got {reprlib.repr(spec)}"
            remedy = "Write @task(EpisodeSpec(id=..., instruction=..., scene=...)), or @task(*episodes) for a list."
            raise PluginError(f"@task {got}.", remedy)

    def made(success: Success) -> Task:
        name = getattr(success, "__name__", "")
        remedy = f"Write def {name if name.isidentifier() else 'NAME'}(episode: RecordedEpisode) -> bool."
        if not name.isidentifier():
            got = reprlib.repr(success)
            raise PluginError(f"a success function has a name, by which --split finds it; got {got}.", remedy)
        if iscoroutinefunction(success):
            raise PluginError(f"a success function is not awaited; {name} is async.", remedy)
        try:
            signature(success).bind(None)
        except TypeError as error:
            message = f"a success function takes one argument, the episode; {name} does not: {error}."
            raise PluginError(message, remedy) from None
        about, _, _ = (getdoc(success) or "").partition("\n")
        return Task(name, about, tuple(spec.model_copy(update={"success": name}) for spec in episodes), success)

    return made
