"""Find what to check: a skill or a plugin by name, a folder of skills, a Python file, or a package."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from humanclaw.checks.bounded import OverdueError, bounded
from humanclaw.checks.plugins import check_plugin
from humanclaw.checks.skills import Report, examine
from humanclaw.errors import ContractError, PluginError
from humanclaw.plugins.choice import is_owner
from humanclaw.plugins.host import Plugins, is_from, load_file, package_in
from humanclaw.skills.contract import Skill

LOADING: Final = 30.0
"""Seconds that importing a file and asking its hooks may take."""


def check_target(target: str, plugins: Plugins, loading: float = LOADING, **options: Any) -> list[Report]:
    """Examine every skill of a target, and use whatever else it registers.

    Args:
        target: name of an installed skill (owner:skill if two plugins have it) or plugin, a folder of one or more
            skills, a Python file with hooks, or the folder of a package.
        loading: seconds that importing a file may take.
        options: those of examine.

    Raises PluginError for an unknown name.
    """
    path = package_in(Path(target))
    if path.name == "schema.json":
        path = path.parent
    is_package = (path / "__init__.py").is_file() and not (path / "schema.json").is_file()
    if path.suffix == ".py" or path.is_file() or is_package:
        return _of_module(target, path, plugins, loading, options)
    if path.is_dir():
        folders = sorted(file.parent for file in path.rglob("schema.json")) or [path]
        return [examine(folder, plugins.measures, plugins=plugins, **options) for folder in folders]
    owners = [info.name for info in plugins.infos if not info.error and is_owner(target, info.name)]
    if owners and target not in plugins.skills:
        return _of_plugin(owners[0], plugins, options)
    if path.name != target and ":" not in target:
        raise PluginError(f"there is no file or folder {target}.", "Name one, or a skill or plugin that is installed.")
    return [examine(plugins.offered("skills", target), plugins.measures, plugins=plugins, **options)]


def _of_module(target: str, path: Path, plugins: Plugins, loading: float, options: dict[str, Any]) -> list[Report]:
    """Check a file or a package beside the installed plugins, or as one of them."""
    host = Plugins.discover([], plugins.choice)
    owner = next((info.name for info in host.infos if not info.error and _is_at(info.name, path, host)), path.stem)
    if owner not in {info.name for info in host.infos}:
        try:
            bounded(loading, lambda: host.add(load_file(path), owner, origin=str(path)))
        except OverdueError as error:
            slow = ContractError("loads", f"plugin file {path}: {error}.", "Move slow work out of the import.")
            return [Report(target, (slow,))]
        except PluginError as error:
            return [Report(target, (ContractError("loads", error.message, error.remedy or "Mend the file."),))]
    if not host.hooks(owner) or host.idle_hooks(owner):
        what = "calls register(...) in" if host.hooks(owner) else "has"
        message = f"{path} {what} no hook, so it registers nothing."
        remedy = "Register a Skill or its folder in a hook: @hookimpl def humanclaw_skills(register): register(...)."
        return [Report(target, (ContractError("loads", message, remedy),))]
    return _of_plugin(owner, host, options)


def _is_at(owner: str, path: Path, host: Plugins) -> bool:
    return is_from(host.plugin(owner), path / "__init__.py")


def _of_plugin(owner: str, host: Plugins, options: dict[str, Any]) -> list[Report]:
    """Check all that a plugin in use registers."""

    def check(skill: Skill | Path) -> Report:
        return examine(_folder_of(skill), host.measures, plugins=host, **options)

    skills = [_called(check(item.value), owner, host) for item in host.of_owner(owner, "skills")]
    disabled = [check(host.offered("skills", f"{owner}:{name}")) for name in host.info(owner).disabled]
    return [*skills, *disabled, *check_plugin(owner, host.plugin(owner), host)]


def _folder_of(skill: Skill | Path) -> Skill | Path:
    """Return the folder of a trained skill, whose checklist is checked too."""
    return skill.source if isinstance(skill, Skill) and skill.adapter and skill.source else skill


def _called(report: Report, owner: str, host: Plugins) -> Report:
    """Add a fault if the skill's name means the skill of another plugin."""
    first = host.owner(report.skill)
    if first == owner:
        return report
    message = f"{report.skill!r} is already a skill of plugin {first!r}, so no model gets this one."
    fault = ContractError("name-free", message, f"Rename it, or leave the other out with --without {first}.")
    return replace(report, faults=(*report.faults, fault))
