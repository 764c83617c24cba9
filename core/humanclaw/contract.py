"""The skill contract: a name, a role, a JSON schema, a checklist, and a way from parameters to motion.

A skill is atomic and body-local (paper, section 3.3). It never sees a scene. It turns its parameters into a Control,
for the motion model with an adapter, into Keyframes, played as they are, or into a sequence of both.
"""

from __future__ import annotations

import inspect
import math
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Real
from pathlib import Path
from typing import Any, Final, Self, TypeVar

import jsonschema
import numpy as np
from pydantic import TypeAdapter
from referencing import Registry

from humanclaw.body import JOINT_INDEX
from humanclaw.errors import CallError, ContractError, PluginError
from humanclaw.measures import ROLES, Declaration, Parameter, Role, parameters_of, read_schema, si_name, to_si
from humanclaw.pose import FPS, FUTURE, Motion, matrix_from_vector, smoothstep, vector_from_matrix

NAME_PATTERN: Final = re.compile(r"[a-zA-Z0-9_-]{1,64}")
RESERVED: Final = frozenset({"look", "reset", "verdict"})
"""Tools that harnesses offer beside the skills."""
OFFLINE: Final[Registry[Any]] = Registry()
"""For jsonschema, which would otherwise fetch what a $ref names."""
_LONGEST_FAULT: Final = 300
LONGEST_CALL: Final = 10.0
"""Seconds that one call may last: for as long nobody decides anew."""
_LOCAL: Final = re.compile(r"#/\$defs/[\w.-]+")
_NO_WORDS: Final = frozenset({"$id", "$anchor", "$dynamicRef", "$dynamicAnchor", "$recursiveRef"})


@dataclass(frozen=True)
class Check:
    """One question of a skill's checklist (paper, appendix A)."""

    id: str
    question: str
    """Answered yes or no from the current view alone; yes lets the call pass."""


@dataclass(frozen=True)
class Control:
    """Run the motion model for one 0.5 s chunk with this adapter and condition."""

    adapter: Path
    values: Mapping[str, float]
    """Parameter to its value, SI: metres and radians, named as in the adapter's header (humanclaw.measures.si_name)."""

    def __post_init__(self) -> None:
        if not isinstance(self.adapter, Path):
            raise MotionError("control-adapter", f"an adapter is the Path of its file; got {self.adapter!r}")
        if not isinstance(self.values, Mapping):
            raise MotionError("control-values", f"values are numbers by the name of a parameter; got {self.values!r}")
        for name, value in self.values.items():
            if not isinstance(value, Real) or not math.isfinite(value):
                raise MotionError("control-finite", f"a Control commands finite numbers; got {name}={value!r}")


class MotionError(ValueError):
    """Motion that cannot be played. check: the name of the check of skills that finds it."""

    def __init__(self, check: str, message: str) -> None:
        super().__init__(message)
        self.check = check


@dataclass(frozen=True)
class Keyframes:
    """Rotations laid over the pose in which the body is, played without the motion model.

    times: seconds, increasing from 0 to at most 10. rotations: joint name to one rotation vector (radians, joint frame)
    a time.
    """

    times: tuple[float, ...]
    rotations: Mapping[str, tuple[tuple[float, float, float], ...]]

    def __post_init__(self) -> None:
        unknown = sorted(set(self.rotations) - set(JOINT_INDEX))
        if unknown:
            known = ", ".join(JOINT_INDEX)
            raise MotionError("keyframes-joints", f"unknown joint {unknown[0]!r}; the joints are {known}")
        if len(self.times) < 2 or self.times[0] != 0 or not all(np.diff(self.times) > 0):
            raise MotionError("keyframes-times", f"key times must start at 0 and increase; got {self.times[:9]}")
        _check_duration(self.times[-1], "keyframes")
        for joint, keys in self.rotations.items():
            if len(keys) != len(self.times):
                raise MotionError("keyframes-times", f"{joint} has {len(keys)} keys for {len(self.times)} times")
            if np.shape(keys) != (len(keys), 3) or not np.isfinite(keys).all():
                raise MotionError("keyframes-finite", f"{joint} has keys that are not three finite numbers each")

    @classmethod
    def cycle(cls, joint: str, axis: str, degrees: float, seconds: float, times: int = 1) -> Keyframes:
        """Turn one joint about its own x, y or z axis and back again, `times` times, `seconds` each."""
        if axis not in ("x", "y", "z"):
            raise ValueError(f"axis must be x, y or z; got {axis!r}")
        if not seconds * times > 0:
            raise MotionError("keyframes-times", f"keyframes last more than 0 s; got {seconds * times:g} s")
        _check_duration(seconds * times, "keyframes")
        peak = tuple(np.radians(degrees) * (name == axis) for name in "xyz")
        rest = (0.0, 0.0, 0.0)
        marks = tuple(seconds / 2 * index for index in range(2 * times + 1))
        keys = tuple(peak if index % 2 else rest for index in range(2 * times + 1))
        return cls(marks, {joint: keys})

    @property
    def frames(self) -> int:
        """As many as the keys last, rounded up to whole 15-frame chunks."""
        return -(-int(np.ceil(self.times[-1] * FPS - 1e-9)) // FUTURE) * FUTURE

    def over(self, pose: Motion) -> Motion:
        """Play on the last frame of a motion, a frame of `frames` each."""
        frames = self.frames
        clock = np.minimum(np.arange(1, frames + 1) / FPS, self.times[-1])
        root = np.repeat(pose.root[-1:], frames, axis=0)
        rotations = np.repeat(pose.rotations[-1:], frames, axis=0)
        for joint, keys in self.rotations.items():
            offsets = _smooth(clock, np.array(self.times), np.array(keys, float))
            index = JOINT_INDEX[joint]
            turned = matrix_from_vector(rotations[:, index]) @ matrix_from_vector(offsets)
            rotations[:, index] = vector_from_matrix(turned)
        return Motion(root, rotations)


def _smooth(clock: np.ndarray[Any, Any], times: np.ndarray[Any, Any], keys: np.ndarray[Any, Any]) -> Any:
    """Interpolate keys with zero velocity at each of them."""
    index = np.clip(np.searchsorted(times, clock, side="right") - 1, 0, len(times) - 2)
    share = (clock - times[index]) / (times[index + 1] - times[index])
    ease = smoothstep(share)[:, None]
    return keys[index] * (1 - ease) + keys[index + 1] * ease


Part = Control | Keyframes
Plan = Part | Sequence[Part]
"""What a call plays: one part, or a sequence of them, each begun where the one before it has left the body."""


def parts(plan: Plan) -> tuple[Part, ...]:
    """Return what a plan plays, in order. Raises MotionError if it is no plan, or lasts more than 10 s."""
    found = (plan,) if isinstance(plan, Part) else tuple(plan) if isinstance(plan, Sequence) else ()
    if not found or not all(isinstance(part, Part) for part in found):
        expected = "a skill returns a Control, Keyframes or a sequence of them"
        raise MotionError("plan-kind", f"{expected}; got {str(plan)[:_LONGEST_FAULT]!r}")
    _check_duration(sum(part.frames if isinstance(part, Keyframes) else FUTURE for part in found) / FPS, "a call")
    return found


def _check_duration(seconds: float, what: str) -> None:
    if not seconds <= LONGEST_CALL:  # Also NaN.
        raise MotionError("duration", f"{what} may last at most {LONGEST_CALL:g} s; got {seconds:g} s")


@dataclass(frozen=True)
class Skill:
    """One atomic skill. Build it with Skill.from_folder or with the @skill decorator."""

    name: str
    description: str
    schema: Mapping[str, Any]
    """JSON Schema 2020-12 of the parameters: an object, integers in centimetres and degrees."""
    plan: Callable[[Mapping[str, Any]], Plan] = field(repr=False)
    """Checked parameters to motion."""
    checks: tuple[Check, ...] = ()
    adapter: Path | None = None
    """Checkpoint of the ControlNet branch; None for a skill that plays keyframes."""
    role: Role = "gesture"
    """What the skill is for: `x-role` in schema.json. A call of role `stop` is the active stop of an episode."""

    source: Path | None = field(default=None, compare=False)
    """The folder or the Python file that it was read from."""

    def __post_init__(self) -> None:
        for fault in refusals(self):
            raise fault

    @property
    def trained(self) -> bool:
        """Whether the skill can run: it needs no adapter, or its adapter is there."""
        return self.adapter is None or self.adapter.is_file()

    @property
    def declaration(self) -> Declaration:
        """What the skill says of itself: its role, and the measures that its parameters command."""
        return Declaration.of(self.name, {**self.schema, "x-role": self.role})

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its parameters with the measures that they command, in the order of the schema."""
        return parameters_of(self.schema)

    def check(self, params: Mapping[str, Any]) -> dict[str, Any]:
        """Return the parameters with defaults filled in, integers as such: JSON knows no difference between 2 and 2.0.

        Raises CallError, written for the model, if the schema refuses them.
        """
        properties = self.schema.get("properties", {})
        filled = {key: part["default"] for key, part in properties.items() if "default" in part} | dict(params)
        validator = jsonschema.Draft202012Validator(dict(self.schema), registry=OFFLINE)
        faults = sorted(validator.iter_errors(filled), key=lambda fault: list(map(str, fault.absolute_path)))
        if faults:
            lines = "; ".join(_explain(fault) for fault in faults)
            raise CallError(f"{self.name} was not executed: {lines}. {self.usage()}")
        if odd := [key for key, value in filled.items() if not _is_finite(value)]:
            raise CallError(f"{self.name} was not executed: {odd[0]} is no finite number. {self.usage()}")
        return {key: _whole(filled[key], part) for key, part in properties.items() if key in filled}

    def usage(self) -> str:
        """Write one line that says how to call the skill."""
        parts = [
            f"{key}: {part.get('type', 'value')} {bounds(part, '..')}".strip()
            for key, part in self.schema.get("properties", {}).items()
        ]
        return f"Call {self.name} with {{{', '.join(parts)}}}."

    @classmethod
    def from_folder(cls, folder: Path) -> Self:
        """Load schema.json, checklist.toml (optional) and the place of adapter.safetensors; the folder names the
        skill."""
        schema = read_schema(folder)
        adapter, (checks, faults) = folder / "adapter.safetensors", read_checks(folder / "checklist.toml")
        for fault in faults:
            raise fault
        return cls.of_schema(folder.name, schema, checks, adapter)

    @classmethod
    def of_schema(cls, name: str, schema: Mapping[str, Any], checks: tuple[Check, ...], adapter: Path) -> Self:
        """Make a skill whose parameters are those of its adapter, as schema.json declares them."""

        def plan(params: Mapping[str, Any]) -> Control:
            return Control(adapter, {si_name(key): to_si(key, value) for key, value in params.items()})

        rest = {word: value for word, value in schema.items() if word not in ("description", "x-role")}
        role = schema.get("x-role", "gesture")
        return cls(name, schema.get("description", ""), rest, plan, checks, adapter, role, adapter.parent)


def refusals(skill: Skill) -> Iterator[ContractError]:
    """Why something is no skill at all: nothing can be made of a name or a schema like that."""
    name, schema = skill.name, skill.schema
    if not isinstance(name, str) or not NAME_PATTERN.fullmatch(name):
        yield ContractError("name", f"skill name {name!r} does not match {NAME_PATTERN.pattern}.", "Rename the skill.")
    if name in RESERVED:
        taken = f"skill name {name!r} is taken: a harness has a tool of that name."
        yield ContractError("name-reserved", taken, "Rename the skill.")
    if schema.get("type") != "object":
        wrong = f"the schema of skill {name!r} must have type 'object'."
        yield ContractError("schema-object", wrong, "Mend its schema.json.")
    if skill.role not in ROLES:
        known = f"Set x-role in its schema.json to one of: {', '.join(ROLES)}."
        yield ContractError("role", f"skill {name!r} has the role {skill.role!r}.", known)
    try:
        jsonschema.Draft202012Validator.check_schema(dict(schema))
    except jsonschema.SchemaError as error:
        invalid = f"the schema of skill {name!r} is not valid: {error.message}."
        yield ContractError("schema-valid", invalid, "Mend its schema.json.")
    for foreign in dict.fromkeys(_foreign(schema)):
        leads = f"the schema of skill {name!r} has {foreign}."
        yield ContractError("references", leads, "Refer to #/$defs/NAME alone.")


def read_checks(path: Path) -> tuple[tuple[Check, ...], tuple[ContractError, ...]]:
    """Read `[[check]]` tables of id and question, and tell of anything else, which would go unasked."""
    if not path.exists():
        return (), ()
    try:
        content = tomllib.loads(path.read_text("utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        return (), (_bad_checklist("checklist-file", path, str(error)),)
    faults = [_bad_checklist("checklist-words", path, f"it has {word!r}") for word in sorted(set(content) - {"check"})]
    entries = content.get("check", [])
    entries = entries if isinstance(entries, list) else [entries]
    wrong = sum(not _is_check(entry) for entry in entries) or not isinstance(content.get("check", []), list)
    if wrong:
        faults.append(_bad_checklist("checklist-tables", path, "a check is not a table of the texts id and question"))
    return tuple(Check(**entry) for entry in entries if _is_check(entry)), tuple(faults)


def _is_check(entry: object) -> bool:
    if not isinstance(entry, dict) or set(entry) != {"id", "question"}:
        return False
    return all(isinstance(text, str) for text in entry.values())


def _bad_checklist(check: str, path: Path, why: str) -> ContractError:
    return ContractError(
        check,
        f"skill folder {path.parent.name!r}: checklist.toml is not valid: {why}.",
        'Write one table a check: [[check]], id = "...", question = "...".',
    )


def _is_finite(value: Any) -> bool:
    """Whether all numbers in a value are: JSON Schema holds NaN to no bound."""
    if isinstance(value, float):
        return math.isfinite(value)
    inner = value.values() if isinstance(value, Mapping) else value if isinstance(value, list | tuple) else ()
    return all(map(_is_finite, inner))


def _whole(value: Any, part: Mapping[str, Any]) -> Any:
    """Return what JSON Schema takes for an integer as one, also in a list."""
    if isinstance(value, list) and isinstance(part.get("items"), Mapping):
        return [_whole(inner, part["items"]) for inner in value]
    return int(value) if part.get("type") == "integer" and isinstance(value, float) else value


def _foreign(schema: Any) -> Iterator[str]:
    """Return references that lead out of a schema, or that change what others mean: what is checked must be what is
    published."""
    if isinstance(schema, list):
        for part in schema:
            yield from _foreign(part)
    if not isinstance(schema, Mapping):
        return
    for key, value in schema.items():
        if key in _NO_WORDS or (key == "$ref" and not _LOCAL.fullmatch(str(value))):
            yield f"{key} {value!r}"
        yield from _foreign(value)


def _explain(fault: jsonschema.ValidationError) -> str:
    """One fault in words; what a model wrote at length is not said back to it whole."""
    where = ".".join(map(str, fault.absolute_path))
    message = fault.message if len(fault.message) <= _LONGEST_FAULT else f"{fault.message[:_LONGEST_FAULT]}..."
    return f"{where}: {message}" if where else message


def bounds(part: Mapping[str, Any], between: str = " to ") -> str:
    """Write the bounds of a parameter as text, such as "0 to 80"; empty where its schema has none."""
    return f"{part['minimum']}{between}{part['maximum']}" if {"minimum", "maximum"} <= part.keys() else ""


F = TypeVar("F", bound=Callable[..., Plan])


def skill(checks: Sequence[str | Check] = (), name: str | None = None, role: Role = "gesture") -> Callable[[F], Skill]:
    """Make a Skill of a function: its name, docstring and annotated arguments are the contract, its result the
    motion."""

    if callable(checks):
        raise PluginError("@skill stands without parentheses.", "Write @skill(), or @skill(checks=[...]).")
    if isinstance(checks, str):
        raise PluginError(f"checks is the text {checks!r}.", "Give a list of questions: checks=[...].")

    def wrap(function: F) -> Skill:
        title = name or function.__name__
        schema = _signature_schema(function)
        listed = tuple(
            item if isinstance(item, Check) else Check(f"{title}_{number}", item)
            for number, item in enumerate(checks, start=1)
        )
        told, source = inspect.getdoc(function) or "", Path(inspect.getfile(function))
        return Skill(title, told, schema, lambda params: function(**params), listed, None, role, source)

    return wrap


def _signature_schema(function: Callable[..., Plan]) -> dict[str, Any]:
    """Return the JSON schema of a function's arguments, read off its annotations."""
    hints = inspect.get_annotations(function, eval_str=True)
    arguments = inspect.signature(function).parameters
    properties = {key: _argument_schema(function, argument, hints) for key, argument in arguments.items()}
    types = _hoisted(function, properties)
    required = [key for key, part in properties.items() if "default" not in part]
    schema = {"type": "object", "properties": properties, "required": required, "additionalProperties": False}
    return {**schema, "$defs": types} if types else schema


def _argument_schema(
    function: Callable[..., Plan], argument: inspect.Parameter, hints: Mapping[str, Any]
) -> dict[str, Any]:
    where = f"argument {argument.name!r} of skill {function.__name__!r}"
    if argument.kind not in (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY):
        told = f"{where} is {argument.kind.description}."
        raise PluginError(told, "Take each parameter of a call by its name: no *, ** or /.")
    if argument.name not in hints:
        raise PluginError(f"{where} has no type.", "Annotate it, as in int.")
    adapter: TypeAdapter[Any] = TypeAdapter(hints[argument.name])
    if argument.default is inspect.Parameter.empty:
        return adapter.json_schema()
    return adapter.json_schema() | {"default": adapter.dump_python(argument.default, mode="json", warnings=False)}


def _hoisted(function: Callable[..., Plan], properties: Mapping[str, dict[str, Any]]) -> dict[str, Any]:
    """Take the types that arguments are made of out of their schemas: what refers to one looks for it in the whole."""
    types: dict[str, Any] = {}
    for part in properties.values():
        for name, one in part.pop("$defs", {}).items():
            if types.setdefault(name, one) != one:
                told = f"skill {function.__name__!r} has two types of the name {name!r}."
                raise PluginError(told, "Rename one of them.")
    return types
