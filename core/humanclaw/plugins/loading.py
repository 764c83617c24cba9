"""Load plugins from entry points and files, and check the versions that they were made for."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import logging
import re
import sys
from collections.abc import Mapping
from contextlib import redirect_stdout
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import pluggy
from packaging.requirements import Requirement

from humanclaw.errors import PluginError, in_words
from humanclaw.plugins import hookspecs
from humanclaw.plugins.choice import PluginInfo
from humanclaw.plugins.distributions import version

_LOG: Final = logging.getLogger(__name__)
_OURS: Final = re.compile(r"humanclaw(?![\w.-])", re.IGNORECASE)
"""A requirement of the core itself; of a hundred others the name is not worth parsing."""
PATIENCE: Final = 30.0
"""Seconds that an observer or a metric may take by default; a plugin sets others in HUMANCLAW_PATIENCE."""


def check_api(made_for: object, name: str) -> None:
    """Check the plugin API that a plugin was made for: it needs the host's major version, and no later minor.

    Raises PluginError, which says whether to upgrade the plugin or the host.
    """
    try:
        major, minor = map(int, str(made_for).split("."))
    except ValueError:
        told = f"plugin {name!r} was made for plugin API {made_for!r}, expected major.minor."
        raise PluginError(told, f'Set HUMANCLAW_API = "{hookspecs.API_VERSION}".') from None
    ours = tuple(map(int, hookspecs.API_VERSION.split(".")))
    if major != ours[0] or minor > ours[1]:
        newer = "humanclaw" if (major, minor) > ours else name
        told = f"plugin {name!r} was made for plugin API {made_for}, this is {hookspecs.API_VERSION}."
        raise PluginError(told, f"Upgrade {newer}.")


def check_patience(seconds: object, name: str) -> None:
    """Raise PluginError if HUMANCLAW_PATIENCE is not a positive number."""
    if isinstance(seconds, bool) or not isinstance(seconds, int | float) or not seconds > 0:
        told = f"plugin {name!r} has HUMANCLAW_PATIENCE = {seconds!r}, expected seconds above 0."
        raise PluginError(told, 'Write one, such as 60.0, or float("inf").')


def origin_of(point: importlib.metadata.EntryPoint) -> PluginInfo:
    """Return where a plugin is from. The distribution names it: entry points of two distributions may have the same
    name. Reads its metadata anew at each call."""
    # An interrupted pip leaves no metadata: the standard library then returns None for both.
    try:
        told = point.dist and point.dist.metadata  # Read once: name and version would each read it anew.
        name, version = (told["Name"], told["Version"]) if told else ("", "")
    except (TypeError, FileNotFoundError):  # importlib_metadata, which litellm brings, raises instead.
        name, version = "", ""
    return PluginInfo(name or point.name, version or "", name or "")


class Modules:
    """The modules of the installed plugins, without what they register: enough to list commands, in a tenth of a
    second less than a host needs."""

    def tell(self, hook: str, **event: Any) -> None:
        """Call a hook of every plugin that has it, the core's first. A plugin that fails is logged and skipped. What
        plugins print goes to stderr."""
        points = importlib.metadata.entry_points(group=hookspecs.PROJECT)
        found = [(origin_of(point), point) for point in points]
        for info, point in sorted(found, key=lambda pair: (pair[0].origin != hookspecs.PROJECT, pair[0].name)):
            try:
                with redirect_stdout(sys.stderr):
                    _tell(point, hook, event)
            except KeyboardInterrupt:
                raise
            except BaseException as error:  # Third-party code: not even its SystemExit may end the program.
                _LOG.warning("plugin %r failed at %s: %s", info.name, hook, reason_of(error))


def _tell(point: importlib.metadata.EntryPoint, hook: str, event: Mapping[str, Any]) -> None:
    manager = pluggy.PluginManager(hookspecs.PROJECT)
    manager.add_hookspecs(hookspecs)
    module = held_to_requirements(point).load()
    if has_hook(module, hook):
        check_api(getattr(module, "HUMANCLAW_API", hookspecs.API_VERSION), point.name)
        manager.register(module)
        getattr(manager.hook, hook)(**event)


def has_hook(plugin: object, hook: str) -> bool:
    """Whether a plugin has a hook. A module with a `__getattr__` of its own may raise anything."""
    try:
        return hasattr(plugin, hook)
    except KeyboardInterrupt:
        raise
    except BaseException:
        return False


def held_to_requirements(point: importlib.metadata.EntryPoint) -> importlib.metadata.EntryPoint:
    if point.dist:
        _check_requirement(point.dist)
    return point


def _check_requirement(dist: importlib.metadata.Distribution) -> None:
    """Raise PluginError if the distribution's metadata require another version of humanclaw."""
    for text in filter(_OURS.match, dist.requires or ()):
        if version() not in (wanted := Requirement(text).specifier):
            raise PluginError(
                f"{dist.name} {dist.version} needs humanclaw{wanted}, this is {version()}.",
                f"Upgrade {dist.name} and humanclaw.",
            )


def reason_of(error: BaseException) -> str:
    """Return an error in words; of pluggy's validation errors only their message."""
    if isinstance(error, pluggy.PluginValidationError):
        return " ".join(str(error.args[0]).split())
    return in_words(error)


def load_file(path: Path) -> ModuleType:
    """Import one Python file, or a package in a folder, as a plugin module. Raises PluginError if it is missing or
    fails.

    A package keeps its name, so that it can import its own modules, relatively or not.
    """
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
        raise PluginError(f"plugin file {path} failed to load: {reason_of(error)}.") from error
    return module


def is_from(module: object, file: Path) -> bool:
    """Return whether an object is the module of a file."""
    return isinstance(module, ModuleType) and Path(vars(module).get("__file__") or "").resolve() == file.resolve()
