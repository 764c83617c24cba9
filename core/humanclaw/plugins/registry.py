"""Collect what a plugin registers, and keep the items that can be used."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from humanclaw.errors import PluginError
from humanclaw.plugins.choice import Choice, Registration
from humanclaw.plugins.hookspecs import noun
from humanclaw.plugins.loading import reason_of
from humanclaw.skills.checks import skill_faults
from humanclaw.skills.contract import Skill
from humanclaw.skills.measures import Measure

_NAME: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_. -]{0,63}")


@dataclass
class Registry:
    """What one plugin registers, collected apart, so that a plugin that fails half-way leaves nothing behind."""

    owner: str
    found: dict[str, list[Registration]] = field(default_factory=dict)
    """By kind: the name of the hook without `humanclaw_`."""
    disabled: dict[str, str] = field(default_factory=dict)
    """Skills that break the contract, by name, with the reason."""
    faulty: list[Registration] = field(default_factory=list)
    """The same skills as they were registered."""
    left_out: list[Registration] = field(default_factory=list)
    """Items that the choice leaves out."""
    notes: tuple[str, ...] = ()

    def register(self, kind: str) -> Callable[..., None]:
        """Return the argument `register` of a hook. It takes name, value and description, or one value that has a name
        and a description itself."""

        def register(named: Any, value: Any = None, description: str = "") -> None:
            if value is None:
                value = self._skill(named) if kind == "skills" else named
                if value is None:
                    return
                named, description = value.name, value.description
            if not isinstance(named, str) or not _NAME.fullmatch(named):
                raise PluginError(
                    f"{named!r} is not a valid name for a {noun(kind)}.", f"Use a name that matches {_NAME.pattern}."
                )
            self.found.setdefault(kind, []).append(Registration(named, self.owner, value, description))

        return register

    def _skill(self, given: Skill | Path) -> Skill | None:
        """Return the skill, or None for a folder that cannot be read: the plugin's other skills stay in use."""
        try:
            return _skill(given)
        except Exception as error:
            if not isinstance(given, Path):
                raise
            self._disable(given.name, given, str(error) if isinstance(error, PluginError) else reason_of(error))
            return None

    def _disable(self, name: str, value: Skill | Path, reason: str) -> None:
        self.disabled[name] = reason
        self.faulty.append(Registration(name, self.owner, value))

    def disable_faulty_skills(self, measures: Mapping[str, Measure], priors: Mapping[str, Path]) -> None:
        """Check each skill against the contract, and take out those that break it."""
        kept = []
        for one in self.found.get("skills", []):
            if faults := skill_faults(one.value, measures, priors):
                self._disable(one.name, one.value, " ".join(map(str, faults)))
            else:
                kept.append(one)
        self.found["skills"] = kept

    def keep(self, choice: Choice) -> None:
        """Leave out items that the choice excludes, and names that the plugin registers twice."""
        for kind, found in self.found.items():
            wanted = [one for one in found if not choice.drops(one, kind)]
            self.left_out += [one for one in found if choice.drops(one, kind)]
            self.found[kind] = list({one.name: one for one in reversed(wanted)}.values())[::-1]


def _skill(given: Skill | Path) -> Skill:
    skill = Skill.from_folder(given) if isinstance(given, Path) else given
    if not isinstance(skill, Skill):
        raise PluginError(
            f"register() takes a Skill or a folder; got {type(skill).__name__}.", "Decorate it with @skill."
        )
    return skill
