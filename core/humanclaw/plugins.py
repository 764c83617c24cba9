"""The plugin host: finds plugins, keeps broken ones apart, and answers by name.

A plugin is a module with @hookimpl functions, found through the entry-point group `humanclaw` or loaded from one file. Each is
loaded in its own try: one that cannot be used is named and set aside, and only a run that needs it fails.
"""

from __future__ import annotations

import difflib
import importlib.metadata
import importlib.util
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import pluggy
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import humanclaw
from humanclaw import hookspecs
from humanclaw.contract import Skill
from humanclaw.errors import PluginError

KINDS: Final[Mapping[str, str]] = {
    "scenes": "scene source",
    "simulators": "simulator",
    "renderers": "renderer",
    "motion_generators": "motion generator",
    "agents": "agent",
    "verifiers": "verifier",
    "executors": "executor",
    "metrics": "metric",
    "reports": "reporter",
}
"""What can be registered under a name besides skills: hook suffix to what a person calls one of them."""


@dataclass(frozen=True)
class PluginInfo:
    """A plugin as `humanclaw plugins` lists it."""

    name: str
    version: str
    origin: str
    """The distribution or file it came from."""
    provides: tuple[str, ...] = ()
    error: str = ""
    """Why it was set aside; empty if it is in use."""


@dataclass(frozen=True)
class Offer:
    """Something registered under a name: a skill or a factory."""

    name: str
    owner: str
    value: Any
    description: str = ""


@dataclass
class _Shelf:
    """What one plugin registers, gathered apart so that a plugin that fails half-way leaves nothing behind."""

    owner: str
    skills: list[Offer] = field(default_factory=list)
    factories: dict[str, list[Offer]] = field(default_factory=dict)

    def skill(self, skill: Skill | Path) -> None:
        loaded = Skill.from_folder(skill) if isinstance(skill, Path) else skill
        if not isinstance(loaded, Skill):
            raise PluginError(
                f"register() takes a Skill or a folder; got {type(skill).__name__}.", "Decorate it with @skill."
            )
        self.skills.append(Offer(loaded.name, self.owner, loaded, loaded.description))

    def factory(self, kind: str) -> Callable[..., None]:
        def register(name: str, factory: Callable[..., Any], description: str = "") -> None:
            self.factories.setdefault(kind, []).append(Offer(name, self.owner, factory, description))

        return register


class Plugins:
    """All that is installed, by name. An object, not a global: two of them never influence each other."""

    def __init__(self) -> None:
        self._manager = pluggy.PluginManager(hookspecs.PROJECT)
        self._manager.add_hookspecs(hookspecs)
        self._infos: list[PluginInfo] = []
        self._skills: dict[str, Offer] = {}
        self._factories: dict[str, dict[str, Offer]] = {kind: {} for kind in KINDS}

    @classmethod
    def discover(cls, files: Sequence[Path] = ()) -> Plugins:
        """Every installed plugin, and then the given files. A file that cannot be used raises, since it was asked for by name."""
        host = cls()
        points = importlib.metadata.entry_points(group=hookspecs.PROJECT)
        for point in sorted(points, key=lambda point: (point.name != hookspecs.PROJECT, point.name)):
            host._try_entry_point(point)
        for path in files:
            host.add(load_file(path), path.stem, origin=str(path))
        return host

    def add(self, plugin: object, name: str, version: str = "", origin: str = "") -> None:
        """Register one plugin. Raises PluginError, and changes nothing, if it cannot be used."""
        shelf = self._gather(plugin, name)
        self._refuse_duplicates(shelf)
        self._skills |= {offer.name: offer for offer in shelf.skills}
        for kind, offers in shelf.factories.items():
            self._factories[kind] |= {offer.name: offer for offer in offers}
        provides = [f"skill {offer.name}" for offer in shelf.skills]
        provides += [f"{KINDS[kind]} {offer.name}" for kind, offers in shelf.factories.items() for offer in offers]
        self._infos.append(PluginInfo(name, version, origin, tuple(provides)))

    @property
    def infos(self) -> tuple[PluginInfo, ...]:
        return tuple(self._infos)

    @property
    def hook(self) -> Any:
        """The hook callers, for the observers and for humanclaw_commands."""
        return self._manager.hook

    @property
    def skills(self) -> dict[str, Skill]:
        return {name: offer.value for name, offer in self._skills.items()}

    def owner(self, skill: str) -> str:
        return self._skills[skill].owner

    def skill(self, name: str) -> Skill:
        """Raises PluginError with the nearest names if there is no such skill."""
        return self._find(self._skills, "skill", name).value  # type: ignore[no-any-return]

    def offers(self, kind: str) -> tuple[Offer, ...]:
        return tuple(self._factories[kind].values())

    def make(self, kind: str, name: str, *args: Any, **options: Any) -> Any:
        """Call the factory registered under a name. Raises PluginError with the nearest names if there is none."""
        return self._find(self._factories[kind], KINDS[kind], name).value(*args, **options)

    def scene(self, reference: str) -> Any:
        """The scene that `source:argument` names."""
        source, _, argument = reference.partition(":")
        return self.make("scenes", source, argument)

    def _find(self, offers: Mapping[str, Offer], kind: str, name: str) -> Offer:
        if name in offers:
            return offers[name]
        near = difflib.get_close_matches(name, offers, n=3, cutoff=0.5)
        hint = f"Did you mean {' or '.join(near)}?" if near else f"Known: {', '.join(offers) or 'none'}."
        aside = [f"{info.name} ({info.error})" for info in self._infos if info.error]
        lost = f" Plugins that were set aside: {'; '.join(aside)}." if aside else ""
        raise PluginError(f"there is no {kind} {name!r}.", hint + lost)

    def _try_entry_point(self, point: importlib.metadata.EntryPoint) -> None:
        dist = point.dist
        version, origin = (dist.version, dist.name) if dist else ("", "")
        try:
            if dist:
                _check_requirement(dist)
            self.add(point.load(), point.name, version, origin)
        except Exception as error:
            reason = str(error) if isinstance(error, PluginError) else f"{type(error).__name__}: {error}"
            self._infos.append(PluginInfo(point.name, version, origin, error=reason.rstrip(".")))

    def _gather(self, plugin: object, name: str) -> _Shelf:
        try:
            if self._manager.register(plugin, name) is None:
                raise PluginError(f"plugin {name!r} is blocked.")
            self._manager.check_pending()
            return self._call_hooks(plugin, name)
        except Exception as error:
            if self._manager.has_plugin(name):
                self._manager.unregister(name=name)
            if isinstance(error, PluginError):
                raise
            raise PluginError(f"plugin {name!r} cannot be used: {_reason(error)}.", _hook_hint(error)) from error

    def _call_hooks(self, plugin: object, name: str) -> _Shelf:
        shelf = _Shelf(name)
        others = [other for _, other in self._manager.list_name_plugin() if other is not plugin]
        self._manager.subset_hook_caller("humanclaw_skills", others)(register=shelf.skill)
        for kind in KINDS:
            self._manager.subset_hook_caller(f"humanclaw_{kind}", others)(register=shelf.factory(kind))
        return shelf

    def _refuse_duplicates(self, shelf: _Shelf) -> None:
        pairs = [(self._skills, "skill", shelf.skills)]
        pairs += [(self._factories[kind], KINDS[kind], offers) for kind, offers in shelf.factories.items()]
        for known, kind, offers in pairs:
            for offer in offers:
                first = known.get(offer.name) or _twice(offers, offer)
                if first:
                    self._manager.unregister(name=shelf.owner)
                    raise PluginError(
                        f"{kind} {offer.name!r} of plugin {shelf.owner!r} is already registered by {first.owner!r}.",
                        "Uninstall one of the two or rename it.",
                    )


def _twice(offers: Iterable[Offer], offer: Offer) -> Offer | None:
    same = [other for other in offers if other.name == offer.name]
    return same[0] if len(same) > 1 else None


def _check_requirement(dist: importlib.metadata.Distribution) -> None:
    """A distribution says in its own metadata which humanclaw it was made for; hold it to that."""
    for text in dist.requires or ():
        requirement = Requirement(text)
        if canonicalize_name(requirement.name) == "humanclaw" and humanclaw.__version__ not in requirement.specifier:
            raise PluginError(
                f"{dist.name} {dist.version} needs humanclaw{requirement.specifier}, this is {humanclaw.__version__}.",
                f"Run `pip install --upgrade {dist.name} humanclaw`.",
            )


def _reason(error: Exception) -> str:
    if isinstance(error, pluggy.PluginValidationError):
        return " ".join(str(error.args[0]).split())
    return f"{type(error).__name__}: {error}"


def _hook_hint(error: Exception) -> str:
    """For a misspelt hook, the hook that was probably meant."""
    known = [name for name in vars(hookspecs) if name.startswith("humanclaw_")]
    words = [word.strip("'\":,.") for word in _reason(error).split()]
    wrong = [word for word in words if word.startswith("humanclaw_") and word not in known]
    near = difflib.get_close_matches(wrong[0], known, n=1, cutoff=0.5) if wrong else []
    return f"Did you mean {near[0]}?" if near else ""


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
    except Exception as error:
        raise PluginError(f"plugin file {path} failed to load: {type(error).__name__}: {error}.") from error
    return module
