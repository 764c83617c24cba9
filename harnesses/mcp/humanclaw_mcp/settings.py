"""The settings of a server."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

from humanclaw import Backends, HumanclawError

_SHORTEST_TOKEN: Final = 16
"""Characters: shorter tokens can be guessed."""
SESSION_HEADER: Final = "mcp-session-id"
SESSIONS: Final = 256
"""Most open sessions. A session needs little memory; bodies have their own limit."""


@dataclass(frozen=True)
class Settings:
    """Settings of bodies and their episodes. Raises HumanclawError for invalid values."""

    scenes: tuple[str, ...] = ("house:0",)
    """Scenes that a client may choose; the first is the default."""
    instruction: str = "Do as you are asked."
    """Task in the record, unless the client gives one."""
    seed: int = 0
    max_steps: int = 100
    profile: Literal["default", "paper"] = "default"
    simulator: str = ""
    """Name of the simulator; empty for the default one."""
    generator: str = Backends.generator
    prior: str = Backends.prior
    sensors: tuple[str, ...] = ()
    """Sensors of an answer besides the view (humanclaw.episodes)."""
    reasoning: bool = False
    """Whether a call must also say what is seen and why, as in the benchmark."""
    verifier: str = ""
    """Name of the verifier that checks each call before the body moves; empty for none."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """Options of the verifier, such as its model."""
    bodies: int = 4
    """Most bodies at one time, one for each session."""
    idle: float = 900.0
    """Seconds without a call after which a body is closed."""
    tell_every: float = 1.0
    """Seconds between two progress messages to a client that asked for them."""
    auth_env: str = ""
    """Environment variable with the token that every HTTP request must carry; empty for none."""
    out: Path | None = None
    """Folder for the records of the episodes; None keeps none."""

    @property
    def token(self) -> str:
        """Token that HTTP requests must carry; empty for none."""
        return os.environ.get(self.auth_env, "").strip() if self.auth_env else ""

    def __post_init__(self) -> None:
        if self.auth_env and len(self.token) < _SHORTEST_TOKEN:
            told = f"{self.auth_env} holds no token of {_SHORTEST_TOKEN} letters or more."
            raise HumanclawError(told, f'For example: export {self.auth_env}="$(openssl rand -hex 32)".')
        if not self.scenes:
            raise HumanclawError("no scene is given.", "Name at least one, such as --scene house:0.")
        if self.bodies < 1 or self.max_steps < 1 or self.idle <= 0:
            raise HumanclawError("bodies, max_steps and idle must be positive.", "Leave them out for the defaults.")
        if self.options and not self.verifier:
            raise HumanclawError("--option belongs to a verifier, and none is named.", "Add --verifier NAME.")
        if not self.instruction.strip():
            raise HumanclawError("the instruction is empty.", "Say what the body is to do.")
