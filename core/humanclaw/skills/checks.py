"""The contract of a skill as named checks. The plugin host runs them where a skill is registered;
humanclaw.testing.check_skill runs them and plays the skill.

One table for both, the adapter's weights included: a skill that is listed as ready can run.
"""

from __future__ import annotations

import functools
import json
import re
from collections import Counter
from collections.abc import Callable, Mapping
from importlib import resources
from pathlib import Path
from typing import Any, Final

from humanclaw.errors import ContractError, PluginError
from humanclaw.skills.adapter_checks import ANY, Faults, Priors, Subject, misfits
from humanclaw.skills.contract import Skill, faults_of, read_checks
from humanclaw.skills.measures import MEASURES, ROLES, Measure, Parameter, read_schema, si_unit
from humanclaw.skills.tool_schemas import OPTIONAL_FIELDS, REASONING_FIELDS, THOUGHTS

CHECKS: Final[Mapping[str, str]] = {
    # Name and schema.
    "loads": "its file or folder can be read, and raises nothing",
    "name": "its name has letters, digits, _ and - alone, 64 at most, and begins with a letter or _",
    "name-reserved": "its name is no tool that a harness has: look, reset, verdict",
    "name-free": "its name alone means it, and no skill of another plugin",
    "schema-file": "schema.json is there and holds a JSON object",
    "schema": "its schema has the form of every skill's: flat parameters of one type, closed, with finite bounds",
    "role": "its role is one of those that the benchmark knows",
    "reasoning-names": "no parameter has the name of a reasoning field",
    "described": "it says in words what it does",
    "parameters-described": "its parameters say in words what they are",
    "bounds-order": "no minimum is above its maximum",
    "choices": "each choice of an enum is of the parameter's type and within its bounds",
    "required-declared": "what it requires it declares",
    "defaults-given": "what may be left out has a default",
    "defaults-legal": "defaults are values that the schema takes",
    # Checklist of the verifier.
    "checklist-file": "checklist.toml is TOML",
    "checklist-words": "checklist.toml holds [[check]] tables alone",
    "checklist-tables": "each check is a table of the texts id and question",
    "checks-unique": "no two checks have one id",
    "checks-named": "each check has an id",
    "checks-questions": "each check is a question, or a sentence to agree with",
    # What its parameters command.
    "units": "parameters of a trained skill name their unit, _cm or _deg",
    "integers": "parameters of a trained skill are integers",
    "bounded": "parameters of a trained skill have both bounds",
    "names-unique": "no two parameters differ in their unit alone",
    "measures-known": "each parameter of a trained skill commands a measure",
    "measures-units": "a parameter and its measure are in one unit",
    # Its adapter.
    "adapter-there": "its adapter is there",
    "adapter-readable": "its adapter is a checkpoint of this format",
    "adapter-weights": "every weight is a finite float, in the shape that the prior needs",
    "adapter-header": "the header names the range of each parameter in finite numbers",
    "adapter-skill": "its adapter was trained for it, or for the skill that x-adapter names",
    "adapter-base": "its adapter was trained on this prior",
    "adapter-parameters": "the schema declares what the adapter was trained on",
    "adapter-measures": "the schema commands the measures that the adapter was trained on",
    "adapter-bounds": "bounds lie in the range that the adapter was trained on",
    # Its calls and its motion, by playing it.
    "accepts-bounds": "its schema takes the minima and the maxima of its parameters",
    "refuses-unknown": "a parameter that it does not declare is refused",
    "refuses-types": "a value of another type is refused",
    "refuses-nan": "NaN and infinity are refused",
    "refuses-beyond": "a value beyond a bound is refused",
    "plan-runs": "it plans every legal call and raises nothing",
    "plan-kind": "it returns a Control, Keyframes, a Reach, a Gaze, a Motion or a sequence of them",
    "plan-repeats": "one call has one plan",
    "duration": "a call lasts 10 s at most, whatever its numbers",
    "control-adapter": "adapters that it names are there and fit the prior",
    "control-values": "a Control has a value for each parameter of its adapter",
    "control-finite": "values of a Control are finite numbers",
    "control-range": "values of a Control lie in the range that its adapter was trained on",
    "keyframes-joints": "keyframes name joints of the body",
    "keyframes-times": "key times begin at 0 and increase, a key for each",
    "keyframes-finite": "keys are three finite numbers each",
    "aim-hand": "a Reach names the left or the right hand",
    "aim-finite": "the point of a Reach or a Gaze is three finite numbers",
    "motion-finite": "a Motion holds finite numbers",
    "joint-limits": "no joint turns further than a body's, also from a walk and the second time",
    "joint-speed": "no joint turns faster than a body's",
    "root-speed": "the pelvis moves no faster than a body's",
    "upright": "the pelvis stays upright",
    "self-contact": "no arm goes through the body",
    "parameters-used": "every parameter changes something",
    "default-moves": "its defaults move the body, if any call does",
    "follows": "a trained skill follows each parameter better than the best constant would",
    "body-plays": "a body without dynamics plays it",
    "body-repeats": "the same call at the same moment is the same motion",
    "engine-plays": "every installed engine plays it",
    "engine-finite": "where the body ends on an engine is a place",
}
"""Name of each check to what holds for a skill that passes it."""
_NAME: Final = re.compile(r"[a-zA-Z_][a-zA-Z0-9_-]{0,63}")
"""What every provider takes as the name of a tool."""
_RESERVED: Final = frozenset({"look", "reset", "verdict"})
"""Tools that harnesses offer beside the skills."""


def skill_faults(
    skill: Skill, measures: Mapping[str, Measure] = MEASURES, priors: Priors = ANY
) -> tuple[ContractError, ...]:
    """Everything in which a skill breaks the contract, each with what mends it; nothing for a skill that keeps it.

    Whatever a skill's schema or adapter holds, this raises nothing: what cannot be checked is a fault.

    Args:
        skill: one without an adapter's file is held to its schema and checklist alone.
        measures: what parameters may command.
        priors: checkpoints of the installed priors by digest, of which its adapter has to fit one; empty to leave that
            open.
    """
    faults: list[ContractError] = []
    broken: list[Exception] = []
    for find in _FINDERS:
        try:
            faults += find(Subject(skill, measures, priors))
        except Exception as error:
            broken.append(error)
    if broken and not faults:  # Otherwise the found fault is the reason.
        reason = f"skill {skill.name!r} cannot be checked: {type(broken[0]).__name__}: {broken[0]}."
        faults.append(ContractError("loads", reason, "Mend its schema.json."))
    return tuple(faults)


def read_draft(folder: Path) -> tuple[Skill | None, tuple[ContractError, ...]]:
    """Return a skill's folder as it stands, and what in it cannot be read; None without a schema."""
    checks, faults = read_checks(folder / "checklist.toml")
    try:
        schema = read_schema(folder)
    except PluginError as error:
        return None, (ContractError("schema-file", error.message, error.remedy or "Write a JSON schema."), *faults)
    return Skill.of_schema(folder.name, schema, checks, folder / "adapter.safetensors"), faults


# -- the schema --------------------------------------------------------------------------------------------------------
@functools.cache
def _form() -> dict[str, Any]:
    """Return the JSON schema of skill schemas."""
    text = resources.files("humanclaw.skills").joinpath("skill_schema.json").read_text("utf-8")
    form: dict[str, Any] = json.loads(text)
    return form


def _bad_form(subject: Subject) -> Faults:
    for fault in faults_of(dict(subject.skill.schema), _form()):
        message = f"the schema of skill {subject.skill.name!r} is not valid: {fault}."
        flat = "Declare each parameter as a number, a boolean, a string, one of a list of choices, or a list of these."
        whole = "Write type: object, properties, required and additionalProperties: false. Rules go into properties."
        yield ContractError("schema", message, flat if fault.startswith("properties.") else whole)


def _bad_name(subject: Subject) -> Faults:
    name, role = subject.skill.name, subject.skill.role
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        yield ContractError("name", f"skill name {name!r} does not match {_NAME.pattern}.", "Rename the skill.")
    elif name in _RESERVED:
        taken = f"skill name {name!r} is taken: a harness has a tool of that name."
        yield ContractError("name-reserved", taken, "Rename the skill.")
    if role not in ROLES:
        known = f"Set x-role in its schema.json to one of: {', '.join(ROLES)}."
        yield ContractError("role", f"skill {name!r} has the role {role!r}.", known)


def _bad_texts(subject: Subject) -> Faults:
    skill = subject.skill
    if not isinstance(skill.description, str) or not skill.description.strip():
        message = f"skill {skill.name!r} has the description {skill.description!r}."
        yield ContractError("described", message, "Describe it for a model, in a sentence or more.")
    for key, part in subject.properties.items():
        # The arguments of a function may speak for themselves; centimetres along which axis, they do not.
        if skill.adapter is not None and not str(part.get("description", "")).strip():
            message = f"parameter {key!r} of skill {skill.name!r} has no description."
            yield ContractError("parameters-described", message, "Describe it for a model.")
    for key in sorted({*subject.properties} & {*REASONING_FIELDS, *OPTIONAL_FIELDS, THOUGHTS}):
        message = f"skill {skill.name!r} has a parameter {key!r}, the name of a reasoning field."
        yield ContractError("reasoning-names", message, "Rename it.")


def _bad_checks(subject: Subject) -> Faults:
    skill = subject.skill
    for name, count in Counter(check.id for check in skill.checks).items():
        if count > 1:
            message = f"skill {skill.name!r} has {count} checks with the id {name!r}."
            yield ContractError("checks-unique", message, "Rename them.")
    for check in skill.checks:
        if not str(check.id).strip():
            message = f"skill {skill.name!r} has a check with the id {check.id!r}."
            yield ContractError("checks-named", message, "Name it in a word.")
        if not str(check.question).rstrip().endswith(("?", ".")):
            message = f"check {check.id!r} of skill {skill.name!r} asks {check.question!r}."
            yield ContractError("checks-questions", message, "Write a question, or a sentence to agree with.")


def _bad_values(subject: Subject) -> Faults:
    """Yield bounds, choices and defaults that do not go together."""
    for key, part in subject.properties.items():
        where = f"parameter {key!r} of skill {subject.skill.name!r}"
        low, high = part.get("minimum", float("-inf")), part.get("maximum", float("inf"))
        if not low <= high:
            message = f"{where} may be {low} to {high}, which no number is."
            yield ContractError("bounds-order", message, "Swap minimum and maximum.")
        bare = {word: value for word, value in part.items() if word != "enum"}
        for choice in part.get("enum", ()):
            for fault in faults_of(choice, bare):
                yield ContractError("choices", f"{where} offers {choice!r}: {fault}.", "Mend its enum.")
        for fault in faults_of(part["default"], part) if "default" in part else ():
            message = f"the default of {key!r} of skill {subject.skill.name!r} is refused by its own schema: {fault}."
            yield ContractError("defaults-legal", message, "Mend the default or the bounds.")


def _undefined(subject: Subject) -> Faults:
    required, known = set(subject.skill.schema.get("required", ())), subject.properties
    for key in sorted(required - set(known)):
        message = f"skill {subject.skill.name!r} requires {key!r}, which its properties do not declare."
        yield ContractError("required-declared", message, "Declare it.")
    for key, part in known.items():
        if key not in required and "default" not in part:
            message = f"parameter {key!r} of skill {subject.skill.name!r} may be left out and has no default."
            yield ContractError("defaults-given", message, "Give it a default, or list it under required.")


# -- a trained skill ---------------------------------------------------------------------------------------------------
def _bad_conditions(subject: Subject) -> Faults:
    skill = subject.skill
    if skill.adapter is None:
        return
    for parameter in skill.parameters:
        where, part = f"parameter {parameter.key!r} of skill {skill.name!r}", subject.properties[parameter.key]
        if parameter.name == parameter.key:
            yield ContractError("units", f"{where} does not name its unit.", "End its name in _cm or _deg.")
        if part.get("type") != "integer":
            message = f"{where} is no integer; decoders do not keep the bounds of floats."
            yield ContractError("integers", message, "Make it an integer.")
        if not {"minimum", "maximum"} <= set(part):
            yield ContractError("bounded", f"{where} has no bounds.", "Give it a minimum and a maximum.")
        yield from _bad_measure(parameter, where, subject.measures)
    for name, count in Counter(parameter.name for parameter in skill.parameters).items():
        if count > 1:
            message = f"skill {skill.name!r} has {count} parameters {name!r} but for the unit."
            yield ContractError("names-unique", message, "Rename them.")


def _bad_measure(parameter: Parameter, where: str, measures: Mapping[str, Measure]) -> Faults:
    if not isinstance(parameter.measure, str) or parameter.measure not in measures:
        message = f"{where} commands {parameter.measure or 'no measure'!r}."
        yield ContractError("measures-known", message, f"Set its x-measure to one of: {', '.join(measures)}.")
    elif (unit := si_unit(parameter.key)) and (own := measures[parameter.measure].unit) != unit:
        message = f"{where} is in {unit}, and {parameter.measure!r}, which it commands, is in {own}."
        remedy = "Mend its x-measure, or end its name in _cm for metres and in _deg for radians."
        yield ContractError("measures-units", message, remedy)


_FINDERS: Final[tuple[Callable[[Subject], Faults], ...]] = (
    _bad_name, _bad_form, _bad_texts, _bad_checks, _bad_values, _undefined, _bad_conditions, misfits,
)  # fmt: skip
