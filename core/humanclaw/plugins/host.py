"""The plugin host: finds plugins, keeps broken ones apart, and answers by name.

A plugin is a module with @hookimpl functions, found through the entry-point group `humanclaw` or loaded from one file.
Its distribution, or its file, names it. Each plugin loads in a try of its own: a broken one is named and disabled, and
only a run that needs it fails. If two plugins register the same name, both stay: the name alone means the first,
owner:name means either, and a Choice changes the order. A plugin can extend the host with hooks of its own (hook
humanclaw_hookspecs).
"""

from __future__ import annotations

import difflib
import importlib.metadata
import importlib.util
import inspect
import logging
import sys
import threading
import warnings
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import redirect_stdout
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from types import ModuleType
from typing import Any, Final, TypeVar

import pluggy

from humanclaw.errors import PluginError, by_hand
from humanclaw.plugins import hookspecs
from humanclaw.plugins.bounded import Bounded
from humanclaw.plugins.choice import Choice, PluginInfo, Registration, is_owner
from humanclaw.plugins.loading import (
    PATIENCE,
    check_api,
    check_patience,
    has_hook,
    held_to_requirements,
    is_from,
    load_file,
    origin_of,
    reason_of,
)
from humanclaw.plugins.lookup import Lookup, by_digest
from humanclaw.plugins.registry import Registry
from humanclaw.skills.measures import MEASURES

T = TypeVar("T")
PREFIX: Final = "humanclaw_"
_LOG: Final = logging.getLogger(__name__)
EXTENSION: Final = "humanclaw_hookspecs"


class Plugins(Lookup):
    """The installed plugins. An object, not a global: two hosts never influence each other."""

    def __init__(self, choice: Choice = Choice()) -> None:
        super().__init__(choice)
        self._specs: list[ModuleType] = []
        self._members: list[tuple[str, object]] = []
        self._manager = pluggy.PluginManager(hookspecs.PROJECT)
        self._absent: frozenset[str] = frozenset()
        self._threads = threading.local()
        """For each thread that calls observers: the bounded caller of each plugin."""
        self._extend(hookspecs)
        self._take(
            "measures", [Registration(k, hookspecs.PROJECT, one, one.description) for k, one in MEASURES.items()]
        )

    @classmethod
    def discover(cls, files: Sequence[Path] = (), choice: Choice = Choice(), absent: Collection[str] = ()) -> Plugins:
        """Load every installed plugin that the choice allows, then the given files but for installed packages.

        absent: plugins that stay unloaded, whatever the choice, because their code plays elsewhere.

        What plugins print meanwhile goes to stderr: stdout may carry JSON or a protocol.

        Raises PluginError for a file that cannot be used, and for a file that registers a name of another plugin while
        the choice prefers neither.
        """
        host = cls(choice)
        host._absent = frozenset(absent)
        with redirect_stdout(sys.stderr):
            host._discover(files)
        return host

    def _discover(self, files: Sequence[Path]) -> None:
        points = importlib.metadata.entry_points(group=hookspecs.PROJECT)
        found = sorted(((origin_of(point), point) for point in points), key=lambda pair: pair[0].name)
        loaded = [(info, point.name, self._load(info, point)) for info, point in found]
        # The core first, then those that others may extend or measure with.
        loaded.sort(key=lambda one: (one[0].origin != hookspecs.PROJECT, not _goes_first(one[2])))
        for info, part, plugin in loaded:
            if plugin is not None:
                self._try(info, partial(self.add, plugin, self._free(info.name, part), info.version, info.origin))
        for path in files:
            if not any(is_from(plugin, path / "__init__.py") for plugin in self._manager.get_plugins()):
                self._add_file(path)
        self._check_choice()

    def _free(self, name: str, part: str) -> str:
        """Return the name of a plugin: its distribution's, with the entry point where that has several."""
        return name if not self._manager.has_plugin(name) else f"{name}/{part}"

    def _add_file(self, path: Path) -> None:
        number, name = 1, path.stem
        while self._manager.has_plugin(name):
            number, name = number + 1, f"{path.stem}-{number + 1}"
        if self._unwanted(PluginInfo(name, "", str(path))):
            return
        self.add(load_file(path), name, origin=str(path))
        for reason in self._infos[-1].disabled.values():
            if not self.names_of(name, "skills"):
                raise PluginError(f"plugin file {path}: {reason}")
            _LOG.warning("plugin file %s: %s", path, reason)
        for found in self._offered.values():
            for one in found:
                first = next(other for other in found if other.name == one.name)
                wanted = {self.choice.rank(each) for each in found if each.name == one.name}
                if one.owner == name and first is not one and len(wanted) == 1:
                    told = f"plugin file {path}: {one.name!r} is also that of {first.owner!r}."
                    either = f"--prefer {name}:{one.name} or --prefer {first.owner}:{one.name}"
                    raise PluginError(told, f"Say which one you mean: {either}.")

    def add(self, plugin: object, name: str, version: str = "", origin: str = "") -> None:
        """Register one plugin.

        A name that another plugin has registered already keeps its meaning, unless this plugin is first-party or the
        choice prefers it. Add a plugin with the hook humanclaw_hookspecs before the plugins that implement its hooks.

        Raises PluginError for a plugin that cannot be used. Then nothing of it stays registered, hooks included.
        """
        if self._manager.has_plugin(name) or self._manager.is_registered(plugin):
            raise PluginError(f"plugin {name!r} is already in use.", "Add it once, under a name of its own.")
        specs = list(self._specs)
        try:
            check_api(getattr(plugin, "HUMANCLAW_API", hookspecs.API_VERSION), name)
            check_patience(getattr(plugin, "HUMANCLAW_PATIENCE", PATIENCE), name)
            registry = self._gather(plugin, name)
        except BaseException as error:
            hint = self._hint(error)
            self._rebuild(specs)
            if isinstance(error, PluginError | KeyboardInterrupt):
                raise
            raise PluginError(f"plugin {name!r} cannot be used: {reason_of(error)}.", hint) from error
        self._members.append((name, plugin))
        for kind, found in registry.found.items():
            self._take(kind, found)
        self._faulty += registry.faulty
        self._left_out += registry.left_out
        self._infos.append(PluginInfo(name, version, origin, (), "", registry.disabled, (), registry.notes))

    def _rebuild(self, specs: list[ModuleType]) -> None:
        """Start again with these specifications and the plugins in use: pluggy cannot forget a specification."""
        self._manager = pluggy.PluginManager(hookspecs.PROJECT)
        self._specs = []
        for module in specs:
            self._extend(module)
        for kind in self._found.keys() - set(chain.from_iterable(map(_kinds, specs))):
            del self._found[kind], self._offered[kind]
        for name, plugin in self._members:
            self._manager.register(plugin, name)

    def plugin(self, owner: str) -> object:
        """Return a plugin that is in use: its module or object. Raises PluginError if there is none of that name."""
        for name, member in self._members:
            if is_owner(owner, name):
                return member
        raise PluginError(f"there is no plugin {owner!r}.", "See `humanclaw plugins`.")

    def hooks(self, owner: str) -> frozenset[str]:
        """Return the names of the hooks that a plugin implements. Raises PluginError if it is not in use."""
        return frozenset(caller.name for caller in self._manager.get_hookcallers(self.plugin(owner)) or ())

    def tell(self, hook: str, **event: Any) -> None:
        """Call a hook of every plugin that has it. A plugin that raises, or keeps an episode waiting too long, is
        logged; the others are called all the same."""
        for name, plugin in self._manager.list_name_plugin():
            if not has_hook(plugin, hook):
                continue
            call = partial(self._only(plugin, hook), **event)
            try:
                if hook in hookspecs.OBSERVERS:
                    self._observer(name)(call)
                else:
                    call()
            except BaseException as error:
                if by_hand(error):
                    raise
                _LOG.warning("plugin %r failed at %s: %s", name, hook, reason_of(error))

    def _observer(self, name: str) -> Bounded:
        """Return the bounded caller of a plugin's observers: one for each thread that calls them."""
        known: dict[str, Bounded] = vars(self._threads)
        if name not in known:
            known[name] = Bounded(self._patience(name))
        return known[name]

    def _patience(self, owner: str) -> float:
        return float(getattr(self._manager.get_plugin(owner), "HUMANCLAW_PATIENCE", PATIENCE))

    def bounded(self, one: Registration) -> Callable[..., Any]:
        """Return a registered function with a timeout: its plugin's HUMANCLAW_PATIENCE, seconds.

        The returned function raises TimeoutError after that time, and whatever the registered function raises.
        """
        patient = Bounded(self._patience(one.owner))
        return lambda *args: patient(partial(one.value, *args))

    def _load(self, info: PluginInfo, point: importlib.metadata.EntryPoint) -> object | None:
        """Import a plugin's module. Returns None, and notes the reason in the infos, if it is not wanted, cannot be
        imported or was made for another version."""
        if info.origin != hookspecs.PROJECT and self._unwanted(info):
            return None
        if info.name in self._absent:
            self._infos.append(replace(info, error="plays elsewhere"))
            return None
        return self._try(info, lambda: held_to_requirements(point).load())

    def _unwanted(self, info: PluginInfo) -> bool:
        """Whether the choice leaves a whole plugin out, which is then noted in the infos."""
        unwanted = any(is_owner(text, info.name) for text in self.choice.without)
        if unwanted:
            self._infos.append(replace(info, error="left out by --without"))
        return unwanted

    def _try(self, info: PluginInfo, use: Callable[[], T]) -> T | None:
        try:
            return use()
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # Third-party code: not even its SystemExit may end the program.
            reason = str(error) if isinstance(error, PluginError) else reason_of(error)
            self._infos.append(replace(info, error=reason.rstrip(".")))
            return None

    def _gather(self, plugin: object, name: str) -> Registry:
        """Collect a plugin's registrations, and those of them that can be used."""
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            if self._manager.register(plugin, name) is None:
                raise PluginError(f"plugin {name!r} is blocked.")
        self._only(plugin, EXTENSION)(register=self._extend)
        self._manager.check_pending()
        registry = self._call_hooks(plugin, name)
        registry.notes = tuple(str(one.message) for one in told if issubclass(one.category, DeprecationWarning))
        registry.keep(self.choice)
        priors = by_digest(registry.found.get("priors", []))
        if registry.found.get("skills"):
            own = {one.name: one.value for one in registry.found.get("measures", [])}
            registry.disable_faulty_skills({**own, **self.measures}, {**self.priors, **priors})
        return registry

    def _call_hooks(self, plugin: object, name: str) -> Registry:
        registry = Registry(name)
        for kind in self._found:
            self._only(plugin, PREFIX + kind)(register=registry.register(kind))
        return registry

    def _only(self, plugin: object, hook: str) -> Any:
        """Return a caller of one plugin's implementation of a hook, and of no other plugin's."""
        others = [other for _, other in self._manager.list_name_plugin() if other is not plugin]
        return self._manager.subset_hook_caller(hook, others)

    def _extend(self, specs: ModuleType) -> None:
        """Add the hook specifications of a module. A hook that takes `register` alone defines a kind of named items."""
        self._manager.add_hookspecs(specs)
        self._specs.append(specs)
        for kind in _kinds(specs):
            self._found.setdefault(kind, {})
            self._offered.setdefault(kind, [])

    def use(self, kind: str) -> Callable[[Any, Plugins], None] | None:
        """Return how `humanclaw check` uses an item of a plugin's own hook: `USES[kind]` beside its specification."""
        return next((specs.USES[kind] for specs in self._specs if kind in getattr(specs, "USES", {})), None)

    def _hint(self, error: BaseException) -> str:
        """Suggest the nearest hook for a misspelt one."""
        known = [name for name in vars(self._manager.hook) if name.startswith(PREFIX)]
        specified = [name for name in known if getattr(self._manager.hook, name).has_spec()]
        words = [word.strip("'\":,.").partition("(")[0] for word in reason_of(error).split()]
        if isinstance(error, pluggy.PluginValidationError) and (named := [one for one in words if one in specified]):
            return f"It takes {', '.join(getattr(self._manager.hook, named[0]).spec.argnames)}."
        wrong = [word for word in words if word.startswith(PREFIX) and word not in specified]
        if not wrong:
            return ""
        # Without the prefix, which would make every hook look near.
        word, known = _bare(wrong[0]), [_bare(name) for name in specified]
        begun = [name for name in known if name.startswith(word)]
        near = begun or difflib.get_close_matches(word, known, n=1, cutoff=0.5)
        return f"Did you mean {PREFIX}{near[0]}?" if near else f"The hooks are {', '.join(sorted(specified))}."


def _goes_first(plugin: object) -> bool:
    """Whether a plugin may define what others need."""
    return any(has_hook(plugin, hook) for hook in (EXTENSION, "humanclaw_measures", "humanclaw_priors"))


def _bare(hook: str) -> str:
    return hook.removeprefix(PREFIX)


def _kinds(specs: ModuleType) -> Iterator[str]:
    """Yield the kinds of named items that a module of specifications defines."""
    for name, spec in vars(specs).items():
        if name.startswith(PREFIX) and name != EXTENSION and list(inspect.signature(spec).parameters) == ["register"]:
            yield name.removeprefix(PREFIX)
