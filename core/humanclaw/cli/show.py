"""Commands that list: skills, plugins, tools."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final, get_args

import click
from rich.table import Table

from humanclaw.cli.options import plugin_options
from humanclaw.cli.terminal import Console
from humanclaw.plugins import distributions
from humanclaw.plugins.choice import Choice, PluginInfo
from humanclaw.plugins.hookspecs import noun
from humanclaw.plugins.host import Plugins
from humanclaw.skills.contract import Skill, values
from humanclaw.skills.tool_schemas import Format, tool_list

_WRAPPED: Final = ("parameters", "provides", "state")
"""Columns with long cells. The others hold names, which are never wrapped."""


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@plugin_options
def skills(as_json: bool, files: tuple[Path, ...], choice: Choice) -> None:
    """List the skills: parameters, adapter, where they come from."""
    plugins = Plugins.discover(files, choice)
    rows = [_skill_row(skill, plugins) for skill in sorted(plugins.skills.values(), key=lambda skill: skill.name)]
    rows += [_disabled_row(name, info) for info in plugins.infos for name in info.disabled]
    nothing = "" if rows else f"No skill is installed. Run `{distributions.install(['humanclaw-skill-walk'])}`."
    _print(rows, as_json, ("skill", "parameters", "from", "state"), nothing)


@click.command("plugins")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@plugin_options
def plugins_command(as_json: bool, files: tuple[Path, ...], choice: Choice) -> None:
    """List the plugins: what each provides, and how to get others."""
    infos = Plugins.discover(files, choice).infos
    rows = [_plugin_row(info) for info in infos]
    missing = sorted(distributions.own() - {info.origin for info in infos})
    rows += [_missing_row(name) for name in missing]
    _print(rows, as_json, ("plugin", "version", "provides", "state"), "No plugin is installed.")
    for name in missing if not as_json else ():
        click.echo(f"{name}: {distributions.install([name])}")


@click.command()
@click.option(
    "--format",
    "form",
    type=click.Choice(get_args(Format)),
    default="openai",
    show_default=True,
    help="Whose interface: the tools of a request, or for mcp the result of tools/list.",
)
@click.option(
    "--reasoning/--no-reasoning",
    default=None,
    help="With the fields that a model must say around a call, or without. The default is with; for mcp without.",
)
@plugin_options
def tools(form: Format, reasoning: bool | None, files: tuple[Path, ...], choice: Choice) -> None:
    """Print the skills as the tool list of a model's interface."""
    plugins = Plugins.discover(files, choice)
    ready = [skill for skill in plugins.skills.values() if skill.trained]
    listed = tool_list(ready, form, reasoning=form != "mcp" if reasoning is None else reasoning)
    click.echo(json.dumps({"tools": listed} if form == "mcp" else listed, indent=2, ensure_ascii=False))


def _skill_row(skill: Skill, plugins: Plugins) -> dict[str, str]:
    info = plugins.info(plugins.owner(skill.name))
    return {
        "skill": skill.name,
        "role": skill.role,
        "parameters": _parameters(skill),
        "checks": str(len(skill.checks)),
        "from": _source(info),
        "state": _state(skill) + _over(plugins.overridden(skill.name)),
    }


def _over(others: Sequence[str]) -> str:
    return f", before that of {', '.join(others)}" if others else ""


def _disabled_row(name: str, info: PluginInfo) -> dict[str, str]:
    unknown = dict.fromkeys(("role", "parameters", "checks"), "")
    return {"skill": name, **unknown, "from": _source(info), "state": f"disabled: {info.disabled[name]}"}


def _source(info: PluginInfo) -> str:
    return f"{info.origin or info.name} {info.version}".strip()


def _parameters(skill: Skill) -> str:
    parts = skill.schema.get("properties", {})
    return ", ".join(f"{key} {values(part)}".strip() for key, part in parts.items()) or "none"


def _state(skill: Skill) -> str:
    if skill.adapter is None:
        return "ready (keyframes)"
    return "ready (adapter)" if skill.trained else "adapter still to be trained"


def _plugin_row(info: PluginInfo) -> dict[str, str]:
    lost = [f"skill {name} disabled: {reason}" for name, reason in info.disabled.items()]
    lost += [*info.duplicates, *info.notes]
    return {
        "plugin": info.name,
        "version": info.version,
        "from": info.origin,
        "provides": "\n".join(info.provides),
        "state": f"disabled: {info.error}" if info.error else "; ".join(["in use", *lost]),
    }


def _missing_row(distribution: str) -> dict[str, str]:
    kinds = distributions.table().items()
    brings = [f"{noun(kind)} {name}" for kind, names in kinds for name, of in names.items() if of == distribution]
    state = f"not installed: {distributions.install([distribution])}"
    return {"plugin": distribution, "version": "", "from": "", "provides": "\n".join(brings), "state": state}


def _print(rows: list[dict[str, str]], as_json: bool, shown: Sequence[str], nothing: str) -> None:
    """Print everything as JSON, or the columns that fit into 80 characters as a table."""
    if as_json:
        click.echo(json.dumps(rows, indent=2, ensure_ascii=False))
        return
    if not rows:
        click.echo(nothing)
        return
    table = Table(box=None, header_style="bold", pad_edge=False)
    for key in shown:
        table.add_column(key, overflow="fold", no_wrap=key not in _WRAPPED)
    for row in rows:
        table.add_row(*(_BRIEF.get(key, str)(row[key]) for key in shown))
    Console(markup=False, emoji=False).print(table)


def _by_kind(provided: str) -> str:
    """Group lines by kind: "agent oracle" and "agent random" become "agent oracle, random"."""
    kinds: dict[str, list[str]] = {}
    for line in provided.splitlines():
        kind, _, name = line.rpartition(" ")
        kinds.setdefault(kind, []).append(name)
    return "\n".join(f"{kind} {', '.join(names)}".strip() for kind, names in kinds.items())


_BRIEF: Final[Mapping[str, Callable[[str], str]]] = {
    "from": lambda source: source.partition(" ")[0],  # Without the version.
    "provides": _by_kind,
    "state": lambda state: state.partition(": pip ")[0],  # Without the command that installs it.
}
"""Short forms of cells that would make a table wider than 80 characters."""
