"""Hooks of this distribution. A module of its own, because the package must import without a plugin host."""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanclaw import hookimpl

if TYPE_CHECKING:
    from pathlib import Path

    import click

    from humanclaw.motion import MotionGenerator
    from humanclaw.plugins import GeneratorFactory, Register


@hookimpl
def humanclaw_motion_generators(register: Register[GeneratorFactory]) -> None:
    register("torch", _torch, "the same model as dit on PyTorch: on a GPU if there is one")


def _torch(profile: str = "default", prior: Path | None = None) -> MotionGenerator:
    from humanclaw_train.model.generator import torch_generator

    return torch_generator(profile, prior)


@hookimpl
def humanclaw_commands(cli: click.Group) -> None:
    from humanclaw.cli import LazyCommand

    for name, sentence in {
        "train": "Train the base prior or a skill's adapter.",
        "fidelity": "Measure how well each skill follows its parameters.",
        "naturalness": "Compare generated motion with human motion.",
        "cards": "Write the model card beside each checkpoint.",
        "data": "Build training data from motion capture.",
        "figure": "Draw a figure of the paper: 5 shows skills, 6 half-physics.",
    }.items():
        cli.add_command(LazyCommand(name, f"humanclaw_train.cli:{name}", sentence))
