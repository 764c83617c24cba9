"""Which adapter of a skill a body plays, if it has one for the body's prior."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from humanclaw.motion.checkpoint import adapters_beside
from humanclaw.plugins.host import Plugins
from humanclaw.skills.contract import Skill


class Adapters:
    """The adapters of the skills of some plugins, by prior."""

    def __init__(self, plugins: Plugins) -> None:
        self._plugins = plugins
        self._beside: dict[Path, Mapping[str, Path]] = {}

    def fits(self, skill: Skill, base: str) -> bool:
        """Whether a skill can be played with a prior: it needs no adapter, is not trained yet, or has one for it."""
        # First what needs no file: every step asks for every skill.
        if len(self._plugins.registered("priors")) < 2 or skill.adapter is None or not skill.trained:
            return True
        if base not in self._plugins.priors:
            return True
        return base in self._by_base(skill.adapter)

    def of(self, adapter: Path, base: str) -> Path:
        """Return the adapter beside this one that was trained for a prior, or this one."""
        return self._by_base(adapter).get(base, adapter)

    def owner(self, skill: Skill, adapter: Path) -> Skill | None:
        """Return the skill that owns an adapter, such as the called one; None if that skill is not installed."""
        return next((other for other in (skill, *self._plugins.skills.values()) if other.adapter == adapter), None)

    def _by_base(self, adapter: Path) -> Mapping[str, Path]:
        if adapter not in self._beside:
            self._beside[adapter] = adapters_beside(adapter)
        return self._beside[adapter]
