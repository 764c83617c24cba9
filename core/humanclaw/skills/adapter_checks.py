"""Checks of an adapter against the schema of its skill."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from humanclaw.errors import CheckpointError, ContractError
from humanclaw.motion.checkpoint import adapters_beside, read_header
from humanclaw.skills.contract import Skill
from humanclaw.skills.measures import Measure, Parameter, from_si

_SLACK: Final = 0.05
"""Share of the trained half-range by which a bound may lie outside it: the range is read off percentiles of the
data."""
Faults = Iterator[ContractError]
Priors = Mapping[str, Path]
ANY: Final[Priors] = MappingProxyType({})
"""No prior in particular."""


@dataclass(frozen=True)
class Subject:
    """A skill and the requirements on it. priors: by digest, the installed ones, of which an adapter has to fit one;
    empty for any prior."""

    skill: Skill
    measures: Mapping[str, Measure]
    priors: Priors = field(default_factory=lambda: ANY)

    @cached_property
    def properties(self) -> Mapping[str, Any]:
        # A checked schema maps its properties.
        return self.skill.schema.get("properties", {})  # type: ignore[no-any-return]

    @property
    def owner(self) -> str:
        """The skill that its adapter was trained for."""
        return str(self.skill.schema.get("x-adapter", self.skill.name))

    @property
    def train(self) -> str:
        folder = self.skill.adapter.parent if self.skill.adapter else self.skill.name
        return f"Train it again with `humanclaw train adapter --skill {folder}`."


def misfits(subject: Subject) -> Faults:
    """Yield disagreements between the adapter of a skill and its schema, and adapters that are unreadable.

    Weights are not read: that would take 5 ms a skill whenever the host starts.
    """
    skill = subject.skill
    if skill.adapter is None or not skill.adapter.is_file():
        return
    fitting = [path for base, path in adapters_beside(skill.adapter).items() if base in subject.priors]
    for path in fitting or [skill.adapter]:
        yield from _misfits(subject, path)


def _misfits(subject: Subject, adapter: Path) -> Faults:
    skill = subject.skill
    header, faults = adapter_header(adapter, subject.train, subject.priors)
    yield from faults
    if not header:
        return
    config, trained = header["adapter"], ranges(header)
    if config.get("skill") != subject.owner:
        message = f"{adapter} is the adapter of {config.get('skill')!r}, not of {subject.owner!r}."
        remedy = f'{subject.train} Or say whose it is: "x-adapter": "{config.get("skill")}" in schema.json.'
        yield ContractError("adapter-skill", message, remedy)
    if {parameter.name for parameter in skill.parameters} != set(trained):
        yield _other_names(subject, trained)
        return
    commanded = measures_in(header)
    for parameter in skill.parameters:
        yield from _beyond(subject, parameter, *trained[parameter.name])
        if commanded and commanded[parameter.name] != parameter.measure:
            where = f"parameter {parameter.key!r} of skill {skill.name!r} commands {parameter.measure!r}"
            message = f"{where}, and its adapter was trained on {commanded[parameter.name]!r}."
            yield ContractError("adapter-measures", message, f"Mend its x-measure. {subject.train}")


def adapter_header(path: Path, remedy: str, priors: Priors = ANY) -> tuple[dict[str, Any], tuple[ContractError, ...]]:
    """Return the header of an adapter (empty if it cannot be read), and its faults."""
    try:
        header = read_header(path, remedy, "adapter")
        ranged = [name for name, edges in ranges(header).items() if not all(map(isfinite, edges)) or edges[1] <= 0]
    except CheckpointError as error:
        return {}, (ContractError("adapter-readable", error.message, error.remedy),)
    except (AttributeError, KeyError, TypeError, ValueError):
        return {}, (ContractError("adapter-header", f"{path} is not the checkpoint of an adapter.", remedy),)
    if ranged:
        message = f"{path} has no finite centre and positive scale of {', '.join(ranged)}."
        return {}, (ContractError("adapter-header", message, remedy),)
    if priors and str(header.get("base")) not in priors:
        message = f"{path} was trained against base {header.get('base')}; the installed ones are {', '.join(priors)}."
        return header, (ContractError("adapter-base", message, f"Install its prior. {remedy}"),)
    return header, ()


def ranges(header: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """Return the centre and half-width of the training range of each parameter of an adapter, SI."""
    config = header["adapter"]
    columns = zip(config["params"], config["centre"], config["scale"], strict=True)
    return {name: (float(centre), float(scale)) for name, centre, scale in columns}


def measures_in(header: Mapping[str, Any]) -> dict[str, str]:
    """Return what each parameter of an adapter commands; empty for an adapter whose header does not say."""
    config = header["adapter"]
    measures = config.get("measures") or ()
    return dict(zip(config["params"], measures, strict=False)) if len(measures) == len(config["params"]) else {}


def within(value: float, centre: float, scale: float) -> bool:
    """Whether a value lies in what an adapter was trained on, give or take what percentiles leave out."""
    return abs(value - centre) <= (1 + _SLACK) * scale


def _other_names(subject: Subject, trained: Mapping[str, Any]) -> ContractError:
    declared = ", ".join(parameter.name for parameter in subject.skill.parameters) or "none"
    return ContractError(
        "adapter-parameters",
        f"the adapter of skill {subject.skill.name!r} was trained on the parameters {', '.join(trained) or 'none'}, "
        f"and its schema.json declares {declared}.",
        f"Mend schema.json (z_cm and z_deg are the adapter's z). {subject.train}",
    )


def _beyond(subject: Subject, parameter: Parameter, centre: float, scale: float) -> Faults:
    if not (within(parameter.low, centre, scale) and within(parameter.high, centre, scale)):
        least, most = (from_si(parameter.key, edge) for edge in (centre - scale, centre + scale))
        low, high = (from_si(parameter.key, edge) for edge in (parameter.low, parameter.high))
        asked = f"parameter {parameter.key!r} of skill {subject.skill.name!r} may be {low:.0f} to {high:.0f}"
        message = f"{asked}, and its adapter was trained on {least:.0f} to {most:.0f}."
        yield ContractError("adapter-bounds", message, f"Narrow the bounds in schema.json. {subject.train}")
