"""`humanclaw train`, `humanclaw fidelity` and `humanclaw data build`: doors to humanclaw_train, which reads its own
options.

The modules also run as `python -m humanclaw_train.train` on a machine that has torch and little else.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from humanclaw import Plugins, default_simulator
from humanclaw.measures import Measure

_FORWARD = {"ignore_unknown_options": True, "allow_extra_args": True, "help_option_names": []}


def _forward(name: str, module: str, explanation: str, **given: Any) -> click.Command:
    """Return a command that hands its arguments on, so that the options are told in one place; given: what else its
    main is given."""

    @click.command(name, context_settings=_FORWARD, help=explanation, short_help=explanation)
    @click.argument("args", nargs=-1, type=click.UNPROCESSED)
    def command(args: tuple[str, ...]) -> None:
        sys.exit(importlib.import_module(module).main(list(args), **given))

    return command


def _simulator() -> Any:
    """Return the half-physics that episodes run in: training imports no plugin host, so it is handed in."""
    plugins = Plugins.discover()
    return plugins.make("simulators", default_simulator(plugins), profile="default")


def _installed() -> dict[str, Path]:
    """Find the adapters of the installed skills."""
    skills = Plugins.discover().skills.values()
    return {skill.name: skill.adapter for skill in skills if skill.adapter is not None and skill.trained}


def _measures() -> Mapping[str, Measure]:
    """Find what parameters may command, plugins' measures too."""
    return Plugins.discover().measures


train = _forward("train", "humanclaw_train.train", "Train the base prior or a skill's adapter.", measures=_measures)
fidelity = _forward(
    "fidelity",
    "humanclaw_train.fidelity",
    "Measure achieved against commanded motion, per skill.",
    simulator=_simulator,
    installed=_installed,
    measures=_measures,
)
naturalness = _forward(
    "naturalness",
    "humanclaw_train.naturalness",
    "Measure how human the skills' motion and its transitions are.",
    installed=_installed,
    commanded=_measures,
)
speed = _forward(
    "speed",
    "humanclaw_train.speed",
    "Time the motion model under several solvers and runtimes.",
    skills=_installed,
)
cards = _forward("cards", "humanclaw_train.cards", "Write the model card beside each checkpoint.", installed=_installed)


@click.group()
def data() -> None:
    """Training data."""


def _trained() -> Any:
    """Return the skills with a recipe."""
    return importlib.import_module("humanclaw_train.commands").trained(Plugins.discover())


data.add_command(
    _forward("build", "humanclaw_train.build", "Build the training chunks from motion capture.", skills=_trained)
)
data.add_command(
    _forward(
        "chunks",
        "humanclaw_train.own",
        "Make the chunks of a skill of your own from a folder of motion.",
        measures=_measures,
    )
)
