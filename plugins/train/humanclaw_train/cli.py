"""Commands of this distribution. Most forward their arguments to a module's main, which parses its own options."""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from humanclaw import Body, CallError, Choice, HumanclawError, Plugins, Scene, Simulator, Skill, default_simulator
from humanclaw.cli import plugin_options, seed_option
from humanclaw.skills import Measure

# No help option of its own: --help goes to the module, which defines the options.
_FORWARD = {"ignore_unknown_options": True, "allow_extra_args": True, "help_option_names": []}


def _forward(name: str, module: str, explanation: str, **given: Any) -> click.Command:
    """Return a command that forwards its arguments to a module's main. given: keyword arguments of that main.

    Only the module defines options, because it also runs without click.
    """

    @click.command(name, context_settings=_FORWARD, help=explanation, short_help=explanation)
    @click.argument("args", nargs=-1, type=click.UNPROCESSED)
    def command(args: tuple[str, ...]) -> None:
        sys.exit(importlib.import_module(module).main(list(args), **given))

    return command


def _simulator(name: str = "") -> Simulator:
    """Make a simulator, or that which episodes run in. Modules get it as an argument, as they know no plugin host."""
    plugins = Plugins.discover()
    simulator: Simulator = plugins.make("simulators", name or default_simulator(plugins), profile="default")
    return simulator


def _place(scene: Scene, seed: int) -> Body:
    """Put a body with the installed skills into a scene."""
    return Body(scene, seed=seed)


def _installed() -> dict[str, Path]:
    """Return the adapters of the installed skills."""
    skills = Plugins.discover().skills.values()
    return {skill.name: skill.adapter for skill in skills if skill.adapter is not None and skill.trained}


def _measures() -> Mapping[str, Measure]:
    """Return the measures that parameters may command, those of plugins included."""
    return Plugins.discover().measures


train = _forward("train", "humanclaw_train.train", "Train the base prior or a skill's adapter.")
fidelity = _forward(
    "fidelity",
    "humanclaw_train.eval.fidelity",
    "Measure how well each skill follows its parameters.",
    simulator=_simulator,
    installed=_installed,
    measures=_measures,
)
naturalness = _forward(
    "naturalness",
    "humanclaw_train.eval.naturalness",
    "Compare generated motion with human motion.",
    installed=_installed,
    commanded=_measures,
    seat=_place,
    simulator=_simulator,
)
speed = _forward(
    "speed", "humanclaw_train.eval.speed", "Time the motion model with several solvers and runtimes.", skills=_installed
)
cards = _forward("cards", "humanclaw_train.cards", "Write the model card beside each checkpoint.", installed=_installed)


@click.group()
def data() -> None:
    """Build training data from motion capture."""


def _trained() -> object:
    """Return the skills that have a recipe."""
    return importlib.import_module("humanclaw_train.synthesis.commands").trained(Plugins.discover())


data.add_command(
    _forward("build", "humanclaw_train.data.build", "Build the training chunks from motion capture.", skills=_trained)
)
data.add_command(
    _forward(
        "chunks",
        "humanclaw_train.data.custom_skill",
        "Make the chunks of a skill of your own from a folder of motion.",
        measures=_measures,
    )
)


@click.group()
def show() -> None:
    """Draw the motion of a skill as a strip and a GIF."""


@show.command("skill", context_settings={"ignore_unknown_options": True, "allow_extra_args": True})
@click.argument("name")
@click.option("--calls", type=click.IntRange(1, 100), default=6, show_default=True, help="Number of calls in a row.")
@seed_option(help="Seed of the motion.")
@click.option(
    "--beside",
    type=click.Path(path_type=Path),
    metavar="MOCAP",
    help="Folder with clips.csv: also draw the most similar person.",
)
@click.option(
    "--out", type=click.Path(path_type=Path), help="GIF file (default: NAME.gif). A strip (PNG) is written beside it."
)
@click.option("--renderer", default="raster", show_default=True, help="Name of the renderer.")
@plugin_options
@click.pass_context
def _skill(
    context: click.Context,
    name: str,
    calls: int,
    seed: int,
    beside: Path | None,
    out: Path | None,
    renderer: str,
    files: tuple[Path, ...],
    choice: Choice,
) -> None:
    """Draw a skill. Every parameter of the skill is an option: `humanclaw show skill walk --z-cm 40`."""
    looking = importlib.import_module("humanclaw_train.eval.show")
    plugins = Plugins.discover(files, choice=choice)
    params = _params(plugins.skill(name), context.args)
    wanted = out or Path(f"{name.split(':')[-1]}.gif")
    for path in looking.show(plugins, name, params, calls, seed, beside, wanted, renderer):
        click.echo(path)


def _params(skill: Skill, words: list[str]) -> dict[str, Any]:
    """Parse `--z-cm 40` or `--z-cm=40` as parameters of a skill and check them against its schema.

    Raises HumanclawError for anything else.
    """
    flat = [part for word in words for part in (word.split("=", 1) if word.startswith("--") else [word])]
    keys = [word.removeprefix("--").replace("-", "_") for word in flat[::2]]
    if len(flat) % 2 or not all(word.startswith("--") for word in flat[::2]):
        hint = ", ".join(f"--{one.key.replace('_', '-')} NUMBER" for one in skill.parameters)
        raise HumanclawError(f"{' '.join(words)} are no options of {skill.name}.", f"It takes: {hint or 'none'}.")
    try:
        return skill.check({key: _read(value) for key, value in zip(keys, flat[1::2], strict=True)})
    except CallError as error:
        raise HumanclawError(str(error)) from error


def _read(value: str) -> Any:
    """Read a value as JSON, or else as text."""
    try:
        return json.loads(value)
    except ValueError:
        return value
