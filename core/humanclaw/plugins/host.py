"""The plugin host: finds plugins, keeps broken ones apart, and answers by name.

A plugin is a module with @hookimpl functions, found through the entry-point group `humanclaw` or loaded from one file.
Its distribution, or its file, names it. Each plugin loads in a try of its own: a broken one is named and disabled, and
only a run that needs it fails. If two plugins register the same name, both stay: the name alone means the first,
owner:name means either. A plugin can extend the host with hooks of its own (hook humanclaw_hookspecs).

What is heavy is imported where it is used: the command line asks modules for their commands before any skill is read.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import inspect
import logging
import os
import re
import reprlib
import sys
import warnings
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import partial
from itertools import chain
from pathlib import Path
from traceback import walk_tb
from types import ModuleType
from typing import TYPE_CHECKING, Any, Final, TypeVar

import pluggy
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from humanclaw.errors import (
    ANSWERING,
    FactoryError,
    HumanclawError,
    PluginError,
    RecordError,
    SceneError,
    by_hand,
    in_words,
)
from humanclaw.plugins import distributions, hookspecs
from humanclaw.plugins.choice import Choice, PluginInfo, Registration, drops, is_owner, means
from humanclaw.plugins.hookspecs import noun
from humanclaw.text.json import first_fault
from humanclaw.text.words import did_you_mean, nearest

if TYPE_CHECKING:
    from humanclaw.skills.contract import Skill
    from humanclaw.skills.measures import Measure

T = TypeVar("T")
PREFIX: Final = "humanclaw_"
EXTENSION: Final = "humanclaw_hookspecs"
_EARLY: Final = (EXTENSION, "humanclaw_measures", "humanclaw_priors")
"""Hooks of plugins that others may need: these plugins are added first."""
_AGENT_KINDS: Final = ("agents", "verifiers")
_NAME: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_. -]{0,63}")
_OURS: Final = re.compile(r"humanclaw(?![\w.-])", re.IGNORECASE)
"""A requirement of the core itself; of a hundred others the name is not worth parsing."""
_OUTSIDE: Final = re.compile(r"(?m)^\s*[^\s\[#].*")
"""A line of entry points that is no heading, where there are no entry points: no heading is above it."""
_LOG: Final = logging.getLogger(__name__)


class Plugins:
    """The installed plugins. An object, not a global: two hosts never influence each other."""

    def __init__(self, choice: Choice = Choice()) -> None:
        from humanclaw.skills.measures import MEASURES

        self.choice = choice
        self._infos: list[PluginInfo] = []
        self._items: dict[str, list[Registration]] = {}
        """By kind, the name of the hook without `humanclaw_`, in order of preference: a name alone means the first."""
        self._unused: dict[str, list[Registration]] = {}
        """Faulty skills, and items that the choice leaves out, by kind."""
        self._specs: list[ModuleType] = []
        self._leading: set[str] = set()
        self._manager = pluggy.PluginManager(hookspecs.PROJECT)
        self._extend(hookspecs)
        for name, measure in MEASURES.items():
            item = Registration(name, hookspecs.PROJECT, measure, measure.description)
            self._items["measures"].append(item)

    # -- adding plugins ------------------------------------------------------------------------------------------------
    @classmethod
    def discover(
        cls, files: Sequence[Path | str] = (), choice: Choice = Choice(), absent: Collection[str] = ()
    ) -> Plugins:
        """Load every installed plugin that the choice allows, then the given files but for installed packages.

        absent: plugins that stay unloaded, whatever the choice, because their code plays elsewhere.

        What plugins print meanwhile goes to stderr: stdout may carry JSON or a protocol.

        Raises PluginError for a file that cannot be used, for a file that registers a name of another plugin, and for
        a choice that names nothing.
        """
        host = cls(choice)
        with redirect_stdout(sys.stderr):
            host._add_installed(absent)
            for path in map(package_in, map(Path, files)):
                if not any(is_from(plugin, path / "__init__.py") for plugin in host._manager.get_plugins()):
                    host._add_file(path)
            host._check_choice()
        return host

    def _add_installed(self, absent: Collection[str]) -> None:
        loaded = []
        for info, points in installed():
            if not self._is_left_out(info, absent):
                modules = ((point.name, self._try(info, partial(_load, info, point))) for point in points)
                loaded += [(info, part, *module) for part, module in modules if module]
        # The core first, then those that others may extend or measure with.
        loaded.sort(key=lambda entry: (entry[0].name != hookspecs.PROJECT, not entry[3]))
        for info, part, module, _ in loaded:
            name = f"{info.name}/{part}" if self._manager.has_plugin(info.name) else info.name
            self._try(info, partial(self.add, module, name, info.version, info.origin))

    def _is_left_out(self, info: PluginInfo, absent: Collection[str] = ()) -> bool:
        """Whether a plugin stays unloaded; the infos then say why."""
        unwanted = info.name != hookspecs.PROJECT and any(is_owner(text, info.name) for text in self.choice.without)
        why = "left out by --without" if unwanted else "plays elsewhere" if info.name in absent else info.error
        if why:
            self._infos.append(replace(info, error=why))
        return bool(why)

    def _try(self, info: PluginInfo, use: Callable[[], T]) -> T | None:
        try:
            return use()
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # Third-party code: not even its SystemExit may end the program.
            reason = str(error) if isinstance(error, PluginError) else in_words(error)
            self._infos.append(replace(info, error=reason.rstrip(".")))
            return None

    def _add_file(self, path: Path) -> None:
        from humanclaw.skills.contract import untrained

        number, name = 1, path.stem
        while self._manager.has_plugin(name):
            number, name = number + 1, f"{path.stem}-{number + 1}"
        if self._is_left_out(PluginInfo(name, "", str(path))):
            return
        self.add(load_file(path), name, origin=str(path))
        for reason in self._infos[-1].disabled.values():
            if not self.of_owner(name, "skills"):
                raise PluginError(f"plugin file {path}: {reason}")
            _LOG.warning("plugin file %s: %s", path, reason)
        self._refuse_taken_names(name, path)
        for item in self.of_owner(name, "skills"):
            if not item.value.trained:
                _LOG.warning("plugin file %s: no model gets this one: %s", path, untrained(item.value))
        if not self.hooks(name):
            _LOG.warning("plugin file %s has no hook, so it registers nothing. Write one with @hookimpl.", path)
        for hook in self.idle_hooks(name):
            _LOG.warning("plugin file %s: %s registers nothing. Call register(...) in it.", path, hook)

    def _refuse_taken_names(self, owner: str, path: Path) -> None:
        """Raise PluginError if a name alone means another plugin's item, and nobody has chosen that."""
        for kind in self._items:
            first = self._first(kind)
            for item in self.of_owner(owner, kind):
                other = first[item.name]
                if other is not item and not self.choice.names(other):
                    message = f"plugin file {path}: {item.name!r} is also that of {other.owner!r}."
                    either = f"--without {other.owner}:{item.name} or --without {owner}:{item.name}"
                    raise PluginError(message, f"Say which one to leave out: {either}.")

    def add(self, plugin: object, name: str, version: str = "", origin: str = "", first: bool = False) -> None:
        """Register one plugin.

        A name that another plugin has registered already keeps its meaning, unless this plugin is first-party. Add a
        plugin with the hook humanclaw_hookspecs before the plugins that implement its hooks.

        first: whether its items go before those of all other plugins.

        Raises PluginError for a plugin that cannot be used. Then nothing of it stays registered but its hook
        specifications.
        """
        if self._manager.has_plugin(name) or self._manager.is_registered(plugin):
            raise PluginError(f"plugin {name!r} is already in use.", "Add it once, under a name of its own.")
        try:
            check_api(getattr(plugin, "HUMANCLAW_API", hookspecs.API_VERSION), name)
            gathered = self._gather(plugin, name)
        except BaseException as error:
            if self._manager.is_registered(plugin):
                self._manager.unregister(plugin)
            if isinstance(error, PluginError | KeyboardInterrupt):
                raise
            raise PluginError(f"plugin {name!r} cannot be used: {_reason(error)}.") from error
        self._leading |= {name} if first else set()
        for kind, items in gathered.items.items():
            self._items[kind] = sorted([*self._items[kind], *items], key=self._place)
        for kind, items in gathered.unused.items():
            self._unused.setdefault(kind, []).extend(items)
        self._infos.append(PluginInfo(name, version, origin, (), "", gathered.disabled, (), gathered.notes))

    def _place(self, item: Registration) -> tuple[bool, ...]:
        """Return the sort key of preference; of equals the earlier registered one comes first."""
        foreign = item.owner.partition("/")[0] not in distributions.own()
        return item.owner not in self._leading, not self.choice.names(item), foreign

    def _gather(self, plugin: object, name: str) -> _Gathered:
        """Collect a plugin's registrations, and those of them that can be used."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            self._register(plugin, name)
        self._call(plugin, EXTENSION, register=self._extend)
        self._refuse_odd_hooks(plugin, name)
        notes = tuple(str(warning.message) for warning in caught if issubclass(warning.category, DeprecationWarning))
        gathered = _Gathered(name, self.choice, notes)
        for kind in self._items:
            self._call(plugin, PREFIX + kind, register=partial(gathered.register, kind), plugins=self)
        if gathered.items.get("skills"):
            measures = {item.name: item.value for item in gathered.items.get("measures", ())}
            priors = by_digest(gathered.items.get("priors", ()))
            gathered.disable_faulty_skills({**measures, **self.measures}, {**self.priors, **priors})
        return gathered

    def _register(self, plugin: object, name: str) -> None:
        """Register with pluggy, which refuses a hook that takes what it is not given."""
        try:
            self._manager.register(plugin, name)
        except pluggy.PluginValidationError as error:
            reason = " ".join(str(error.args[0]).split())
            hook = re.search(rf"{PREFIX}\w+", reason.partition(" for hook ")[2])
            takes = f"It takes {', '.join(getattr(self._manager.hook, hook[0]).spec.argnames)}." if hook else ""
            raise PluginError(f"plugin {name!r} cannot be used: {reason}.", takes) from error

    def _refuse_odd_hooks(self, plugin: object, name: str) -> None:
        """Raise PluginError for a hook without @hookimpl, and for one that nobody specifies, with the likely one."""
        known = [hook.removeprefix(PREFIX) for hook, caller in vars(self._manager.hook).items() if caller.has_spec()]
        for hook in (PREFIX + bare for bare in known):
            function = getattr(plugin, hook, None)
            if callable(function) and not {"humanclaw_impl", "humanclaw_spec"} & {*dir(function)}:
                raise PluginError(f"plugin {name!r} has {hook} without @hookimpl.", "Write @hookimpl above it.")
        for caller in self._manager.get_hookcallers(plugin) or ():
            optional = all(impl.optionalhook for impl in caller.get_hookimpls() if impl.plugin is plugin)
            if not caller.has_spec() and not optional:
                # Compared without the prefix, which would make every hook look near.
                word = caller.name.removeprefix(PREFIX)
                near = [hook for hook in known if hook.startswith(word)] or get_close_matches(word, known, 1, 0.5)
                every = f"The hooks are {', '.join(PREFIX + hook for hook in sorted(known))}."
                remedy = f"Did you mean {PREFIX}{near[0]}?" if near else every
                raise PluginError(f"plugin {name!r} cannot be used: unknown hook {caller.name!r}.", remedy)

    def _call(self, plugin: object, hook: str, **event: Any) -> None:
        """Call one plugin's implementation of a hook, if it has one."""
        caller = getattr(self._manager.hook, hook, None)
        for impl in caller.get_hookimpls() if caller else ():
            if impl.plugin is plugin:
                impl.function(*(event[name] for name in impl.argnames))

    def _extend(self, specs: ModuleType) -> None:
        """Add the hook specifications of a module. A hook that takes `register` defines a kind of named items."""
        self._manager.add_hookspecs(specs)
        self._specs.append(specs)
        for name, spec in vars(specs).items():
            if name.startswith(PREFIX) and name != EXTENSION and "register" in inspect.signature(spec).parameters:
                self._items.setdefault(name.removeprefix(PREFIX), [])

    def _check_choice(self) -> None:
        """Raise PluginError if the choice names something that is not installed: it may be misspelt."""
        plugins = [info.name for info in self._infos if info.name != hookspecs.PROJECT]
        for text in self.choice.without:
            dropped = (drops(text, item, kind) for kind, items in self._unused.items() for item in items)
            if not any(is_owner(text, name) for name in plugins) and not any(dropped):
                message = f"--without takes the name of a skill, of a plugin, or OWNER:NAME; got {text!r}."
                raise PluginError(message, self._likely(text, plugins) or "See `humanclaw plugins`.")
        for name in self.choice.skills:
            self.skill(name)

    def _likely(self, text: str, plugins: Iterable[str]) -> str:
        """Return a question with what can be left out and has a text's name or beginning, or else is near it."""
        owner, colon, name = text.rpartition(":")
        items = [item for item in chain(*self._items.values()) if item.owner != hookspecs.PROJECT]
        begun = [] if colon else [skill for skill in self._first("skills") if skill.startswith(name)]
        named = dict.fromkeys(f"{item.owner}:{item.name}" for item in items if item.name == name)
        if begun or named:
            return f"Did you mean {' or '.join([*begun, *named])}?"
        whole = [f"{owner}:{item.name}" for item in items if is_owner(owner, item.owner)]
        return did_you_mean(text, whole if colon else [*self._first("skills"), *plugins])

    # -- plugins -------------------------------------------------------------------------------------------------------
    def tell(self, hook: str, **event: Any) -> None:
        """Call a hook of every plugin that has it. A plugin that raises is logged; the others are called all the
        same."""
        for name, plugin in self._manager.list_name_plugin():
            try:
                self._call(plugin, hook, **event)
            except BaseException as error:
                if by_hand(error):
                    raise
                _LOG.warning("plugin %r failed at %s: %s", name, hook, in_words(error))

    def plugin(self, owner: str) -> object:
        """Return a plugin that is in use: its module or object. Raises PluginError if there is none of that name."""
        for name, member in self._manager.list_name_plugin():
            if is_owner(owner, name):
                return member
        raise PluginError(f"there is no plugin {owner!r}.", "See `humanclaw plugins`.")

    def hooks(self, owner: str) -> frozenset[str]:
        """Return the names of the hooks that a plugin implements. Raises PluginError if it is not in use."""
        return frozenset(caller.name for caller in self._manager.get_hookcallers(self.plugin(owner)) or ())

    def idle_hooks(self, owner: str) -> list[str]:
        """Return the hooks that take `register` of a plugin that has registered nothing."""
        if any(item.owner == owner for item in chain(*self._items.values(), *self._unused.values())):
            return []
        return sorted(self.hooks(owner) & {PREFIX + kind for kind in self._items})

    def use(self, kind: str) -> Callable[[Any, Plugins], None] | None:
        """Return how `humanclaw check` uses an item of a plugin's own hook: `USES[kind]` beside its specification."""
        return next((specs.USES[kind] for specs in self._specs if kind in getattr(specs, "USES", {})), None)

    @property
    def infos(self) -> tuple[PluginInfo, ...]:
        """Every plugin that was found, with its items in use."""
        return tuple(self._with_items(info) for info in self._infos)

    def info(self, owner: str) -> PluginInfo:
        """Return the entry of a plugin."""
        return next(info for info in self.infos if info.name == owner)

    def _with_items(self, info: PluginInfo) -> PluginInfo:
        provides, duplicates = [], []
        for kind, items in self._items.items():
            first = self._first(kind)
            for item in (item for item in items if item.owner == info.name):
                if first[item.name] is item:
                    provides.append(f"{noun(kind)} {item.name}")
                else:
                    message = f"{noun(kind)} {item.name!r} of plugin {item.owner!r} is already registered by"
                    duplicates.append(f"{message} {first[item.name].owner!r}. Call it {item.owner}:{item.name}.")
        return replace(info, provides=tuple(provides), duplicates=tuple(duplicates))

    # -- items by name -------------------------------------------------------------------------------------------------
    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of items that plugins can register."""
        return tuple(self._items)

    def registered(self, kind: str) -> tuple[Registration, ...]:
        """All that is registered through the hook `humanclaw_<kind>`; none if no plugin specifies such a hook."""
        return tuple(self._first(kind).values())

    def of_owner(self, owner: str, kind: str) -> tuple[Registration, ...]:
        """Return a plugin's items of a kind, in the order in which it registered them."""
        return tuple(item for item in self._items.get(kind, ()) if item.owner == owner)

    def offered(self, kind: str, name: str) -> Any:
        """Return the item of a name, also a skill that is disabled or left out. Raises PluginError with the nearest
        names if there is none."""
        unused = self._unused.get(kind, ()) if kind == "skills" and name not in self._first(kind) else ()
        named = next((item for item in unused if name == item.name or means(name, item)), None)
        return (named or self._find(kind, name)).value

    def make(self, kind: str, name: str, *args: Any, **options: Any) -> Any:
        """Call the factory registered under a name.

        Raises PluginError if there is no such name (with the nearest ones), if the factory needs a package that is not
        installed, and if the factory of an agent or a verifier fails with an error that a user cannot mend.
        """
        item = self._find(kind, name)
        whose = f"{noun(kind)} {name!r} of plugin {item.owner!r}"
        if not callable(item.value):
            message = f"{whose} is of type {type(item.value).__name__}; expected a factory."
            raise PluginError(message, "Register a function that makes one.")
        try:
            return item.value(*args, **options)
        except ModuleNotFoundError as error:
            message = f"{whose} needs {error.name!r}, which is not installed."
            # A module may come with a distribution of another name, as cv2 and google.protobuf do.
            raise PluginError(message, "Install the distribution that provides it.") from error
        except BaseException as error:
            if not _gives_up(kind, error):
                raise
            raise FactoryError(f"{whose} gave up: {in_words(error)}.") from error

    def make_agent(self, kind: str, name: str, options: Mapping[str, Any], known_as: str = "") -> Any:
        """Make an agent or a verifier for an episode of an unattended run.

        If its factory raises, return a stand-in with the name known_as; its episode ends as plugin_error when it
        begins. Raises PluginError, ProviderError and LimitError, as agents and verifiers may.
        """
        from humanclaw.plugins.validation import Unmade

        try:
            return self.make(kind, name, options)
        except FactoryError as error:
            return Unmade(known_as or name, self.owner(name, kind), error.__cause__ or error)

    def scene(self, reference: str) -> Any:
        """Make the scene that `source:argument` or `owner:source:argument` refers to."""
        source, _, argument = reference.partition(":")
        longer, _, rest = argument.partition(":")
        if source not in self._first("scenes") and self._get("scenes", f"{source}:{longer}"):
            source, argument = f"{source}:{longer}", rest
        try:
            return self.make("scenes", source, argument)
        except SceneError as error:
            if argument:
                raise
            raise SceneError(f"scene {reference!r} says not which {source}.", error.remedy) from error

    def require(self, *wanted: tuple[str, str]) -> None:
        """Raise PluginError if a (kind, name) is not installed, with the one line that installs all that are
        missing."""
        missing = [(kind, name) for kind, name in wanted if self._get(kind, name) is None]
        bringing = [distributions.bringing(kind, name) for kind, name in missing]
        if len(missing) > 1 and all(bringing):
            names = [f"{noun(kind)} {name!r}" for kind, name in missing]
            listed = f"{', '.join(names[:-1])} and {names[-1]}"
            raise PluginError(f"{listed} are not installed.", f"Run `{distributions.install(bringing)}`.")
        for kind, name in missing:
            self._find(kind, name)

    @property
    def priors(self) -> dict[str, Path]:
        """The checkpoints of the installed priors, by digest; the shipped one where no plugin registers any."""
        from humanclaw.motion.checkpoint import shipped_base

        return by_digest(self.registered("priors") or [Registration("", hookspecs.PROJECT, shipped_base())])

    @property
    def measures(self) -> dict[str, Measure]:
        """Every measure that a parameter can command, by name."""
        return {name: item.value for name, item in self._first("measures").items()}

    @property
    def skills(self) -> dict[str, Skill]:
        """The skills that can be called, by name: all, or those that the choice names."""
        wanted = [self._find("skills", name) for name in self.choice.skills] or self.registered("skills")
        return {item.name: item.value for item in wanted}

    def skill(self, name: str) -> Skill:
        """Return the skill of a name, or of owner:name. Raises PluginError with the nearest names if there is none."""
        return self._find("skills", name).value  # type: ignore[no-any-return]  # Items of the kind skills hold a Skill.

    @property
    def disabled(self) -> dict[str, str]:
        """Skills that are not in use, by name, with the reason."""
        reasons = [reason for info in self._infos for reason in info.disabled.items()]
        return {name: reason for name, reason in reasons if name not in self.skills}

    def owner(self, name: str, kind: str = "skills") -> str:
        """Return the plugin that brings a skill, or an item of another kind."""
        return self._find(kind, name).owner

    def overridden(self, skill: str) -> tuple[str, ...]:
        """Return the other plugins that have a skill of this name."""
        first = self._find("skills", skill)
        return tuple(item.owner for item in self._items["skills"] if item.name == first.name and item is not first)

    def _first(self, kind: str) -> dict[str, Registration]:
        """Return the item that each name alone means."""
        first: dict[str, Registration] = {}
        for item in self._items.get(kind, ()):
            first.setdefault(item.name, item)
        return first

    def _get(self, kind: str, name: str) -> Registration | None:
        """Return the item of name or owner:name; None if there is none."""
        named = (item for item in self._items.get(kind, ()) if name == item.name or (":" in name and means(name, item)))
        return next(named, None)

    def _find(self, kind: str, name: str) -> Registration:
        if item := self._get(kind, name):
            return item
        if kind == "skills" and name in self.disabled:
            raise PluginError(f"skill {name!r} is disabled: {self.disabled[name]}")
        disabled = [f"{info.name} ({info.error})" for info in self._infos if info.error]
        lost = f" Plugins that are disabled: {'; '.join(disabled)}." if disabled else ""
        raise PluginError(f"there is no {noun(kind)} {name!r}.", self._remedy(kind, name) + lost)

    def _remedy(self, kind: str, name: str) -> str:
        """Return the command that installs the likely package of a name, or else the known names."""
        known, elsewhere = self._first(kind), distributions.table().get(kind, {})
        distribution = elsewhere.get(name)
        if distribution and distribution not in (info.origin for info in self._infos):
            return f"Run `{distributions.install([distribution])}`."
        more = [f"{other} (of {of})" for other, of in elsewhere.items() if other not in (*known, name)]
        listed = f"Known: {', '.join([*known, *more]) or 'none'}."
        if distribution:
            return f"{distribution} brings it, but a package that it needs is not installed. {listed}"
        return nearest(name, {**elsewhere, **dict.fromkeys(known, "")}) or listed


def by_digest(priors: Iterable[Registration]) -> dict[str, Path]:
    """Return the checkpoints of registered priors by digest. Raises CheckpointError for one that cannot be read."""
    from humanclaw.motion.checkpoint import read_header

    return {str(read_header(item.value)["digest"]): item.value for item in priors}


def _gives_up(kind: str, error: BaseException) -> bool:
    """Tell whether a factory failed with an error that only its plugin can mend.

    Agents and verifiers may report that a model cannot be had. Errors of other kinds of factories may be the machine's.
    """
    if kind in _AGENT_KINDS:
        mendable = isinstance(error, HumanclawError) and not isinstance(error, RecordError)
        return not (mendable or isinstance(error, ANSWERING) or by_hand(error))
    return isinstance(error, SystemExit | GeneratorExit)


@dataclass
class _Gathered:
    """Registrations of one plugin, apart from the host's: a plugin that fails half-way leaves nothing behind."""

    owner: str
    choice: Choice
    notes: tuple[str, ...]
    items: dict[str, list[Registration]] = field(default_factory=dict)
    unused: dict[str, list[Registration]] = field(default_factory=dict)
    disabled: dict[str, str] = field(default_factory=dict)
    """Skills that break the contract, by name, with the reason."""

    def register(self, kind: str, named: Any, value: Any = None, description: str = "") -> None:
        """Take name, value and description, or one value that has a name and a description itself. Raises PluginError
        for another value of a name that the plugin has registered."""
        if value is None:
            value = self._skill(named) if kind == "skills" else named
            if value is None:
                return
            if not hasattr(value, "name"):
                remedy = "Call register(name, value, description), or give what has a name, as @task makes it."
                raise PluginError(f"{PREFIX}{kind} registers {reprlib.repr(value)} without a name.", remedy)
            named, description = value.name, value.description
        if not isinstance(named, str) or not _NAME.fullmatch(named):
            message = f"{named!r} is not a valid name for a {noun(kind)}."
            raise PluginError(message, f"Use a name that matches {_NAME.pattern}.")
        item, kept = Registration(named, self.owner, value, description), self.items.setdefault(kind, [])
        other = next((other for other in kept if other.name == named), None)
        if self.choice.drops(item, kind):
            self.unused.setdefault(kind, []).append(item)
        elif other is None:
            kept.append(item)
        elif other.value is not value:
            places = " and ".join(filter(None, map(_written, (other.value, value))))
            message = f"plugin {self.owner!r} registers two {noun(kind)}s named {named!r}"
            raise PluginError(f"{message}{': ' * bool(places)}{places}.", "Rename one of them.")

    def _skill(self, given: object) -> Skill | None:
        """Return the skill, or None for a folder that cannot be read: the plugin's other skills stay in use."""
        from humanclaw.skills.contract import Skill

        if isinstance(given, Skill):
            return given
        if not isinstance(given, Path):
            message = f"register() takes a Skill or a folder; got {type(given).__name__}."
            raise PluginError(message, "Decorate it with @skill.")
        try:
            return Skill.from_folder(given)
        except Exception as error:
            self._disable(given.name, given, str(error) if isinstance(error, PluginError) else in_words(error))
            return None

    def _disable(self, name: str, value: Skill | Path, reason: str) -> None:
        self.disabled[name] = reason
        self.unused.setdefault("skills", []).append(Registration(name, self.owner, value))

    def disable_faulty_skills(self, measures: Mapping[str, Measure], priors: Mapping[str, Path]) -> None:
        """Check each skill against the contract, and take out those that break it."""
        from humanclaw.skills.checks import skill_faults

        for item in self.items["skills"][:]:
            if faults := skill_faults(item.value, measures, priors):
                self._disable(item.name, item.value, " ".join(map(str, faults)))
                self.items["skills"].remove(item)


def _written(value: Any) -> str:
    """Return the function that a value is or wraps, with its file and line; empty if it is none."""
    code = getattr(inspect.unwrap(value), "__code__", None)
    return f"{code.co_qualname} ({code.co_filename}, line {code.co_firstlineno})" if code else ""


# -- modules of plugins ------------------------------------------------------------------------------------------------
def installed() -> list[tuple[PluginInfo, Sequence[importlib.metadata.EntryPoint]]]:
    """Return the distributions with plugins, the core first, and their entry points.

    A distribution whose metadata cannot be read may have plugins too. It comes with an error and without entry points.
    """
    plugins: dict[str, tuple[PluginInfo, Sequence[importlib.metadata.EntryPoint]]] = {}
    for dist in importlib.metadata.distributions():
        try:
            every = dist.entry_points  # Read once: each access reads and parses the file anew.
            if not every and (outside := _OUTSIDE.search(dist.read_text("entry_points.txt") or "")):
                line = outside[0].strip()[:60]
                raise ValueError(f"entry_points.txt must begin with a group, as [{hookspecs.PROJECT}], not {line!r}")
            if wrong := [group for group in every.groups if group.strip().lower() == hookspecs.PROJECT != group]:
                raise ValueError(f"entry_points.txt has the group [{wrong[0]}] instead of [{hookspecs.PROJECT}]")
            if not (points := tuple(every.select(group=hookspecs.PROJECT))):
                continue
            info = _info(dist)
        except Exception as error:
            folder = Path(str(getattr(dist, "_path", "unknown")))  # Nothing else names it without its metadata.
            name = canonicalize_name(folder.stem.partition("-")[0])
            odd = "a line of entry_points.txt is not as in name = module"  # Python's own error does not say so.
            reason = odd if isinstance(error, TypeError) else in_words(error)
            info = PluginInfo(name, "", name, error=f"{folder} cannot be read: {reason}. Reinstall it")
            points = ()
        plugins.setdefault(info.name, (info, () if info.error else points))
    return sorted(plugins.values(), key=lambda pair: (pair[0].name != hookspecs.PROJECT, pair[0].name))


def _info(dist: importlib.metadata.Distribution) -> PluginInfo:
    """Return a distribution's name and version, with an error if it requires another version of humanclaw."""
    metadata = dist.metadata  # Read once: each access reads and parses the file anew.
    name, version, ours = metadata["Name"], metadata["Version"], distributions.version()
    if not name:  # An interrupted pip leaves no metadata.
        raise ValueError("METADATA names no distribution")
    for text in filter(_OURS.match, metadata.get_all("Requires-Dist") or ()):
        if ours not in (wanted := Requirement(text).specifier):
            message = f"{name} {version} needs humanclaw{wanted}, this is {ours}. Upgrade {name} and humanclaw"
            return PluginInfo(name, version, name, error=message)
    return PluginInfo(name, version, name)


def _load(info: PluginInfo, point: importlib.metadata.EntryPoint) -> tuple[ModuleType, bool]:
    """Import a plugin's module, and tell whether others may need it."""
    module = _module(point)
    return module, any(hasattr(module, hook) for hook in _EARLY)


def _module(point: importlib.metadata.EntryPoint) -> ModuleType:
    if not point.pattern.match(point.value):
        message = f"its entry point {point.name!r} names {point.value!r}, which is no module."
        raise PluginError(message, f"Write {point.name} = its_module into its entry points.")
    module: ModuleType = point.load()
    return module


class Modules:
    """The modules of the installed plugins, without what they register: enough to list commands, in a tenth of a
    second less than a host needs."""

    def tell(self, hook: str, **event: Any) -> None:
        """Call a hook of every plugin that has it, the core's first. A plugin that fails is logged and skipped. What
        plugins print goes to stderr."""
        for info, points in installed():
            if info.error:
                _LOG.warning("plugin %r is left out: %s", info.name, info.error)
                # Pydantic looks for plugins of its own among the same entry points, and fails at what it cannot read.
                os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
            for point in points:
                try:
                    with redirect_stdout(sys.stderr):
                        _tell(point, hook, event)
                except KeyboardInterrupt:
                    raise
                except BaseException as error:  # Third-party code: not even its SystemExit may end the program.
                    _LOG.warning("plugin %r failed at %s: %s", info.name, hook, in_words(error))


def _tell(point: importlib.metadata.EntryPoint, hook: str, event: Mapping[str, Any]) -> None:
    manager = pluggy.PluginManager(hookspecs.PROJECT)
    manager.add_hookspecs(hookspecs)
    module = _module(point)
    if hasattr(module, hook):
        check_api(getattr(module, "HUMANCLAW_API", hookspecs.API_VERSION), point.name)
        manager.register(module)
        getattr(manager.hook, hook)(**event)


def check_api(made_for: object, name: str) -> None:
    """Check the plugin API that a plugin was made for: it needs the host's major version, and no later minor.

    Raises PluginError, which says whether to upgrade the plugin or the host.
    """
    try:
        major, minor = map(int, str(made_for).split("."))
    except ValueError:
        message = f"plugin {name!r} was made for plugin API {made_for!r}, expected major.minor."
        raise PluginError(message, f'Set HUMANCLAW_API = "{hookspecs.API_VERSION}".') from None
    ours = tuple(map(int, hookspecs.API_VERSION.split(".")))
    if major != ours[0] or minor > ours[1]:
        newer = "humanclaw" if (major, minor) > ours else name
        message = f"plugin {name!r} was made for plugin API {made_for}, this is {hookspecs.API_VERSION}."
        raise PluginError(message, f"Upgrade {newer}.")


def load_file(path: Path) -> ModuleType:
    """Import one Python file, or a package in a folder, as a plugin module. Raises PluginError if it is missing or
    fails.

    A package keeps its name, so that it can import its own modules, relatively or not.
    """
    path = package_in(path)
    file, name = path, f"humanclaw_plugin_{path.stem}"
    if path.is_dir():
        file, name = path / "__init__.py", path.resolve().name
    if not file.is_file():
        raise PluginError(f"there is no plugin file {file}.", "Give the path of a Python file, or of a package.")
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        raise PluginError(f"{path} is not a Python file.", "Give the path of a file that ends in .py.")
    if path.is_dir() and name in sys.modules and not is_from(sys.modules[name], file):
        raise PluginError(f"a package {name!r} is loaded already, from elsewhere.", "Rename the folder.")
    module = importlib.util.module_from_spec(spec)
    try:
        if path.is_dir():
            sys.modules[name] = module
        spec.loader.exec_module(module)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        if path.is_dir():
            sys.modules.pop(name, None)
        raise _unloadable(path, file, error) from error
    return module


def _unloadable(path: Path, file: Path, error: BaseException) -> PluginError:
    """Return why a plugin file failed to load, and the line."""
    written = str(file.absolute())
    lines = [line for frame, line in walk_tb(error.__traceback__) if frame.f_code.co_filename == written]
    where = f"plugin file {path}, line {lines[-1]}" if lines else f"plugin file {path}"
    if isinstance(error, HumanclawError):
        return PluginError(f"{where}: {error.message}", error.remedy)
    remedy = f"Run `python {path}` to see the whole traceback, and mend it."
    return PluginError(f"{where} failed to load: {_reason(error)}.", remedy)


def _reason(error: BaseException) -> str:
    """Return type and message of an error; of a record's the first field that is wrong, with the nearest name."""
    from pydantic import ValidationError

    from humanclaw.records import specification

    if not isinstance(error, ValidationError):
        return in_words(error).rstrip(".")
    model = getattr(specification, error.title, None)
    return f"{error.title}: {first_fault(error, getattr(model, 'model_fields', ()))}"


def package_in(path: Path) -> Path:
    """Return the package in the folder of a distribution, which is what people give; any other path as it is."""
    path = path if path.name else path.resolve()  # The current folder has no name.
    packages = [file.parent for file in path.glob("humanclaw_*/__init__.py")] if path.is_dir() else []
    return packages[0] if len(packages) == 1 and not (path / "__init__.py").is_file() else path


def is_from(module: object, file: Path) -> bool:
    """Return whether an object is the module of a file."""
    return isinstance(module, ModuleType) and Path(vars(module).get("__file__") or "").resolve() == file.resolve()
