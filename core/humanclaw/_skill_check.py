"""The contract of a skill, checked: by the plugin host where a skill is registered, and by humanclaw.testing.check_skill.

Registering reads the header of an adapter and none of its weights: 8 skills take milliseconds.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any, Final, get_args

import jsonschema

from humanclaw.contract import OFFLINE, Skill
from humanclaw.errors import CheckpointError, PluginError
from humanclaw.measures import MEASURES, Measure, Parameter, from_si
from humanclaw.motion.checkpoint import read_checkpoint, read_header
from humanclaw.tools import Format, publish

_SLACK: Final = 0.05
"""Share of the trained half-range by which a bound may lie outside it: the range is read off percentiles of the data."""


def skill_faults(
    skill: Skill, measures: Mapping[str, Measure] = MEASURES, base: str = "", weights: bool = False
) -> tuple[PluginError, ...]:
    """Everything in which a skill breaks the contract, each with what mends it; nothing for a skill that keeps it.

    Args:
        skill: one without an adapter's file is held to its schema alone.
        measures: what parameters may command.
        base: digest of the prior that its adapter has to fit; empty to leave that open.
        weights: also read the adapter's weights, and refuse NaN and infinity.
    """
    odd = tuple(_odd_properties(skill))
    return odd or tuple(_faults(skill, measures, base, weights))


def _faults(skill: Skill, measures: Mapping[str, Measure], base: str, weights: bool) -> Iterator[PluginError]:
    yield from _unpublishable(skill)
    yield from _bad_defaults(skill)
    yield from _undefined(skill)
    if skill.adapter is None:
        return
    yield from _bad_conditions(skill, measures)
    if skill.adapter.is_file():
        yield from _misfits(skill, base)
        if weights:
            yield from _bad_weights(skill)


def _properties(skill: Skill) -> Mapping[str, Any]:
    return skill.schema.get("properties", {})  # type: ignore[no-any-return]


def _train(skill: Skill) -> str:
    return f"Train it again with `humanclaw train adapter {skill.name}`."


# -- the schema --------------------------------------------------------------------------------------------------------
def _odd_properties(skill: Skill) -> Iterator[PluginError]:
    """JSON Schema allows true and false for a schema; nobody could call such a parameter."""
    for key, part in _properties(skill).items():
        if not isinstance(part, Mapping):
            yield PluginError(f"parameter {key!r} of skill {skill.name!r} is {part!r}.", "Give it a type.")


def _unpublishable(skill: Skill) -> Iterator[PluginError]:
    try:
        for form in get_args(Format):
            publish([skill], form)
    except PluginError as error:
        yield error


def _bad_defaults(skill: Skill) -> Iterator[PluginError]:
    for key, part in _properties(skill).items():
        if "default" not in part:
            continue
        validator = jsonschema.Draft202012Validator({"$defs": skill.schema.get("$defs", {}), **part}, registry=OFFLINE)
        for fault in validator.iter_errors(part["default"]):
            message = f"the default of {key!r} of skill {skill.name!r} is refused by its own schema: {fault.message}."
            yield PluginError(message, "Mend the default or the bounds.")


def _undefined(skill: Skill) -> Iterator[PluginError]:
    required, known = set(skill.schema.get("required", ())), _properties(skill)
    for key in sorted(required - set(known)):
        yield PluginError(f"skill {skill.name!r} requires {key!r}, which its properties do not declare.", "Declare it.")
    for key, part in known.items():
        if key not in required and "default" not in part:
            message = f"parameter {key!r} of skill {skill.name!r} may be left out and has no default."
            yield PluginError(message, "Give it a default, or list it under required.")


# -- a trained skill ---------------------------------------------------------------------------------------------------
def _bad_conditions(skill: Skill, measures: Mapping[str, Measure]) -> Iterator[PluginError]:
    for one in skill.parameters:
        where, part = f"parameter {one.key!r} of skill {skill.name!r}", _properties(skill)[one.key]
        if one.name == one.key:
            yield PluginError(f"{where} does not name its unit.", "End its name in _cm or _deg.")
        if part.get("type") != "integer":
            yield PluginError(
                f"{where} is no integer; decoders do not keep the bounds of floats.", "Make it an integer."
            )
        if not {"minimum", "maximum"} <= set(part):
            yield PluginError(f"{where} has no bounds.", "Give it a minimum and a maximum.")
        if one.measure not in measures:
            known = ", ".join(measures)
            yield PluginError(
                f"{where} commands {one.measure or 'no measure'!r}.", f"Set its x-measure to one of: {known}."
            )
    for name, count in Counter(one.name for one in skill.parameters).items():
        if count > 1:
            yield PluginError(f"skill {skill.name!r} has {count} parameters {name!r} but for the unit.", "Rename them.")


def _bad_weights(skill: Skill) -> Iterator[PluginError]:
    assert skill.adapter is not None
    try:
        read_checkpoint(skill.adapter, "adapter", _train(skill))
    except CheckpointError as error:
        yield PluginError(error.message, error.remedy)


def _misfits(skill: Skill, base: str) -> Iterator[PluginError]:
    """What the header of its adapter and the schema of a skill disagree about."""
    assert skill.adapter is not None
    try:
        header = read_header(skill.adapter, _train(skill))
        config = header["adapter"]
        trained = {name: (float(c), float(s)) for name, c, s in _columns(config)}
    except CheckpointError as error:
        yield PluginError(error.message, error.remedy)
        return
    except (KeyError, TypeError, ValueError):
        yield PluginError(f"{skill.adapter} is not the checkpoint of an adapter.", _train(skill))
        return
    if config.get("skill") != skill.name:
        yield PluginError(
            f"{skill.adapter} is the adapter of {config.get('skill')!r}, not of {skill.name!r}.", _train(skill)
        )
    if base and header.get("base") != base:
        trained_on = f"the adapter of skill {skill.name!r} was trained against base {header.get('base')}"
        yield PluginError(f"{trained_on}, and this base is {base}.", _train(skill))
    if {one.name for one in skill.parameters} != set(trained):
        yield _other_names(skill, trained)
        return
    for one in skill.parameters:
        yield from _beyond(skill, one, *trained[one.name])


def _columns(config: Mapping[str, Any]) -> Iterator[tuple[str, float, float]]:
    return zip(config["params"], config["centre"], config["scale"], strict=True)


def _other_names(skill: Skill, trained: Mapping[str, Any]) -> PluginError:
    declared = ", ".join(one.name for one in skill.parameters) or "none"
    return PluginError(
        f"the adapter of skill {skill.name!r} was trained on the parameters {', '.join(trained) or 'none'}, and its schema.json "
        f"declares {declared}.",
        f"Mend schema.json (z_cm and z_deg are the adapter's z). {_train(skill)}",
    )


def _beyond(skill: Skill, one: Parameter, centre: float, scale: float) -> Iterator[PluginError]:
    slack = (1 + _SLACK) * scale
    if one.low < centre - slack or one.high > centre + slack:
        least, most = (from_si(one.key, edge) for edge in (centre - scale, centre + scale))
        low, high = (from_si(one.key, edge) for edge in (one.low, one.high))
        message = (
            f"parameter {one.key!r} of skill {skill.name!r} may be {low:.0f} to {high:.0f}, and its adapter was trained on "
            f"{least:.0f} to {most:.0f}."
        )
        yield PluginError(message, f"Narrow the bounds in schema.json. {_train(skill)}")
