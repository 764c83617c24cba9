"""The contract of a skill as named checks. The plugin host runs them where a skill is registered;
humanclaw.testing.check_skill runs them and plays the skill.

One table for both, the adapter's weights included: a skill that is listed as ready can run.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, get_args

import jsonschema

from humanclaw.errors import ContractError, PluginError
from humanclaw.skills.adapter_checks import ANY, Faults, Priors, Subject, misfits
from humanclaw.skills.contract import OFFLINE, RESERVED, Skill, read_checks, refusals
from humanclaw.skills.measures import MEASURES, Measure, Parameter, read_schema, si_unit
from humanclaw.skills.publishing import OPTIONAL_FIELDS, REASONING_FIELDS, Format, parameter_schema, unpublishable

CHECKS: Final[Mapping[str, str]] = {
    # Name and schema.
    "loads": "its file or folder can be read, and raises nothing",
    "name": "its name has letters, digits, _ and - alone, 64 at most",
    "name-reserved": "its name is no tool that a harness has: look, reset, verdict",
    "schema-file": "schema.json is there and holds a JSON object",
    "schema-object": "its schema is of type object",
    "schema-valid": "its schema is JSON Schema 2020-12",
    "references": "its schema refers to its own $defs alone",
    "role": "its role is one of those that the benchmark knows",
    "properties": "each parameter has a schema of its own",
    "types": "each parameter has one flat type, which every provider keeps",
    "reasoning-names": "no parameter has the name of a reasoning field",
    "closed": "calls with parameters that it does not declare are refused",
    "told": "nothing holds for its calls that no model is told",
    "described": "it says in words what it does",
    "parameters-described": "its parameters say in words what they are",
    "bounds-order": "no minimum is above its maximum",
    "bounds-finite": "bounds are finite numbers, those of integers whole, and no value needs more than 1,000 parts",
    "choices": "each enum offers something, each choice once and of the parameter's type",
    "required-declared": "what it requires it declares",
    "defaults-given": "what may be left out has a default",
    "defaults-legal": "defaults are values that the schema takes",
    "publish-openai": "it can be a tool of OpenAI's interface",
    "publish-anthropic": "it can be a tool of Anthropic's interface",
    "publish-gemini": "it can be a tool of Gemini's interface",
    "publish-mcp": "it can be a tool of an MCP server",
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
    "adapter-finite": "every weight is a float, none NaN or infinite",
    "adapter-width": "every weight has the shape that the prior needs",
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
_BOUNDS: Final = ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum")
_EXACT: Final = 2**53
"""Beyond it not every reader of JSON keeps an integer."""
_PARTS: Final = 1000
_FORMATS: Final = frozenset(f"publish-{form}" for form in get_args(Format))
_TOP_LEVEL: Final = frozenset(
    {"$schema", "$comment", "$defs", "title", "description", "type", "properties", "required", "additionalProperties"}
)
"""Keywords of a schema that every provider gets, or that no model needs. A model must not be refused for a rule that it
cannot see."""


class Draft(Skill):
    """A possibly faulty skill, built without refusal so that all its faults can be listed together."""

    def __post_init__(self) -> None:
        """Refuse nothing."""


def skill_faults(
    skill: Skill, measures: Mapping[str, Measure] = MEASURES, priors: Priors = ANY, formats: bool = False
) -> tuple[ContractError, ...]:
    """Everything in which a skill breaks the contract, each with what mends it; nothing for a skill that keeps it.

    Whatever a skill's schema or adapter holds, this raises nothing: what cannot be checked is a fault.

    Args:
        skill: one without an adapter's file is held to its schema and checklist alone.
        measures: what parameters may command.
        priors: checkpoints of the installed priors by digest, of which its adapter has to fit one; empty to leave that
            open.
        formats: also tell of tool formats in which it cannot be published; elsewhere it can be used.
    """
    found: list[ContractError] = []
    broken: list[Exception] = []
    for find in _FINDERS:
        try:
            found += find(Subject(skill, measures, priors))
        except Exception as error:
            broken.append(error)
    if broken and not found:  # Otherwise the found fault is the reason.
        reason = f"skill {skill.name!r} cannot be checked: {type(broken[0]).__name__}: {broken[0]}."
        found.append(ContractError("loads", reason, "Mend its schema.json."))
    return tuple(fault for fault in found if formats or fault.check not in _FORMATS)


def read_draft(folder: Path) -> tuple[Draft | None, tuple[ContractError, ...]]:
    """Return a skill's folder as it stands, and what in it cannot be read; None without a schema."""
    checks, faults = read_checks(folder / "checklist.toml")
    try:
        schema = read_schema(folder)
    except PluginError as error:
        return None, (ContractError("schema-file", error.message, error.remedy or "Write a JSON schema."), *faults)
    return Draft.of_schema(folder.name, schema, checks, folder / "adapter.safetensors"), faults


# -- the schema --------------------------------------------------------------------------------------------------------
def _refused(subject: Subject) -> Faults:
    # A plain Skill passed these checks, which take the most time of all, as it was made.
    return iter(()) if type(subject.skill) is Skill else refusals(subject.skill)


def _reserved(subject: Subject) -> Faults:
    if (name := subject.skill.name) in RESERVED:
        taken = f"skill name {name!r} is taken: a harness has a tool of that name."
        yield ContractError("name-reserved", taken, "Rename the skill.")


def _odd_properties(subject: Subject) -> Faults:
    """JSON Schema allows true and false as schemas; such a parameter could not be called."""
    for key, part in subject.properties.items():
        if not isinstance(part, Mapping):
            odd = f"parameter {key!r} of skill {subject.skill.name!r} is {part!r}."
            yield ContractError("properties", odd, "Give it a type.")


def _unpublishable(subject: Subject) -> Faults:
    try:
        clash = sorted(set(parameter_schema(subject.skill)) & {*REASONING_FIELDS, *OPTIONAL_FIELDS})
    except PluginError as error:
        yield ContractError("types", error.message, error.remedy)
        return
    for key in clash:
        told = f"skill {subject.skill.name!r} has a parameter {key!r}, the name of a reasoning field."
        yield ContractError("reasoning-names", told, "Rename it.")
    if not clash:
        for form in get_args(Format):
            if why := unpublishable(subject.skill, form):
                yield ContractError(f"publish-{form}", why.message, why.remedy)


def _is_told(text: object) -> bool:
    return isinstance(text, str) and bool(text.strip())


def _bad_texts(subject: Subject) -> Faults:
    skill = subject.skill
    if not _is_told(skill.description):
        message = f"skill {skill.name!r} has the description {skill.description!r}."
        yield ContractError("described", message, "Describe it for a model, in a sentence or more.")
    for key, part in subject.properties.items():
        # The arguments of a function may speak for themselves; centimetres along which axis, they do not.
        if "description" in part or skill.adapter is not None:
            text = part.get("description", "")
            if not _is_told(text):
                message = f"parameter {key!r} of skill {skill.name!r} has the description {text!r}."
                yield ContractError("parameters-described", message, "Describe it for a model.")


def _bad_checks(subject: Subject) -> Faults:
    skill = subject.skill
    for name, count in Counter(check.id for check in skill.checks).items():
        if count > 1:
            message = f"skill {skill.name!r} has {count} checks with the id {name!r}."
            yield ContractError("checks-unique", message, "Rename them.")
    for check in skill.checks:
        if not _is_told(check.id):
            message = f"skill {skill.name!r} has a check with the id {check.id!r}."
            yield ContractError("checks-named", message, "Name it in a word.")
        if not str(check.question).rstrip().endswith(("?", ".")):
            message = f"check {check.id!r} of skill {skill.name!r} asks {check.question!r}."
            yield ContractError("checks-questions", message, "Write a question, or a sentence to agree with.")


def _open_ended(subject: Subject) -> Faults:
    """Yield rules about calls outside the properties: providers drop them, so a model cannot know them."""
    skill = subject.skill
    for word in skill.schema:
        if word not in _TOP_LEVEL and not word.startswith("x-"):
            message = f"the schema of skill {skill.name!r} has {word!r} beside its properties, which no model is told."
            yield ContractError("told", message, "Say it with type, bounds, required and default of each property.")
    if skill.schema.get("additionalProperties") is not False:
        message = f"the schema of skill {skill.name!r} lets calls have parameters that it does not declare."
        yield ContractError("closed", message, "Set additionalProperties to false.")


def _bad_bounds(subject: Subject) -> Faults:
    for key, part in parameter_schema(subject.skill).items():
        where = f"parameter {key!r} of skill {subject.skill.name!r}"
        low, high = part.get("minimum"), part.get("maximum")
        for bound in (part[word] for word in _BOUNDS if word in part):
            if not abs(bound) <= _EXACT or (part.get("type") == "integer" and bound != int(bound)):
                message = f"{where} has the bound {bound!s:.40}."
                yield ContractError("bounds-finite", message, "Give it a finite bound, a whole one to an integer.")
        if (size := _least_size(part)) > _PARTS:
            message = f"{where} needs {size:.6g} letters or values or more."
            yield ContractError("bounds-finite", message, f"Let {_PARTS} be enough: mend minLength and minItems.")
        if low is not None and high is not None and low > high:
            message = f"{where} may be {low} to {high}, which no number is."
            yield ContractError("bounds-order", message, "Swap minimum and maximum.")
        yield from _bad_choices(part, where)


def _least_size(part: Mapping[str, Any]) -> int:
    """Return how many letters or values the shortest legal value has."""
    inner = sum(_least_size(one) for one in part.get("properties", {}).values())
    each = max(1, _least_size(part["items"])) if isinstance(part.get("items"), Mapping) else 1
    return int(max(inner, part.get("minLength", 0), part.get("minItems", 0) * each))


def _bad_choices(part: Mapping[str, Any], where: str) -> Faults:
    if "enum" not in part:
        return
    plain = {word: value for word, value in part.items() if word in ("type", "minimum", "maximum")}
    validator = jsonschema.Draft202012Validator(plain)
    odd = [choice for choice in part["enum"] if not validator.is_valid(choice)]
    twice = [choice for number, choice in enumerate(part["enum"]) if choice in part["enum"][:number]]
    told = f"offers {odd[0]!r}, which its type refuses" if odd else f"offers {twice[0]!r} twice" if twice else ""
    if told or not part["enum"]:
        yield ContractError("choices", f"{where} {told or 'offers no choice'}.", "Mend its enum.")


def _bad_defaults(subject: Subject) -> Faults:
    defs = {"$defs": subject.skill.schema.get("$defs", {})}
    for key, part in subject.properties.items():
        if "default" not in part:
            continue
        validator = jsonschema.Draft202012Validator({**defs, **part}, registry=OFFLINE)
        for fault in validator.iter_errors(part["default"]):
            where = f"the default of {key!r} of skill {subject.skill.name!r}"
            message = f"{where} is refused by its own schema: {fault.message}."
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
    for one in skill.parameters:
        where, part = f"parameter {one.key!r} of skill {skill.name!r}", subject.properties[one.key]
        if one.name == one.key:
            yield ContractError("units", f"{where} does not name its unit.", "End its name in _cm or _deg.")
        if part.get("type") != "integer":
            message = f"{where} is no integer; decoders do not keep the bounds of floats."
            yield ContractError("integers", message, "Make it an integer.")
        if not {"minimum", "maximum"} <= set(part):
            yield ContractError("bounded", f"{where} has no bounds.", "Give it a minimum and a maximum.")
        yield from _bad_measure(one, where, subject.measures)
    for name, count in Counter(one.name for one in skill.parameters).items():
        if count > 1:
            message = f"skill {skill.name!r} has {count} parameters {name!r} but for the unit."
            yield ContractError("names-unique", message, "Rename them.")


def _bad_measure(one: Parameter, where: str, measures: Mapping[str, Measure]) -> Faults:
    if not isinstance(one.measure, str) or one.measure not in measures:
        message = f"{where} commands {one.measure or 'no measure'!r}."
        yield ContractError("measures-known", message, f"Set its x-measure to one of: {', '.join(measures)}.")
    elif (unit := si_unit(one.key)) and measures[one.measure].unit != unit:
        message = f"{where} is in {unit}, and {one.measure!r}, which it commands, is in {measures[one.measure].unit}."
        remedy = "Mend its x-measure, or end its name in _cm for metres and in _deg for radians."
        yield ContractError("measures-units", message, remedy)


_FINDERS: Final[tuple[Callable[[Subject], Faults], ...]] = (
    _refused, _reserved, _odd_properties, _unpublishable, _bad_texts, _bad_checks, _open_ended, _bad_bounds,
    _bad_defaults, _undefined, _bad_conditions, misfits,
)  # fmt: skip
