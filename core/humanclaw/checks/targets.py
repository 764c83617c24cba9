"""Find the skills to examine: by name, in a folder, or in a Python file."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from humanclaw.checks.plugins import check_plugin
from humanclaw.checks.skills import Report, examine
from humanclaw.errors import ContractError, PluginError, in_words
from humanclaw.plugins.bounded import Bounded, OverdueError
from humanclaw.plugins.choice import is_owner
from humanclaw.plugins.hookspecs import API_VERSION
from humanclaw.plugins.host import Plugins, check_api, load_file
from humanclaw.skills.contract import Skill
from humanclaw.skills.measures import Measure

LOADING: Final = 30.0
"""Seconds that importing a file and asking its hooks may take."""


def found_at(
    target: str, plugins: Plugins, patience: float = LOADING
) -> tuple[list[Skill | Path], dict[str, Measure], list[ContractError]]:
    """Return the skills of a target, the measures that come with them, and the faults that kept skills from loading.

    Args:
        target: name of an installed skill (owner:skill if two plugins have it), a folder of one or more skills, or a
            Python file with a hook humanclaw_skills.
        patience: seconds that importing the file may take.

    Raises PluginError for an unknown name.
    """
    path = Path(target)
    if path.suffix == ".py" or path.is_file():
        return _in_file(path.parent if path.name == "schema.json" else path, patience)
    if path.is_dir():
        return _in_file(path, patience)
    return [plugins.offered("skills", target)], {}, []


def check_target(target: str, plugins: Plugins, **options: Any) -> list[Report]:
    """Examine every skill of a target (see found_at). options: those of examine. Raises PluginError for an unknown
    name."""
    if plugin := _other_plugin(target, plugins):
        return plugin
    skills, measures, faults = found_at(target, plugins)
    known = {**plugins.measures, **measures}
    reports = [examine(one, known, plugins=plugins, **options) for one in skills]
    faulty = bool(faults) or any(one.faults for one in reports)
    unreadable = [Report(target, tuple(faults))] if faults else []
    return [*reports, *unreadable, *_beside_skills(target, plugins, faulty)]


def _other_plugin(target: str, plugins: Plugins) -> list[Report]:
    """Check an installed plugin by its name, or a file without skills; empty for any other target."""
    if Path(target).exists() or target.endswith(".py"):
        return []
    owners = [info.name for info in plugins.infos if not info.error and is_owner(target, info.name)]
    if target in plugins.skills or not owners:
        return []
    skills = [examine(one.value, plugins.measures, plugins=plugins) for one in plugins.of_owner(owners[0], "skills")]
    return [*skills, *check_plugin(owners[0], plugins.plugin(owners[0]), plugins)]


def _beside_skills(target: str, plugins: Plugins, faulty: bool) -> list[Report]:
    """Check what a file or a package registers besides skills. faulty: whether its skills have told why it fails."""
    path = Path(target)
    if not (path.is_file() and path.suffix == ".py") and not (path / "__init__.py").is_file():
        return []
    host = Plugins.discover([], plugins.choice)
    try:
        module = load_file(path)
        host.add(module, path.stem)
    except PluginError as error:
        fault = ContractError("loads", error.message, error.remedy or "Mend the file.")
        return [] if faulty else [Report(target, (fault,))]
    return check_plugin(path.stem, module, host)


def _in_file(
    path: Path, patience: float = LOADING
) -> tuple[list[Skill | Path], dict[str, Measure], list[ContractError]]:
    if path.is_dir():
        folders = sorted(one.parent for one in path.rglob("schema.json"))
        if folders or not (path / "__init__.py").is_file():
            return [*(folders or [path])], {}, []
    try:
        return Bounded(patience)(partial(_loaded, path))
    except OverdueError as error:
        return [], {}, [ContractError("loads", f"plugin file {path}: {error}.", "Move slow work out of the import.")]
    except ContractError as error:
        return [], {}, [error]
    except PluginError as error:
        cause = error.__cause__
        fault = (
            cause
            if isinstance(cause, ContractError)
            else ContractError("loads", error.message, error.remedy or "Mend the file.")
        )
        return [], {}, [fault]


def _loaded(path: Path) -> tuple[list[Skill | Path], dict[str, Measure], list[ContractError]]:
    module = load_file(path)
    check_api(getattr(module, "HUMANCLAW_API", API_VERSION), path.stem)
    return _registered(module)


def _registered(module: ModuleType) -> tuple[list[Skill | Path], dict[str, Measure], list[ContractError]]:
    """Return the registrations of a plugin's module, and faults."""
    skills: list[Skill | Path] = []
    measures: list[Measure] = []
    for hook, found in (("humanclaw_skills", skills), ("humanclaw_measures", measures)):
        try:
            getattr(module, hook, lambda register: None)(register=found.append)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # As the plugin host does: not even SystemExit ends the program.
            message = f"{module.__name__} raises {in_words(error)} in {hook}."
            return [], {}, [ContractError("loads", message, "Mend the hook.")]
    if not skills and any(name.startswith("humanclaw_") for name in vars(module)):
        return [], {one.name: one for one in measures}, []
    odd = [one for one in skills if not isinstance(one, Skill | Path)]
    if odd or not skills:
        message = f"register() got {odd[0]!r}." if odd else f"{module.__name__} registers no skill."
        remedy = "Register a Skill or its folder in a hook: @hookimpl def humanclaw_skills(register): register(...)."
        return [], {}, [ContractError("loads", message, remedy)]
    return skills, {one.name: one for one in measures}, []
