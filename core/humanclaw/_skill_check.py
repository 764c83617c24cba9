"""The contract of a skill, checked: by the plugin host where a skill is registered, and by
humanclaw.testing.check_skill.

One check for both, the adapter's weights included: a skill that is listed as ready can run.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from math import inf, isfinite
from typing import Any, Final, get_args

import jsonschema

from humanclaw.contract import OFFLINE, Skill
from humanclaw.errors import CheckpointError, PluginError
from humanclaw.measures import MEASURES, Measure, Parameter, from_si, si_unit
from humanclaw.motion.checkpoint import check_checkpoint
from humanclaw.tools import Format, parameter_schema, publish

_SLACK: Final = 0.05
"""Share of the trained half-range by which a bound may lie outside it: the range is read off percentiles of the
data."""
_TOP_LEVEL: Final = frozenset(
    {"$schema", "$comment", "$defs", "title", "description", "type", "properties", "required", "additionalProperties"}
)
"""Words of a schema that reach every provider, or that need not: any other would be held against a model that is not
told it."""


def skill_faults(skill: Skill, measures: Mapping[str, Measure] = MEASURES, base: str = "") -> tuple[PluginError, ...]:
    """Everything in which a skill breaks the contract, each with what mends it; nothing for a skill that keeps it.

    Whatever a skill's schema or adapter holds, this raises nothing: what cannot be checked is a fault.

    Args:
        skill: one without an adapter's file is held to its schema and checklist alone.
        measures: what parameters may command.
        base: digest of the prior that its adapter has to fit; empty to leave that open.
    """
    try:
        odd = (*_odd_properties(skill), *_unpublishable(skill))
        return odd or tuple(_faults(skill, measures, base))
    except Exception as error:
        reason = f"skill {skill.name!r} cannot be checked: {type(error).__name__}: {error}."
        return (PluginError(reason, "Mend its schema.json."),)


def _faults(skill: Skill, measures: Mapping[str, Measure], base: str) -> Iterator[PluginError]:
    yield from _bad_texts(skill)
    yield from _bad_checks(skill)
    yield from _open_ended(skill)
    yield from _bad_bounds(skill)
    yield from _bad_defaults(skill)
    yield from _undefined(skill)
    if skill.adapter is None:
        return
    yield from _bad_conditions(skill, measures)
    if skill.adapter.is_file():
        yield from _misfits(skill, base)


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


def _is_told(text: object) -> bool:
    return isinstance(text, str) and bool(text.strip())


def _bad_texts(skill: Skill) -> Iterator[PluginError]:
    if not _is_told(skill.description):
        message = f"skill {skill.name!r} has the description {skill.description!r}."
        yield PluginError(message, "Describe it for a model, in a sentence or more.")
    for key, part in _properties(skill).items():
        # The arguments of a function may speak for themselves; centimetres along which axis, they do not.
        if "description" in part or skill.adapter is not None:
            text = part.get("description", "")
            if not _is_told(text):
                message = f"parameter {key!r} of skill {skill.name!r} has the description {text!r}."
                yield PluginError(message, "Describe it for a model.")


def _bad_checks(skill: Skill) -> Iterator[PluginError]:
    for name, count in Counter(check.id for check in skill.checks).items():
        if count > 1:
            yield PluginError(f"skill {skill.name!r} has {count} checks with the id {name!r}.", "Rename them.")
    for check in skill.checks:
        if not check.question.rstrip().endswith(("?", ".")):
            message = f"check {check.id!r} of skill {skill.name!r} asks {check.question!r}."
            yield PluginError(message, "Write a question, or a sentence to agree with.")


def _open_ended(skill: Skill) -> Iterator[PluginError]:
    """Yield what the schema says of calls beside its properties, and providers are not told."""
    for word in skill.schema:
        if word not in _TOP_LEVEL and not word.startswith("x-"):
            message = f"the schema of skill {skill.name!r} has {word!r} beside its properties, which no model is told."
            yield PluginError(message, "Say it with type, bounds, required and default of each property.")
    if skill.schema.get("additionalProperties") is not False:
        message = f"the schema of skill {skill.name!r} lets calls have parameters that it does not declare."
        yield PluginError(message, "Set additionalProperties to false.")


def _bad_bounds(skill: Skill) -> Iterator[PluginError]:
    for key, part in parameter_schema(skill).items():
        low, high = part.get("minimum"), part.get("maximum")
        if low is not None and high is not None and low > high:
            message = f"parameter {key!r} of skill {skill.name!r} may be {low} to {high}, which no number is."
            yield PluginError(message, "Swap minimum and maximum.")


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
        yield from _bad_measure(one, where, measures)
    for name, count in Counter(one.name for one in skill.parameters).items():
        if count > 1:
            yield PluginError(f"skill {skill.name!r} has {count} parameters {name!r} but for the unit.", "Rename them.")


def _bad_measure(one: Parameter, where: str, measures: Mapping[str, Measure]) -> Iterator[PluginError]:
    if not isinstance(one.measure, str) or one.measure not in measures:
        message = f"{where} commands {one.measure or 'no measure'!r}."
        yield PluginError(message, f"Set its x-measure to one of: {', '.join(measures)}.")
    elif (unit := si_unit(one.key)) and measures[one.measure].unit != unit:
        message = f"{where} is in {unit}, and {one.measure!r}, which it commands, is in {measures[one.measure].unit}."
        yield PluginError(message, "Mend its x-measure, or end its name in _cm for metres and in _deg for radians.")


def _misfits(skill: Skill, base: str) -> Iterator[PluginError]:
    """Yield what the adapter of a skill and its schema disagree about; an adapter that is none, or holds no numbers."""
    assert skill.adapter is not None
    try:
        header = check_checkpoint(skill.adapter, "adapter", _train(skill))
        config = header["adapter"]
        trained = {name: (centre, scale) for name, centre, scale in _columns(config)}
        unusable = [name for name, (centre, scale) in trained.items() if not (isfinite(centre) and 0 < scale < inf)]
    except CheckpointError as error:
        yield PluginError(error.message, error.remedy)
        return
    except (AttributeError, KeyError, TypeError, ValueError):
        yield PluginError(f"{skill.adapter} is not the checkpoint of an adapter.", _train(skill))
        return
    if unusable:
        message = f"{skill.adapter} has no finite centre and positive scale of {', '.join(unusable)}."
        yield PluginError(message, _train(skill))
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
        f"the adapter of skill {skill.name!r} was trained on the parameters {', '.join(trained) or 'none'}, and its "
        "schema.json "
        f"declares {declared}.",
        f"Mend schema.json (z_cm and z_deg are the adapter's z). {_train(skill)}",
    )


def _beyond(skill: Skill, one: Parameter, centre: float, scale: float) -> Iterator[PluginError]:
    slack = (1 + _SLACK) * scale
    if one.low < centre - slack or one.high > centre + slack:
        least, most = (from_si(one.key, edge) for edge in (centre - scale, centre + scale))
        low, high = (from_si(one.key, edge) for edge in (one.low, one.high))
        message = (
            f"parameter {one.key!r} of skill {skill.name!r} may be {low:.0f} to {high:.0f}, and its adapter was "
            "trained on "
            f"{least:.0f} to {most:.0f}."
        )
        yield PluginError(message, f"Narrow the bounds in schema.json. {_train(skill)}")
