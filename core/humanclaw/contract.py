"""The skill contract: a name, a role, a JSON schema, a checklist, and a way from parameters to motion.

A skill is atomic and body-local (paper, section 3.3). It never sees a scene. It turns its parameters into a Control,
for the motion model with this skill's adapter, or into Keyframes, played as they are.
"""

from __future__ import annotations

import inspect
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, TypeVar

import jsonschema
import numpy as np
from pydantic import TypeAdapter
from referencing import Registry

from humanclaw.body import JOINT_INDEX
from humanclaw.errors import CallError, PluginError
from humanclaw.measures import ROLES, Declaration, Parameter, Role, read_schema, role_of, si_name, to_si
from humanclaw.pose import FPS, FUTURE, Motion, matrix_from_vector, smoothstep, vector_from_matrix

NAME_PATTERN: Final = re.compile(r"[a-zA-Z0-9_-]{1,64}")
RESERVED: Final = frozenset({"look", "reset", "verdict"})
"""Tools that harnesses offer beside the skills."""
OFFLINE: Final[Registry[Any]] = Registry()
"""For jsonschema, which would otherwise fetch what a $ref names."""
_LONGEST_FAULT: Final = 300
_LONGEST_PLAY: Final = 60.0
"""Seconds of keyframes that one call may play."""
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


@dataclass(frozen=True)
class Keyframes:
    """Rotations laid over the pose in which the body is, played without the motion model.

    times: seconds, increasing from 0 to at most 60. rotations: joint name to one rotation vector (radians, joint frame)
    a time.
    """

    times: tuple[float, ...]
    rotations: Mapping[str, tuple[tuple[float, float, float], ...]]

    def __post_init__(self) -> None:
        unknown = sorted(set(self.rotations) - set(JOINT_INDEX))
        if unknown:
            raise ValueError(f"unknown joint {unknown[0]!r}; the joints are {', '.join(JOINT_INDEX)}")
        if len(self.times) < 2 or self.times[0] != 0 or not all(np.diff(self.times) > 0):
            raise ValueError(f"key times must start at 0 and increase; got {self.times[:9]}")
        if not self.times[-1] <= _LONGEST_PLAY:  # Also NaN.
            raise ValueError(f"keyframes last at most {_LONGEST_PLAY:g} s; got {self.times[-1]:g} s")
        for joint, keys in self.rotations.items():
            if len(keys) != len(self.times):
                raise ValueError(f"{joint} has {len(keys)} keys for {len(self.times)} times")
            if not np.isfinite(keys).all():
                raise ValueError(f"{joint} has keys that are not finite")

    @classmethod
    def cycle(cls, joint: str, axis: str, degrees: float, seconds: float, times: int = 1) -> Keyframes:
        """Turn one joint about its own x, y or z axis and back again, `times` times, `seconds` each."""
        if axis not in ("x", "y", "z"):
            raise ValueError(f"axis must be x, y or z; got {axis!r}")
        if not 0 < seconds * times <= _LONGEST_PLAY:
            raise ValueError(f"keyframes last more than 0 s and at most {_LONGEST_PLAY:g} s; got {seconds * times:g} s")
        peak = tuple(np.radians(degrees) * (name == axis) for name in "xyz")
        rest = (0.0, 0.0, 0.0)
        marks = tuple(seconds / 2 * index for index in range(2 * times + 1))
        keys = tuple(peak if index % 2 else rest for index in range(2 * times + 1))
        return cls(marks, {joint: keys})

    def over(self, pose: Motion) -> Motion:
        """Play on the last frame of a motion: as many frames as the keys last, rounded up to whole 15-frame chunks."""
        frames = -(-int(np.ceil(self.times[-1] * FPS - 1e-9)) // FUTURE) * FUTURE
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


Plan = Control | Keyframes


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

    def __post_init__(self) -> None:
        if not NAME_PATTERN.fullmatch(self.name):
            raise PluginError(f"skill name {self.name!r} does not match {NAME_PATTERN.pattern}.", "Rename the skill.")
        if self.name in RESERVED:
            raise PluginError(
                f"skill name {self.name!r} is taken: a harness has a tool of that name.", "Rename the skill."
            )
        if self.schema.get("type") != "object":
            raise PluginError(f"the schema of skill {self.name!r} must have type 'object'.", "Mend its schema.json.")
        if self.role not in ROLES:
            raise PluginError(f"skill {self.name!r} has the role {self.role!r}.", f"Choose from: {', '.join(ROLES)}.")
        try:
            jsonschema.Draft202012Validator.check_schema(dict(self.schema))
        except jsonschema.SchemaError as error:
            raise PluginError(f"the schema of skill {self.name!r} is not valid: {error.message}.") from error
        if foreign := next(_foreign(self.schema), ""):
            raise PluginError(f"the schema of skill {self.name!r} has {foreign}.", "Refer to #/$defs/NAME alone.")

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
        return self.declaration.parameters

    def check(self, params: Mapping[str, Any]) -> dict[str, Any]:
        """Return the parameters with defaults filled in.

        Raises CallError, written for the model, if the schema refuses them.
        """
        properties = self.schema.get("properties", {})
        filled = {key: part["default"] for key, part in properties.items() if "default" in part} | dict(params)
        validator = jsonschema.Draft202012Validator(dict(self.schema), registry=OFFLINE)
        faults = sorted(validator.iter_errors(filled), key=lambda fault: list(map(str, fault.absolute_path)))
        if faults:
            lines = "; ".join(_explain(fault) for fault in faults)
            raise CallError(f"{self.name} was not executed: {lines}. {self.usage()}")
        return {key: filled[key] for key in properties if key in filled}

    def usage(self) -> str:
        """Write one line that says how to call the skill."""
        parts = [
            f"{key}: {part.get('type', 'value')} {bounds(part, '..')}".strip()
            for key, part in self.schema.get("properties", {}).items()
        ]
        return f"Call {self.name} with {{{', '.join(parts)}}}."

    @classmethod
    def from_folder(cls, folder: Path) -> Skill:
        """Load schema.json, checklist.toml (optional) and the place of adapter.safetensors; the folder names the
        skill."""
        schema = read_schema(folder)
        role = role_of(folder.name, schema)
        adapter, checks = folder / "adapter.safetensors", _load_checks(folder / "checklist.toml")
        description = schema.pop("description", "")
        schema.pop("x-role", None)

        def plan(params: Mapping[str, Any]) -> Control:
            return Control(adapter, {si_name(key): to_si(key, value) for key, value in params.items()})

        return cls(folder.name, description, schema, plan, checks, adapter, role)


def _load_checks(path: Path) -> tuple[Check, ...]:
    """Read `[[check]]` tables of id and question. Raises PluginError for anything else, which would go unasked."""
    if not path.exists():
        return ()
    try:
        content = tomllib.loads(path.read_text("utf-8"))
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise _bad_checklist(path, str(error)) from error
    if unknown := sorted(set(content) - {"check"}):
        raise _bad_checklist(path, f"it has {unknown[0]!r}")
    entries = content.get("check", [])
    if not isinstance(entries, list) or not all(_is_check(entry) for entry in entries):
        raise _bad_checklist(path, "a check is not a table of the texts id and question")
    return tuple(Check(**entry) for entry in entries)


def _is_check(entry: object) -> bool:
    if not isinstance(entry, dict) or set(entry) != {"id", "question"}:
        return False
    return all(isinstance(text, str) for text in entry.values())


def _bad_checklist(path: Path, why: str) -> PluginError:
    return PluginError(
        f"skill folder {path.parent.name!r}: checklist.toml is not valid: {why}.",
        'Write one table a check: [[check]], id = "...", question = "...".',
    )


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

    if isinstance(checks, str):
        raise PluginError(f"checks is the text {checks!r}.", "Give a list of questions: checks=[...].")

    def wrap(function: F) -> Skill:
        title = name or function.__name__
        schema = _signature_schema(function)
        listed = tuple(
            item if isinstance(item, Check) else Check(f"{title}_{number}", item)
            for number, item in enumerate(checks, start=1)
        )
        return Skill(
            title, inspect.getdoc(function) or "", schema, lambda params: function(**params), listed, None, role
        )

    return wrap


def _signature_schema(function: Callable[..., Plan]) -> dict[str, Any]:
    """Return the JSON schema of a function's arguments, read off its annotations."""
    hints = inspect.get_annotations(function, eval_str=True)
    properties: dict[str, Any] = {}
    for key, argument in inspect.signature(function).parameters.items():
        if key not in hints:
            raise PluginError(
                f"argument {key!r} of skill {function.__name__!r} has no type.", "Annotate it, as in int."
            )
        properties[key] = TypeAdapter(hints[key]).json_schema()
        if argument.default is not inspect.Parameter.empty:
            properties[key]["default"] = argument.default
    required = [key for key, part in properties.items() if "default" not in part]
    return {"type": "object", "properties": properties, "required": required, "additionalProperties": False}
