"""`humanclaw train`, `humanclaw fidelity` and `humanclaw data build`: doors to humanclaw.training, which reads its own options.

The modules also run as `python -m humanclaw.training.train` on a machine that has torch and little else.
"""

from __future__ import annotations

import importlib
import sys

import click

_FORWARD = {"ignore_unknown_options": True, "allow_extra_args": True, "help_option_names": []}


def _forward(name: str, module: str, explanation: str) -> click.Command:
    """A command that hands its arguments on, so that the options are told in one place."""

    @click.command(name, context_settings=_FORWARD, help=explanation, short_help=explanation)
    @click.argument("args", nargs=-1, type=click.UNPROCESSED)
    def command(args: tuple[str, ...]) -> None:
        sys.exit(importlib.import_module(module).main(list(args)))

    return command


train = _forward("train", "humanclaw.training.train", "Train the base prior or a skill's adapter.")
fidelity = _forward("fidelity", "humanclaw.training.fidelity", "Measure achieved against commanded motion, per skill.")


@click.group()
def data() -> None:
    """Training data."""


data.add_command(_forward("build", "humanclaw.training.build", "Build the training chunks from motion capture."))
