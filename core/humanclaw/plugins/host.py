"""The plugin host: finds plugins, keeps broken ones apart, and answers by name.

A plugin is a module with @hookimpl functions, found through the entry-point group `humanclaw` or loaded from one file.
It is known by its distribution, or by its file. Each is loaded in its own try: one that cannot be used is named and
disabled, and only a run that needs it fails. Where two register one name, both stay: the first is meant by the name
alone, either by owner:name, and a Choice says otherwise. A plugin can extend the host with hooks of its own (hook
humanclaw_hookspecs).
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import inspect
import logging
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from types import ModuleType
from typing import Any, Final, TypeVar

import pluggy

from humanclaw.errors import ANSWERING, FactoryError, HumanclawError, PluginError, RecordError, by_hand
from humanclaw.motion.checkpoint import read_header, shipped_base
from humanclaw.plugins import distributions, hookspecs
from humanclaw.plugins.bounded import Bounded
from humanclaw.plugins.deciders import Unmade
from humanclaw.plugins.hookspecs import noun
from humanclaw.plugins.loading import (
    PATIENCE,
    check_api,
    check_patience,
    has_hook,
    held_to_requirements,
    load_file,
    origin_of,
    reason_of,
)
from humanclaw.plugins.registry import Choice, PluginInfo, Registration, Registry, is_owner, means
from humanclaw.skills.contract import Skill
from humanclaw.skills.measures import MEASURES, Measure
from humanclaw.text.words import did_you_mean, nearest

T = TypeVar("T")
PREFIX: Final = "humanclaw_"
_LOG: Final = logging.getLogger(__name__)
_DECIDERS: Final = ("agents", "verifiers")
EXTENSION: Final = "humanclaw_hookspecs"
FIRST: Final = (EXTENSION, "humanclaw_measures")
"""Hooks whose plugins come before those that need what they bring."""


class Plugins:
    """All that is installed, by name. An object, not a global: two of them never influence each other."""

    def __init__(self, choice: Choice = Choice()) -> None:
        self.choice = choice
        self._specs: list[ModuleType] = []
        self._members: list[tuple[str, object]] = []
        self._manager = pluggy.PluginManager(hookspecs.PROJECT)
        self._infos: list[PluginInfo] = []
        self._offered: dict[str, list[Registration]] = {}
        """All that can be used, by kind, in the order in which it was registered."""
        self._faulty: list[Registration] = []
        self._left_out: list[Registration] = []
        self._found: dict[str, dict[str, Registration]] = {}
        """What a name alone means, by kind."""
        self._threads = threading.local()
        """Of each thread that tells observers: who hears it, by plugin."""
        self._extend(hookspecs)
        self._take(
            "measures", [Registration(k, hookspecs.PROJECT, one, one.description) for k, one in MEASURES.items()]
        )
        self._base: str = read_header(shipped_base())["digest"]

    @classmethod
    def discover(cls, files: Sequence[Path] = (), choice: Choice = Choice()) -> Plugins:
        """Every installed plugin that is wanted, and then the given files.

        Raises PluginError for a file that cannot be used, since it was asked for by name, and for one that has a name
        in common with another plugin while the choice says nothing of either.
        """
        host = cls(choice)
        points = sorted(importlib.metadata.entry_points(group=hookspecs.PROJECT), key=lambda point: origin_of(point)[0])
        loaded = [(point, host._load(point)) for point in points]
        # The core first, then those that others may extend or measure with.
        loaded.sort(
            key=lambda pair: (
                origin_of(pair[0])[2] != hookspecs.PROJECT,
                not any(has_hook(pair[1], hook) for hook in FIRST),
            )
        )
        for point, plugin in loaded:
            if plugin is not None:
                name, version, origin = origin_of(point)
                host._try(point, partial(host.add, plugin, host._free(name, point.name), version, origin))
        for path in files:
            host._add_file(path)
        host._check_choice()
        return host

    def _free(self, name: str, part: str) -> str:
        """Return the name of a plugin: its distribution's, with the entry point where that has several."""
        return name if not self._manager.has_plugin(name) else f"{name}/{part}"

    def _add_file(self, path: Path) -> None:
        number, name = 1, path.stem
        while self._manager.has_plugin(name):
            number, name = number + 1, f"{path.stem}-{number + 1}"
        self.add(load_file(path), name, origin=str(path))
        for reason in self._infos[-1].disabled.values():
            raise PluginError(f"plugin file {path}: {reason}")
        for found in self._offered.values():
            for one in found:
                first = next(other for other in found if other.name == one.name)
                wanted = {self.choice.rank(each) for each in found if each.name == one.name}
                if one.owner == name and first is not one and len(wanted) == 1:
                    told = f"plugin file {path}: {one.name!r} is also that of {first.owner!r}."
                    either = f"--prefer {name}:{one.name} or --prefer {first.owner}:{one.name}"
                    raise PluginError(told, f"Say which one you mean: {either}.")

    def add(self, plugin: object, name: str, version: str = "", origin: str = "") -> None:
        """Register one plugin. Raises PluginError, and registers nothing of it, not even its observers and its hooks,
        if it cannot be used.

        What another plugin has registered under the same name goes first, unless this one is HumanCLAW's own or the
        choice prefers it. A plugin with the hook humanclaw_hookspecs comes before those that implement what it
        specifies.
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
        """Go back to these specifications and to the plugins that are in use: pluggy cannot forget a specification."""
        self._manager = pluggy.PluginManager(hookspecs.PROJECT)
        self._specs = []
        for module in specs:
            self._extend(module)
        for kind in self._found.keys() - set(chain.from_iterable(map(_kinds, specs))):
            del self._found[kind], self._offered[kind]
        for name, plugin in self._members:
            self._manager.register(plugin, name)

    def _take(self, kind: str, found: Sequence[Registration]) -> None:
        """Offer what a plugin registers. Of equal names that goes first which is preferred, else HumanCLAW's own, else
        what was there first."""
        self._offered[kind] += found
        for one in found:
            same = [other for other in self._offered[kind] if other.name == one.name]
            self._found[kind][one.name] = min(same, key=self._place)

    def _place(self, one: Registration) -> tuple[int, bool]:
        return self.choice.rank(one), one.owner.partition("/")[0] not in distributions.own()

    def _check_choice(self) -> None:
        """Raise PluginError for what the choice names and nothing is, so that a misspelt word is not passed over."""
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

    @property
    def infos(self) -> tuple[PluginInfo, ...]:
        """Every plugin that was found, with what of it is in use."""
        return tuple(self._told(info) for info in self._infos)

    def _told(self, info: PluginInfo) -> PluginInfo:
        mine = [(k, one) for k, found in self._offered.items() for one in found if one.owner == info.name]
        provides = tuple(f"{noun(kind)} {one.name}" for kind, one in mine if self._found[kind][one.name] is one)
        second = tuple(self._gives_way(kind, one) for kind, one in mine if self._found[kind][one.name] is not one)
        return replace(info, provides=provides, duplicates=second)

    def _gives_way(self, kind: str, one: Registration) -> str:
        first = self._found[kind][one.name].owner
        told = f"{noun(kind)} {one.name!r} of plugin {one.owner!r} is already registered by {first!r}."
        return f"{told} Choose it with --prefer {one.owner}:{one.name}, or call it {one.owner}:{one.name}."

    def tell(self, hook: str, **event: Any) -> None:
        """Call a hook of every plugin that has it. One that raises, or hangs where an episode would have to wait for
        it, is told of in the log; the others hear of it all the same."""
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
        """Return what calls the observers of a plugin: for each thread that tells of something one of its own."""
        known: dict[str, Bounded] = vars(self._threads)
        if name not in known:
            known[name] = Bounded(self._patience(name))
        return known[name]

    def _patience(self, owner: str) -> float:
        return float(getattr(self._manager.get_plugin(owner), "HUMANCLAW_PATIENCE", PATIENCE))

    def bounded(self, one: Registration) -> Callable[..., Any]:
        """Return a function that somebody registered, waited for no longer than its plugin's HUMANCLAW_PATIENCE.

        Raises TimeoutError when that is over, and whatever the function raises.
        """
        patient = Bounded(self._patience(one.owner))
        return lambda *args: patient(partial(one.value, *args))

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
        """The skills that can be called, by name: all, or those that the choice names."""
        if not self.choice.skills:
            return {name: one.value for name, one in self._found["skills"].items()}
        return {self._find("skills", name).name: self.skill(name) for name in self.choice.skills}

    def owner(self, skill: str) -> str:
        """Return the plugin that a skill is of."""
        return self._find("skills", skill).owner

    def overridden(self, skill: str) -> tuple[str, ...]:
        """Return the other plugins that have a skill of this name."""
        first = self._find("skills", skill)
        return tuple(one.owner for one in self._offered["skills"] if one.name == first.name and one is not first)

    def info(self, owner: str) -> PluginInfo:
        """Return what is known of a plugin."""
        return next(info for info in self.infos if info.name == owner)

    def skill(self, name: str) -> Skill:
        """Return the skill of a name, or of owner:name. Raises PluginError with the nearest names if there is none."""
        return self._find("skills", name).value  # type: ignore[no-any-return]

    def offered(self, kind: str, name: str) -> Any:
        """Return what a name means, be it disabled. Raises PluginError with the nearest names if there is none."""
        if kind == "skills" and name not in self._found[kind]:
            for one in self._faulty:
                if name == one.name or means(name, one):
                    return one.value
        return self._find(kind, name).value

    def registered(self, kind: str) -> tuple[Registration, ...]:
        """All that is registered through the hook `humanclaw_<kind>`; none if no plugin specifies such a hook."""
        return tuple(self._found.get(kind, {}).values())

    def make(self, kind: str, name: str, *args: Any, **options: Any) -> Any:
        """Call the factory registered under a name.

        Raises PluginError with the nearest names if there is none, for one that needs a package that is not installed,
        and for an agent or a verifier whose factory raises what says nothing to a user.
        """
        found = self._find(kind, name)
        if not callable(found.value):
            told = f"{noun(kind)} {name!r} of plugin {found.owner!r} is {type(found.value).__name__} and no factory."
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
        """Make an agent or a verifier for an episode of a run, where nobody is there to mend it.

        One whose factory raises is stood in for, by the name of known_as, and its episode ends as plugin_error when it
        begins. Raises PluginError, ProviderError and LimitError as a decider may.
        """
        try:
            return self.make(kind, name, options)
        except FactoryError as error:
            return Unmade(known_as or name, self._find(kind, name).owner, error.__cause__ or error)

    def require(self, *wanted: tuple[str, str]) -> None:
        """Raise PluginError for all (kind, name) that are not there, with the one line that installs them."""
        missing = [(kind, name) for kind, name in wanted if self._get(kind, name) is None]
        bringing = [distributions.bringing(kind, name) for kind, name in missing]
        if len(missing) > 1 and all(bringing):
            told = [f"{noun(kind)} {name!r}" for kind, name in missing]
            listed = f"{', '.join(told[:-1])} and {told[-1]}"
            raise PluginError(f"{listed} are not installed.", f"Run `{distributions.install(bringing)}`.")
        for kind, name in missing:
            self._find(kind, name)

    def scene(self, reference: str) -> Any:
        """Return the scene that `source:argument` or `owner:source:argument` names."""
        source, _, argument = reference.partition(":")
        longer, _, rest = argument.partition(":")
        if source not in self._found["scenes"] and self._get("scenes", f"{source}:{longer}"):
            source, argument = f"{source}:{longer}", rest
        return self.make("scenes", source, argument)

    def _get(self, kind: str, name: str) -> Registration | None:
        """Return what name or owner:name means, if it means anything."""
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
        """Return the line that installs what a name may mean, or else what there is."""
        known, elsewhere = self._found.get(kind, {}), distributions.table().get(kind, {})
        distribution = elsewhere.get(name)
        if distribution and distribution not in (info.origin for info in self._infos):
            return f"Run `{distributions.install([distribution])}`."
        more = [f"{one} (of {of})" for one, of in elsewhere.items() if one not in (*known, name)]
        listed = f"Known: {', '.join([*known, *more]) or 'none'}."
        if distribution:
            return f"{distribution} brings it where what it needs is installed; here it is not. {listed}"
        return nearest(name, {**elsewhere, **dict.fromkeys(known, "")}) or listed

    def _load(self, point: importlib.metadata.EntryPoint) -> object | None:
        """Return the plugin's module; None, and the reason among the infos, if it is not wanted, cannot be imported or
        is for another version."""
        name, version, origin = origin_of(point)
        if origin != hookspecs.PROJECT and any(is_owner(text, name) for text in self.choice.without):
            self._infos.append(PluginInfo(name, version, origin, error="left out by --without"))
            return None
        return self._try(point, lambda: held_to_requirements(point).load())

    def _try(self, point: importlib.metadata.EntryPoint, use: Callable[[], T]) -> T | None:
        try:
            return use()
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # A plugin is code of somebody else: not even its SystemExit ends the program.
            reason = str(error) if isinstance(error, PluginError) else reason_of(error)
            self._infos.append(PluginInfo(*origin_of(point), error=reason.rstrip(".")))
            return None

    def _gather(self, plugin: object, name: str) -> Registry:
        """All that a plugin registers and that can be used."""
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            if self._manager.register(plugin, name) is None:
                raise PluginError(f"plugin {name!r} is blocked.")
        self._only(plugin, EXTENSION)(register=self._extend)
        self._manager.check_pending()
        registry = self._call_hooks(plugin, name)
        registry.notes = tuple(str(one.message) for one in told if issubclass(one.category, DeprecationWarning))
        registry.keep(self.choice)
        own = {one.name: one.value for one in registry.found.get("measures", [])}
        registry.disable_faulty_skills({**own, **self.measures}, self._base)
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
        self._specs.append(specs)
        for kind in _kinds(specs):
            self._found.setdefault(kind, {})
            self._offered.setdefault(kind, [])

    def _hint(self, error: BaseException) -> str:
        """For a misspelt hook, the hook that was probably meant."""
        known = [name for name in vars(self._manager.hook) if name.startswith(PREFIX)]
        specified = [name for name in known if getattr(self._manager.hook, name).has_spec()]
        words = [word.strip("'\":,.") for word in reason_of(error).split()]
        wrong = [word for word in words if word.startswith(PREFIX) and word not in specified]
        return did_you_mean(wrong[0], specified) if wrong else ""


def _gives_up(kind: str, error: BaseException) -> bool:
    """Tell whether a factory ends with what its plugin alone can mend. Who asks a model may say that none is to be
    had; of other kinds what they raise goes on, for it may be the machine's."""
    if kind in _DECIDERS:
        mendable = isinstance(error, HumanclawError) and not isinstance(error, RecordError)
        return not (mendable or isinstance(error, ANSWERING) or by_hand(error))
    return isinstance(error, SystemExit | GeneratorExit)


def _kinds(specs: ModuleType) -> Iterator[str]:
    """Yield the kinds of things that have a name, by the hooks that register them."""
    for name, spec in vars(specs).items():
        if name.startswith(PREFIX) and name != EXTENSION and list(inspect.signature(spec).parameters) == ["register"]:
            yield name.removeprefix(PREFIX)
