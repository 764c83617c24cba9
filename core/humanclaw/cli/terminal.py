"""The way of text to the terminal. Names in a record or a scene may be a stranger's, so none may control it."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import TextIOWrapper
from typing import IO, Any, Final, TextIO

import rich.console
from rich.segment import Segment

from humanclaw.text.words import escaped

_INSIDE: Final = re.compile(r"(?<!\A)\r(?!\n)")
"""A return that would overwrite the words before it. Progress bars begin with one."""
_RESET: Final = "\x1b[0m"
"""The end of all colours, which colorama writes when the process ends."""


class Console(rich.console.Console):
    """Rich's console. Texts lose what controls a terminal; its own colours and movements stay."""

    @property
    def file(self) -> IO[str]:
        """The stream below Escaping. While a status moves, a proxy of Rich lies over it, and Rich looks below that
        one alone."""
        file = super().file
        return getattr(file, "rich_proxied_file", file)

    @file.setter
    def file(self, new_file: IO[str]) -> None:
        self._file = new_file

    def on_broken_pipe(self) -> None:
        """Print no more once nobody reads on, as after `| head`. The record is written to its end; Rich would exit."""
        self.quiet = True
        with open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), sys.stdout.fileno())

    def render(
        self, renderable: rich.console.RenderableType, options: rich.console.ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=escaped(segment.text))


class Escaping:
    """A text stream that escapes what controls a terminal. Rich writes past it, with the escape codes of its own."""

    encoding: Final = "utf-8"  # The stream below escapes what it cannot encode, but click goes around one in ASCII.

    def __init__(self, stream: TextIO) -> None:
        self.rich_proxied_file = stream

    def write(self, text: str) -> int:
        """Write a text as `\\u001b` writes its controls: JSON stays the same JSON."""
        self.rich_proxied_file.write(text if text == _RESET else _INSIDE.sub(r"\\u000d", escaped(text)))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.rich_proxied_file, name)


@contextmanager
def guarded() -> Iterator[None]:
    """Escape what the block prints. Characters that the output cannot encode, as in a pipe on Windows, are escaped
    too."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    with redirect_stdout(Escaping(sys.stdout)), redirect_stderr(Escaping(sys.stderr)):
        yield
