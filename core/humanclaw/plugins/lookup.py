"""Look up what plugins registered, by name, and call its factory."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from humanclaw.errors import ANSWERING, FactoryError, HumanclawError, PluginError, RecordError, by_hand
from humanclaw.motion.checkpoint import read_header, shipped_base
from humanclaw.plugins import distributions
from humanclaw.plugins.choice import Choice, PluginInfo, Registration, means
from humanclaw.plugins.deciders import Unmade
from humanclaw.plugins.hookspecs import noun
from humanclaw.plugins.loading import reason_of
from humanclaw.skills.contract import Skill
from humanclaw.skills.measures import Measure
from humanclaw.text.words import did_you_mean, nearest

_DECIDERS: Final = ("agents", "verifiers")


def by_digest(priors: Iterable[Registration]) -> dict[str, Path]:
    """Return the checkpoints of registered priors by digest. Raises CheckpointError for one that cannot be read."""
    return {str(read_header(one.value)["digest"]): one.value for one in priors}


class Lookup:
    """All that plugins registered, by kind and name. A kind is the name of the hook without `humanclaw_`."""

    def __init__(self, choice: Choice) -> None:
        self.choice = choice
        self._infos: list[PluginInfo] = []
        self._offered: dict[str, list[Registration]] = {}
        """All that can be used, by kind, in the order in which it was registered."""
        self._faulty: list[Registration] = []
        self._left_out: list[Registration] = []
        self._found: dict[str, dict[str, Registration]] = {}
        """The item that a name without an owner stands for, by kind."""

    def registered(self, kind: str) -> tuple[Registration, ...]:
        """All that is registered through the hook `humanclaw_<kind>`; none if no plugin specifies such a hook."""
        return tuple(self._found.get(kind, {}).values())

    def offered(self, kind: str, name: str) -> Any:
        """Return the item of a name, also a disabled skill. Raises PluginError with the nearest names if there is
        none."""
        if kind == "skills" and name not in self._found[kind]:
            for one in self._faulty:
                if name == one.name or means(name, one):
                    return one.value
        return self._find(kind, name).value

    def make(self, kind: str, name: str, *args: Any, **options: Any) -> Any:
        """Call the factory registered under a name.

        Raises PluginError if there is no such name (with the nearest ones), if the factory needs a package that is not
        installed, and if the factory of an agent or a verifier fails with an error that a user cannot mend.
        """
        found = self._find(kind, name)
        if not callable(found.value):
            came = type(found.value).__name__
            told = f"{noun(kind)} {name!r} of plugin {found.owner!r} is of type {came}; expected a factory."
            raise PluginError(told, "Register a function that makes one.")
        try:
            return found.value(*args, **options)
        except ModuleNotFoundError as error:
            needed = f"{noun(kind)} {name!r} of plugin {found.owner!r} needs {error.name!r}, which is not installed."
            raise PluginError(needed, f"Run `pip install {error.name}`.") from error
        except BaseException as error:
            if not _gives_up(kind, error):
                raise
            told = f"{noun(kind)} {name!r} of plugin {found.owner!r} gave up: {reason_of(error)}."
            raise FactoryError(told) from error

    def decider(self, kind: str, name: str, options: Mapping[str, Any], known_as: str = "") -> Any:
        """Make an agent or a verifier for an episode of an unattended run.

        If its factory raises, return a stand-in with the name known_as; its episode ends as plugin_error when it
        begins. Raises PluginError, ProviderError and LimitError, as agents and verifiers may.
        """
        try:
            return self.make(kind, name, options)
        except FactoryError as error:
            return Unmade(known_as or name, self._find(kind, name).owner, error.__cause__ or error)

    def scene(self, reference: str) -> Any:
        """Make the scene that `source:argument` or `owner:source:argument` refers to."""
        source, _, argument = reference.partition(":")
        longer, _, rest = argument.partition(":")
        if source not in self._found["scenes"] and self._get("scenes", f"{source}:{longer}"):
            source, argument = f"{source}:{longer}", rest
        return self.make("scenes", source, argument)

    def require(self, *wanted: tuple[str, str]) -> None:
        """Raise PluginError if a (kind, name) is not installed, with the one line that installs all that are
        missing."""
        missing = [(kind, name) for kind, name in wanted if self._get(kind, name) is None]
        bringing = [distributions.bringing(kind, name) for kind, name in missing]
        if len(missing) > 1 and all(bringing):
            told = [f"{noun(kind)} {name!r}" for kind, name in missing]
            listed = f"{', '.join(told[:-1])} and {told[-1]}"
            raise PluginError(f"{listed} are not installed.", f"Run `{distributions.install(bringing)}`.")
        for kind, name in missing:
            self._find(kind, name)

    @property
    def priors(self) -> dict[str, Path]:
        """The checkpoints of the installed priors, by digest; the shipped one where no plugin registers any."""
        return by_digest(self.registered("priors")) or {str(read_header(shipped_base())["digest"]): shipped_base()}

    @property
    def skills(self) -> dict[str, Skill]:
        """The skills that can be called, by name: all, or those that the choice names."""
        if not self.choice.skills:
            return {name: one.value for name, one in self._found["skills"].items()}
        return {self._find("skills", name).name: self.skill(name) for name in self.choice.skills}

    def skill(self, name: str) -> Skill:
        """Return the skill of a name, or of owner:name. Raises PluginError with the nearest names if there is none."""
        return self._find("skills", name).value  # type: ignore[no-any-return]

    def owner(self, name: str, kind: str = "skills") -> str:
        """Return the plugin that brings a skill, or an item of another kind."""
        return self._find(kind, name).owner

    def overridden(self, skill: str) -> tuple[str, ...]:
        """Return the other plugins that have a skill of this name."""
        first = self._find("skills", skill)
        return tuple(one.owner for one in self._offered["skills"] if one.name == first.name and one is not first)

    def names_of(self, owner: str, kind: str) -> tuple[str, ...]:
        """Return the names of a plugin's items of a kind, in the order in which it registered them."""
        return tuple(one.name for one in self.of_owner(owner, kind))

    def of_owner(self, owner: str, kind: str) -> tuple[Registration, ...]:
        """Return a plugin's items of a kind, in the order in which it registered them."""
        return tuple(one for one in self._offered.get(kind, ()) if one.owner == owner)

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of items that plugins can register."""
        return tuple(self._found)

    @property
    def measures(self) -> dict[str, Measure]:
        """Every measure that a parameter can command, by name."""
        return {name: one.value for name, one in self._found["measures"].items()}

    @property
    def disabled(self) -> dict[str, str]:
        """Skills that are not in use, by name, with the reason."""
        found = [item for info in self._infos for item in info.disabled.items()]
        return {name: reason for name, reason in found if name not in self.skills}

    @property
    def infos(self) -> tuple[PluginInfo, ...]:
        """Every plugin that was found, with its items in use."""
        return tuple(self._told(info) for info in self._infos)

    def info(self, owner: str) -> PluginInfo:
        """Return the entry of a plugin."""
        return next(info for info in self.infos if info.name == owner)

    def _take(self, kind: str, found: Sequence[Registration]) -> None:
        """Add a plugin's registrations. Among equal names the preferred item wins, then a first-party one, then the
        earliest."""
        self._offered[kind] += found
        for one in found:
            same = [other for other in self._offered[kind] if other.name == one.name]
            self._found[kind][one.name] = min(same, key=self._place)

    def _place(self, one: Registration) -> tuple[int, bool]:
        return self.choice.rank(one), one.owner.partition("/")[0] not in distributions.own()

    def _check_choice(self) -> None:
        """Raise PluginError if the choice names something that is not installed: it may be misspelt."""
        told = [(one.owner, one.name) for found in self._offered.values() for one in found]
        told += [(one.owner, one.name) for one in (*self._faulty, *self._left_out)] + [
            (info.name, "") for info in self._infos
        ]
        for option, texts in (("prefer", self.choice.prefer), ("without", self.choice.without)):
            for text in texts:
                if any(means(text, Registration(name, of, None)) for of, name in told):
                    continue
                if option == "without" and any(text == name for _, name in told):
                    continue
                raise PluginError(
                    f"--{option} {text} names nothing that is installed.",
                    f"See `humanclaw plugins`. {did_you_mean(text, {owner for owner, _ in told})}".rstrip(),
                )
        for name in self.choice.skills:
            self.skill(name)

    def _told(self, info: PluginInfo) -> PluginInfo:
        mine = [(k, one) for k, found in self._offered.items() for one in found if one.owner == info.name]
        provides = tuple(f"{noun(kind)} {one.name}" for kind, one in mine if self._found[kind][one.name] is one)
        second = tuple(self._gives_way(kind, one) for kind, one in mine if self._found[kind][one.name] is not one)
        return replace(info, provides=provides, duplicates=second)

    def _gives_way(self, kind: str, one: Registration) -> str:
        first = self._found[kind][one.name].owner
        told = f"{noun(kind)} {one.name!r} of plugin {one.owner!r} is already registered by {first!r}."
        return f"{told} Choose it with --prefer {one.owner}:{one.name}, or call it {one.owner}:{one.name}."

    def _get(self, kind: str, name: str) -> Registration | None:
        """Return the item of name or owner:name; None if there is none."""
        if name in self._found.get(kind, {}):
            return self._found[kind][name]
        return next((one for one in self._offered.get(kind, ()) if ":" in name and means(name, one)), None)

    def _find(self, kind: str, name: str) -> Registration:
        if one := self._get(kind, name):
            return one
        if kind == "skills" and name in self.disabled:
            raise PluginError(f"skill {name!r} is disabled: {self.disabled[name]}")
        disabled = [f"{info.name} ({info.error})" for info in self._infos if info.error]
        lost = f" Plugins that are disabled: {'; '.join(disabled)}." if disabled else ""
        raise PluginError(f"there is no {noun(kind)} {name!r}.", self._remedy(kind, name) + lost)

    def _remedy(self, kind: str, name: str) -> str:
        """Return the command that installs the likely package of a name, or else the known names."""
        known, elsewhere = self._found.get(kind, {}), distributions.table().get(kind, {})
        distribution = elsewhere.get(name)
        if distribution and distribution not in (info.origin for info in self._infos):
            return f"Run `{distributions.install([distribution])}`."
        more = [f"{one} (of {of})" for one, of in elsewhere.items() if one not in (*known, name)]
        listed = f"Known: {', '.join([*known, *more]) or 'none'}."
        if distribution:
            return f"{distribution} brings it, but a package that it needs is not installed. {listed}"
        return nearest(name, {**elsewhere, **dict.fromkeys(known, "")}) or listed


def _gives_up(kind: str, error: BaseException) -> bool:
    """Tell whether a factory failed with an error that only its plugin can mend.

    Agents and verifiers may report that a model cannot be had. Errors of other kinds of factories may be the machine's.
    """
    if kind in _DECIDERS:
        mendable = isinstance(error, HumanclawError) and not isinstance(error, RecordError)
        return not (mendable or isinstance(error, ANSWERING) or by_hand(error))
    return isinstance(error, SystemExit | GeneratorExit)
