"""Whether the motion of a trained skill follows its commands: a gate of quality, in seconds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

import numpy as np

from humanclaw.body.pose import HISTORY, Array, Motion, Pose2D
from humanclaw.checks.playing import Bench
from humanclaw.errors import CheckpointError, ContractError
from humanclaw.motion.checkpoint import load_adapter, load_base, read_header, shipped_base
from humanclaw.motion.generator import DiTGenerator
from humanclaw.motion.protocol import MotionGenerator
from humanclaw.skills.contract import Skill
from humanclaw.skills.measures import Measure, Parameter, find, from_si
from humanclaw.skills.regression import Regression

_RUNS: Final = 8
_CALLS: Final = 3
"""Number of bodies that set out from standing, and of calls in a row of each."""


def following_faults(skill: Skill, followed: Mapping[Parameter, Regression]) -> Iterator[ContractError]:
    """Yield each parameter that an adapter follows no better than a constant would."""
    for parameter, regression in followed.items():
        if parameter.low < parameter.high and not regression.follows:
            yield ContractError("follows", _told(skill, parameter, regression), "Train it longer, or on more clips.")


def followed(skill: Skill, bench: Bench) -> dict[Parameter, Regression]:
    """Measure how a trained skill follows each parameter; empty without parameters, adapter or prior."""
    if skill.adapter is None or not skill.adapter.is_file() or not skill.parameters:
        return {}
    prior = _prior(skill, bench)
    if prior is None:
        return {}
    generator = DiTGenerator.load(prior)
    commands, achieved = _rolled(skill, generator, bench.measures, bench.seed)
    return {parameter: Regression.of(commands[:, k], achieved[:, k]) for k, parameter in enumerate(skill.parameters)}


def _told(skill: Skill, parameter: Parameter, regression: Regression) -> str:
    error, constant = (from_si(parameter.key, value) for value in (regression.error, regression.constant))
    unit = "degrees" if parameter.key.endswith("_deg") else "cm"
    return (
        f"skill {skill.name!r} misses {parameter.key} by {error:.1f} {unit} on average; a constant misses it by "
        f"{constant:.1f} {unit} (slope {regression.slope:.2f}, R squared {regression.r2:.2f})."
    )


def weight_faults(skill: Skill, bench: Bench) -> Iterator[ContractError]:
    """Yield a fault for weights that are no finite floats, or do not have the shapes that the adapter's prior needs."""
    prior = _prior(skill, bench)
    if skill.adapter is not None and prior is not None:
        try:
            load_adapter(skill.adapter, load_base(prior))
        except CheckpointError as error:
            yield ContractError("adapter-weights", error.message, error.remedy)


def _prior(skill: Skill, bench: Bench) -> Path | None:
    """Return the prior of a skill's adapter; None if it is not installed."""
    base = str(read_header(skill.adapter)["base"]) if skill.adapter else ""
    shipped = {str(read_header(shipped_base())["digest"]): shipped_base()}
    return {**shipped, **bench.plugins.priors}.get(base)


def _rolled(
    skill: Skill, generator: MotionGenerator, measures: Mapping[str, Measure], seed: int
) -> tuple[Array, Array]:
    """Return commands and what was achieved, (N, parameters) each, SI."""
    assert skill.adapter is not None
    random = np.random.default_rng(seed)
    low, high = (np.array([getattr(part, end) for part in skill.parameters]) for end in ("low", "high"))
    commands = random.uniform(low, high, (_RUNS, _CALLS, len(low)))
    chunks = []
    for run in range(_RUNS):
        history = generator.start()
        for call in range(_CALLS):
            values = {part.name: float(x) for part, x in zip(skill.parameters, commands[run, call], strict=True)}
            motion = generator.generate(history, skill.adapter, values, (seed, run, call))
            chunks.append(Pose2D.of_history(history).to_local(history.then(motion)))
            history = motion[-HISTORY:]
    return commands.reshape(-1, len(low)), _measured(skill, chunks, measures)


def _measured(skill: Skill, chunks: list[Motion], measures: Mapping[str, Measure]) -> Array:
    root, rotations = np.stack([part.root for part in chunks]), np.stack([part.rotations for part in chunks])
    return np.stack([find(part, measures)(root, rotations) for part in skill.parameters], -1)
