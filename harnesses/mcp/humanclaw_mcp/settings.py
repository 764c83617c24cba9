"""What a server is started with."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from humanclaw import Backends, HumanclawError

_SHORTEST_TOKEN: Final = 16
"""Letters: shorter ones can be guessed."""
SESSION_HEADER: Final = "mcp-session-id"
SESSIONS: Final = 256
"""Open sessions at most. A session costs little; bodies have a limit of their own."""


@dataclass(frozen=True)
class Settings:
    """How bodies are made, and how many. Raises HumanclawError for values that cannot work."""

    scenes: tuple[str, ...] = ("house:0",)
    """The scenes that a client may choose from; the first is the default."""
    instruction: str = "Do as you are asked."
    """What episodes are recorded as, unless the client says what it is after."""
    seed: int = 0
    max_steps: int = 100
    profile: Literal["default", "paper"] = "default"
    simulator: str = ""
    """By name; empty: the one that bodies run in by default."""
    generator: str = Backends.generator
    sensors: tuple[str, ...] = ()
    """What a call's answer tells besides the view (humanclaw.sensors)."""
    reasoning: bool = False
    """Whether a call must also say what is seen and why, as in the benchmark."""
    bodies: int = 4
    """Bodies at most at one time, one a session."""
    idle: float = 900.0
    """Seconds after which a body that nobody calls is put away."""
    tell_every: float = 1.0
    """Seconds between two messages to a client that asked to be told of a call's progress."""
    auth_env: str = ""
    """Environment variable of the token that every request over HTTP must bear; empty asks for none."""
    out: Path | None = None
    """Folder for the records of the episodes; None keeps none."""

    @property
    def token(self) -> str:
        """What requests over HTTP must bear; empty for nothing."""
        return os.environ.get(self.auth_env, "").strip() if self.auth_env else ""

    def __post_init__(self) -> None:
        if self.auth_env and len(self.token) < _SHORTEST_TOKEN:
            told = f"{self.auth_env} holds no token of {_SHORTEST_TOKEN} letters or more."
            raise HumanclawError(told, f'For example: export {self.auth_env}="$(openssl rand -hex 32)".')
        if not self.scenes:
            raise HumanclawError("there is no scene to offer.", "Name at least one, such as --scene house:0.")
        if self.bodies < 1 or self.max_steps < 1 or self.idle <= 0:
            raise HumanclawError("bodies, max_steps and idle must be positive.", "Leave them out for the defaults.")
        if not self.instruction.strip():
            raise HumanclawError("the instruction is empty.", "Say what the body is to do.")
