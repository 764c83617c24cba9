"""A hook of a plugin's own: other plugins then register sounds, and Plugins.registered("sounds") lists them."""

import types
from collections.abc import Callable

from humanclaw import hookimpl
from humanclaw.plugins import Register, hookspec


@hookspec
def humanclaw_sounds(register: Register[Callable[[], bytes]]) -> None:
    """Register sounds: factory() -> bytes of a WAV file."""


specs = types.ModuleType("my_hookspecs")
vars(specs)["humanclaw_sounds"] = humanclaw_sounds


@hookimpl
def humanclaw_hookspecs(register: Callable[[types.ModuleType], None]) -> None:
    register(specs)
