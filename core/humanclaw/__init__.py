"""HumanCLAW: a human body for any tool-calling model.

The names below are the public door. They load on first use, so that `import humanclaw` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from humanclaw.contract import Check, Control, Keyframes, Skill, skill
    from humanclaw.embodiment import Body
    from humanclaw.episode import Episode
    from humanclaw.errors import HumanclawError
    from humanclaw.hookspecs import hookimpl
    from humanclaw.interfaces import Observation
    from humanclaw.plugins import Plugins
    from humanclaw.pose import Motion
    from humanclaw.records import Call

__version__ = "0.1.0"

_HOMES = {
    "Body": "embodiment",
    "Call": "records",
    "Check": "contract",
    "Control": "contract",
    "Episode": "episode",
    "HumanclawError": "errors",
    "Keyframes": "contract",
    "Motion": "pose",
    "Observation": "interfaces",
    "Plugins": "plugins",
    "Skill": "contract",
    "hookimpl": "hookspecs",
    "skill": "contract",
}
__all__ = [
    "Body", "Call", "Check", "Control", "Episode", "HumanclawError", "Keyframes", "Motion", "Observation", "Plugins", "Skill",
    "hookimpl", "skill",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'humanclaw' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"humanclaw.{_HOMES[name]}"), name)
    globals()[name] = value
    return value
