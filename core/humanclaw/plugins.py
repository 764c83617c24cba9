"""The plugin host: finds plugins, keeps broken ones apart, and answers by name.

A plugin is a module with @hookimpl functions, found through the entry-point group `humanclaw` or loaded from one file.
Each is loaded in its own try: one that cannot be used is named and disabled, and only a run that needs it fails. A
plugin can extend the host with hooks of its own (hook humanclaw_hookspecs).
"""

from __future__ import annotations

import difflib
import importlib.metadata
import importlib.util
import inspect
import logging
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, Final, TypeVar

import pluggy
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import humanclaw
from humanclaw import _distributions as distributions
from humanclaw import hookspecs
from humanclaw._skill_check import skill_faults
from humanclaw.contract import Skill
from humanclaw.errors import PluginError
from humanclaw.hookspecs import noun
from humanclaw.measures import MEASURES, Measure
from humanclaw.motion.checkpoint import read_header, shipped_base

T = TypeVar("T")
PREFIX: Final = "humanclaw_"
_LOG: Final = logging.getLogger(__name__)
_LONGEST_REASON: Final = 500
_NAME: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_. -]{0,63}")
EXTENSION: Final = "humanclaw_hookspecs"
FIRST: Final = (EXTENSION, "humanclaw_measures")
"""Hooks whose plugins come before those that need what they bring."""


@dataclass(frozen=True)
class PluginInfo:
    """A plugin as `humanclaw plugins` lists it."""

    name: str
    version: str
    origin: str
    """The distribution or file it came from."""
    provides: tuple[str, ...] = ()
    error: str = ""
    """Why it is disabled; empty if it is in use."""
    disabled: Mapping[str, str] = field(default_factory=dict)
    """Of its skills those that break the contract or that another plugin has, by name, and why. The others are in
    use."""
    duplicates: tuple[str, ...] = ()
    """Of what else it registers those that another plugin has, each told with both owners."""


@dataclass(frozen=True)
class Registration:
    """Something registered under a name: a skill, a factory, or what else a hook takes."""

    name: str
    owner: str
    value: Any
    description: str = ""


@dataclass
class Registry:
    """What one plugin registers, gathered apart so that a plugin that fails half-way leaves nothing behind."""

    owner: str
    found: dict[str, list[Registration]] = field(default_factory=dict)
    """By kind: the name of the hook without `humanclaw_`."""
    disabled: dict[str, str] = field(default_factory=dict)
    """Skills that break the contract or that another plugin has, by name, and why."""
    duplicates: list[str] = field(default_factory=list)
    """What else another plugin has, each told with both owners."""

    def register(self, kind: str) -> Callable[..., None]:
        """Return the argument `register` of a hook. It takes a name, a value and a description, or a value that has
        them itself."""

        def register(named: Any, value: Any = None, description: str = "") -> None:
            if value is None:
                value = self._skill(named) if kind == "skills" else named
                if value is None:
                    return
                named, description = value.name, value.description
            if not isinstance(named, str) or not _NAME.fullmatch(named):
                raise PluginError(
                    f"{named!r} is no name of a {noun(kind)}.", f"Use a name that matches {_NAME.pattern}."
                )
            self.found.setdefault(kind, []).append(Registration(named, self.owner, value, description))

        return register

    def _skill(self, given: Skill | Path) -> Skill | None:
        """Return the skill, or None for a folder that holds none: its neighbours are not to blame."""
        try:
            return _skill(given)
        except Exception as error:
            if not isinstance(given, Path):
                raise
            self.disabled[given.name] = str(error) if isinstance(error, PluginError) else _reason(error)
            return None

    def disable_faulty_skills(self, measures: Mapping[str, Measure], base: str) -> None:
        """Hold each skill to the contract, and take out those that break it."""
        kept = []
        for one in self.found.get("skills", []):
            if faults := skill_faults(one.value, measures, base):
                self.disabled[one.name] = " ".join(map(str, faults))
            else:
                kept.append(one)
        self.found["skills"] = kept

    def drop_duplicates(self, kind: str, taken: Mapping[str, Registration]) -> None:
        """Leave a name to whoever registered it first, and say who both are."""
        kept: dict[str, Registration] = {}
        for one in self.found.get(kind, []):
            if first := taken.get(one.name) or kept.get(one.name):
                self._tell_duplicate(kind, one, first)
            else:
                kept[one.name] = one
        self.found[kind] = list(kept.values())

    def _tell_duplicate(self, kind: str, one: Registration, first: Registration) -> None:
        told = f"{noun(kind)} {one.name!r} of plugin {self.owner!r} is already registered by {first.owner!r}."
        reason = f"{told} Uninstall one of the two or rename it."
        if kind == "skills":
            self.disabled[one.name] = reason
        else:
            self.duplicates.append(reason)

    @property
    def provides(self) -> tuple[str, ...]:
        """Such as "skill walk" and "motion generator dit"."""
        return tuple(f"{noun(kind)} {one.name}" for kind, found in self.found.items() for one in found)


def _skill(given: Skill | Path) -> Skill:
    skill = Skill.from_folder(given) if isinstance(given, Path) else given
    if not isinstance(skill, Skill):
        raise PluginError(
            f"register() takes a Skill or a folder; got {type(skill).__name__}.", "Decorate it with @skill."
        )
    return skill


class Plugins:
    """All that is installed, by name. An object, not a global: two of them never influence each other."""

    def __init__(self) -> None:
        self._manager = pluggy.PluginManager(hookspecs.PROJECT)
        self._infos: list[PluginInfo] = []
        self._found: dict[str, dict[str, Registration]] = {}
        self._extend(hookspecs)
        self._found["measures"] = {
            name: Registration(name, hookspecs.PROJECT, one, one.description) for name, one in MEASURES.items()
        }
        self._base: str = read_header(shipped_base())["digest"]

    @classmethod
    def discover(cls, files: Sequence[Path] = ()) -> Plugins:
        """Every installed plugin, and then the given files. A file that cannot be used raises, since it was asked for
        by name."""
        host = cls()
        points = importlib.metadata.entry_points(group=hookspecs.PROJECT)
        loaded = [(point, host._load(point)) for point in sorted(points, key=lambda point: point.name)]
        # The core first, then those that others may extend or measure with.
        loaded.sort(
            key=lambda pair: (pair[0].name != hookspecs.PROJECT, not any(hasattr(pair[1], hook) for hook in FIRST))
        )
        for point, plugin in loaded:
            if plugin is not None:
                host._try(point, partial(host.add, plugin, *_origin(point)))
        for path in files:
            host.add(load_file(path), path.stem, origin=str(path))
            for reason in (*host._infos[-1].disabled.values(), *host._infos[-1].duplicates):
                raise PluginError(f"plugin file {path}: {reason}")
        return host

    def add(self, plugin: object, name: str, version: str = "", origin: str = "") -> None:
        """Register one plugin. Raises PluginError, and registers nothing of it, not even its observers, if it cannot be
        used.

        What another plugin has registered under the same name is left to that one. A plugin with the hook
        humanclaw_hookspecs comes before those that implement what it specifies.
        """
        if self._manager.has_plugin(name) or self._manager.is_registered(plugin):
            raise PluginError(f"plugin {name!r} is already in use.", "Add it once, under a name of its own.")
        try:
            registry = self._gather(plugin, name)
        except BaseException as error:
            if self._manager.has_plugin(name):
                self._manager.unregister(name=name)
            if isinstance(error, PluginError | KeyboardInterrupt):
                raise
            raise PluginError(f"plugin {name!r} cannot be used: {_reason(error)}.", self._hint(error)) from error
        for kind, found in registry.found.items():
            self._found[kind] |= {one.name: one for one in found}
        refused = registry.disabled, tuple(registry.duplicates)
        self._infos.append(PluginInfo(name, version, origin, registry.provides, "", *refused))

    @property
    def infos(self) -> tuple[PluginInfo, ...]:
        return tuple(self._infos)

    def tell(self, hook: str, **event: Any) -> None:
        """Call a hook of every plugin that has it. One that raises is told of in the log; the others hear of it all the
        same."""
        for name, plugin in self._manager.list_name_plugin():
            if not hasattr(plugin, hook):
                continue
            try:
                self._only(plugin, hook)(**event)
            except KeyboardInterrupt:
                raise
            except BaseException as error:
                _LOG.warning("plugin %r failed at %s: %s", name, hook, _reason(error))

    @property
    def measures(self) -> dict[str, Measure]:
        """Every measure that a parameter can command, by name."""
        return {name: one.value for name, one in self._found["measures"].items()}

    @property
    def disabled(self) -> dict[str, str]:
        """Names of skills that are not in use, and why: nothing runs them, and nobody is offered them."""
        found = [item for info in self._infos for item in info.disabled.items()]
        return {name: reason for name, reason in found if name not in self.skills}

    @property
    def skills(self) -> dict[str, Skill]:
        return {name: one.value for name, one in self._found["skills"].items()}

    def owner(self, skill: str) -> str:
        return self._found["skills"][skill].owner

    def skill(self, name: str) -> Skill:
        """Return the skill of that name. Raises PluginError with the nearest names if there is no such skill."""
        return self._find("skills", name).value  # type: ignore[no-any-return]

    def registered(self, kind: str) -> tuple[Registration, ...]:
        """All that is registered through the hook `humanclaw_<kind>`; none if no plugin specifies such a hook."""
        return tuple(self._found.get(kind, {}).values())

    def make(self, kind: str, name: str, *args: Any, **options: Any) -> Any:
        """Call the factory registered under a name.

        Raises PluginError with the nearest names if there is none, and for one that needs a package that is not
        installed.
        """
        found = self._find(kind, name)
        try:
            return found.value(*args, **options)
        except (SystemExit, GeneratorExit) as error:
            raise PluginError(f"{noun(kind)} {name!r} of plugin {found.owner!r} gave up: {_reason(error)}.") from error
        except ModuleNotFoundError as error:
            needed = f"{noun(kind)} {name!r} of plugin {found.owner!r} needs {error.name!r}, which is not installed."
            raise PluginError(needed, f"Run `pip install {error.name}`.") from error

    def require(self, *wanted: tuple[str, str]) -> None:
        """Raise PluginError for all (kind, name) that are not there, with the one line that installs them."""
        missing = [(kind, name) for kind, name in wanted if name not in self._found.get(kind, {})]
        bringing = [distributions.bringing(kind, name) for kind, name in missing]
        if len(missing) > 1 and all(bringing):
            told = [f"{noun(kind)} {name!r}" for kind, name in missing]
            listed = f"{', '.join(told[:-1])} and {told[-1]}"
            raise PluginError(f"{listed} are not installed.", f"Run `{distributions.install(bringing)}`.")
        for kind, name in missing:
            self._find(kind, name)

    def scene(self, reference: str) -> Any:
        """Return the scene that `source:argument` names."""
        source, _, argument = reference.partition(":")
        return self.make("scenes", source, argument)

    def _find(self, kind: str, name: str) -> Registration:
        known = self._found.get(kind, {})
        if name in known:
            return known[name]
        if kind == "skills" and name in self.disabled:
            raise PluginError(f"skill {name!r} is disabled: {self.disabled[name]}")
        disabled = [f"{info.name} ({info.error})" for info in self._infos if info.error]
        lost = f" Plugins that are disabled: {'; '.join(disabled)}." if disabled else ""
        raise PluginError(f"there is no {noun(kind)} {name!r}.", self._remedy(kind, name) + lost)

    def _remedy(self, kind: str, name: str) -> str:
        """Return the line that installs what a name may mean, or else what there is."""
        known, elsewhere = self._found.get(kind, {}), distributions.table().get(kind, {})
        distribution = elsewhere.get(name)
        if distribution and distribution not in (info.origin for info in self._infos):
            return f"Run `{distributions.install([distribution])}`."
        near = difflib.get_close_matches(name, known.keys() | elsewhere.keys(), n=3, cutoff=0.5)
        if near:
            told = [one if one in known else f"{one} (of {elsewhere[one]})" for one in near]
            return f"Did you mean {' or '.join(told)}?"
        more = [f"{one} (of {of})" for one, of in elsewhere.items() if one not in known]
        return f"Known: {', '.join([*known, *more]) or 'none'}."

    def _load(self, point: importlib.metadata.EntryPoint) -> object | None:
        """Return the plugin's module; None, and the reason among the infos, if it cannot be imported or is for another
        version."""
        return self._try(point, lambda: _checked(point).load())

    def _try(self, point: importlib.metadata.EntryPoint, use: Callable[[], T]) -> T | None:
        try:
            return use()
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # A plugin is code of somebody else: not even its SystemExit ends the program.
            reason = str(error) if isinstance(error, PluginError) else _reason(error)
            self._infos.append(PluginInfo(*_origin(point), error=reason.rstrip(".")))
            return None

    def _gather(self, plugin: object, name: str) -> Registry:
        """All that a plugin registers and that can be used."""
        if self._manager.register(plugin, name) is None:
            raise PluginError(f"plugin {name!r} is blocked.")
        self._only(plugin, EXTENSION)(register=self._extend)
        self._manager.check_pending()
        registry = self._call_hooks(plugin, name)
        for kind in set(registry.found) - {"skills"}:
            registry.drop_duplicates(kind, self._found[kind])
        own = {one.name: one.value for one in registry.found.get("measures", [])}
        registry.disable_faulty_skills({**self.measures, **own}, self._base)
        registry.drop_duplicates("skills", self._found["skills"])
        return registry

    def _call_hooks(self, plugin: object, name: str) -> Registry:
        registry = Registry(name)
        for kind in self._found:
            self._only(plugin, PREFIX + kind)(register=registry.register(kind))
        return registry

    def _only(self, plugin: object, hook: str) -> Any:
        """Return a caller of one plugin's implementation of a hook."""
        others = [other for _, other in self._manager.list_name_plugin() if other is not plugin]
        return self._manager.subset_hook_caller(hook, others)

    def _extend(self, specs: ModuleType) -> None:
        """Add the hook specifications of a module; those that take `register` alone are kinds of things that have a
        name."""
        self._manager.add_hookspecs(specs)
        for name, spec in vars(specs).items():
            if (
                name.startswith(PREFIX)
                and name != EXTENSION
                and list(inspect.signature(spec).parameters) == ["register"]
            ):
                self._found.setdefault(name.removeprefix(PREFIX), {})

    def _hint(self, error: BaseException) -> str:
        """For a misspelt hook, the hook that was probably meant."""
        known = [name for name in vars(self._manager.hook) if name.startswith(PREFIX)]
        specified = [name for name in known if getattr(self._manager.hook, name).has_spec()]
        words = [word.strip("'\":,.") for word in _reason(error).split()]
        wrong = [word for word in words if word.startswith(PREFIX) and word not in specified]
        near = difflib.get_close_matches(wrong[0], specified, n=1, cutoff=0.5) if wrong else []
        return f"Did you mean {near[0]}?" if near else ""


def _origin(point: importlib.metadata.EntryPoint) -> tuple[str, str, str]:
    """Name, version and distribution of a plugin."""
    return (point.name, point.dist.version, point.dist.name) if point.dist else (point.name, "", "")


def _checked(point: importlib.metadata.EntryPoint) -> importlib.metadata.EntryPoint:
    if point.dist:
        _check_requirement(point.dist)
    return point


def _check_requirement(dist: importlib.metadata.Distribution) -> None:
    """Hold a distribution to the humanclaw that its own metadata say it was made for."""
    for text in dist.requires or ():
        requirement = Requirement(text)
        if canonicalize_name(requirement.name) == "humanclaw" and humanclaw.__version__ not in requirement.specifier:
            raise PluginError(
                f"{dist.name} {dist.version} needs humanclaw{requirement.specifier}, this is {humanclaw.__version__}.",
                f"Run `pip install --upgrade {dist.name} humanclaw`.",
            )


def _reason(error: BaseException) -> str:
    """Return the kind of an error and its words, on one line; an error of somebody else may fail even at saying
    them."""
    if isinstance(error, pluggy.PluginValidationError):
        return " ".join(str(error.args[0]).split())
    try:
        return f"{type(error).__name__}: {' '.join(str(error).split())}"[:_LONGEST_REASON]
    except Exception:
        return type(error).__name__


def load_file(path: Path) -> ModuleType:
    """Import one Python file as a plugin module. Raises PluginError if it is missing or fails."""
    if not path.is_file():
        raise PluginError(f"there is no plugin file {path}.", "Give the path of a Python file.")
    spec = importlib.util.spec_from_file_location(f"humanclaw_plugin_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise PluginError(f"{path} is not a Python file.", "Give the path of a file that ends in .py.")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        raise PluginError(f"plugin file {path} failed to load: {_reason(error)}.") from error
    return module
