"""The skill contract: a name, a role, a JSON schema, a checklist, and a way from parameters to motion.

A skill is atomic and body-local (paper, section 3.3). It never sees a scene.
"""

from __future__ import annotations

import inspect
import math
import os
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Self

from humanclaw.errors import CallError, CheckpointError, ContractError, PluginError
from humanclaw.skills.call import Call
from humanclaw.skills.measures import Parameter, Role, from_si, parameters_of, read_schema, si_name, to_si
from humanclaw.skills.plan import LONGEST_FAULT, Control
from humanclaw.skills.plan_motion import Part, Plan, parts
from humanclaw.skills.proprioception import ProprioceptiveState
from humanclaw.storage.files import read_file
from humanclaw.text.words import did_you_mean

if TYPE_CHECKING:
    import jsonschema

_STEPS: Final = frozenset({"hips.rise", "hips.drop"})
_CHECKLIST: Final = 16 << 10
"""Largest checklist.toml, bytes: a key of many dotted parts takes a time that grows with its square."""


@dataclass(frozen=True)
class Check:
    """One question of a skill's checklist (paper, appendix A)."""

    id: str
    question: str
    """Answered yes or no from the current view alone; yes lets the call pass."""


@dataclass(frozen=True)
class Skill:
    """One atomic skill. Build it with Skill.from_folder or with the @skill decorator."""

    name: str
    description: str
    schema: Mapping[str, Any]
    """JSON Schema 2020-12 of the parameters, of the form that skill_schema.json demands: flat, integers in centimetres
    and degrees."""
    plan: Callable[..., Plan] = field(repr=False, compare=False)
    """Checked parameters to motion: plan(params), or plan(params, body) for a skill that feels its own body."""
    checks: tuple[Check, ...] = ()
    adapter: Path | None = None
    """Checkpoint of the ControlNet branch; None for a skill that plays keyframes."""
    role: Role = "gesture"
    """The purpose of the skill: `x-role` in schema.json. A call of role `stop` is the active stop of an episode."""

    source: Path | None = field(default=None, compare=False)
    """The folder or the Python file that it was read from."""

    @property
    def trained(self) -> bool:
        """Whether the skill can run: it needs no adapter, or its adapter is there."""
        return self.adapter is None or self.adapter.is_file()

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its parameters with the measures that they command, in the order of the schema."""
        return parameters_of(self.schema)

    @property
    def primary(self) -> Parameter | None:
        """The parameter of the ratio of achieved over commanded: the first required one, else the first of all."""
        required = list(self.schema.get("required", ()))[:1]
        return next((part for part in self.parameters if part.key in required), next(iter(self.parameters), None))

    def commands(self, measure: str) -> Parameter | None:
        """Return the parameter that commands a measure, or None."""
        return next((parameter for parameter in self.parameters if parameter.measure == measure), None)

    def call(self, amounts: Mapping[str, float], side: str = "") -> Call:
        """Return the call that commands amounts of measures (SI), and 0 of all other measures.

        Each parameter is rounded to its unit and clipped to its bounds. side: which hand, where one is named.
        """
        params: dict[str, Any] = {}
        for part in self.parameters:
            if math.isfinite(part.low):  # A parameter without bounds is no number: a side is a word.
                values = (part.low, amounts.get(part.measure, 0.0), part.high)
                low, amount, high = (round(from_si(part.key, value)) for value in values)
                params[part.key] = min(max(amount, low), high)
        words = self.schema.get("properties", {}).items() if side else ()
        params |= {key: side for key, part in words if {"left", "right"} == set(part.get("enum", ()))}
        return Call(self.name, params)

    @property
    def climbs(self) -> bool:
        """Whether it takes the body up or down a step."""
        return any(parameter.measure in _STEPS for parameter in self.parameters)

    def order(self, names: Sequence[str]) -> tuple[Parameter, ...]:
        """Return the parameters in the order of an adapter's names. Raises PluginError unless both name the same."""
        known = {parameter.name: parameter for parameter in self.parameters}
        if sorted(known) != sorted(names):
            raise PluginError(
                f"the adapter of skill {self.name!r} was trained on ({', '.join(names)}), "
                f"and its schema.json declares ({', '.join(known)}).",
                f"Mend schema.json, or train it again with `humanclaw train adapter {self.name}`.",
            )
        return tuple(known[name] for name in names)

    def check(self, params: Mapping[str, Any]) -> dict[str, Any]:
        """Return the parameters with defaults filled in, integers as such: JSON knows no difference between 2 and 2.0.

        Raises CallError, written for the model, if the schema refuses them.
        """
        properties = self.schema.get("properties", {})
        filled = {key: part["default"] for key, part in properties.items() if "default" in part} | dict(params)
        if faults := faults_of(filled, self.schema):
            raise CallError(f"{self.name} was not executed: {'; '.join(faults)}. {self.usage()}")
        worded = (key for key in properties.keys() & filled.keys() if properties[key].get("minLength"))
        if blank := [key for key in worded if not str(filled[key]).strip()]:
            raise CallError(f"{self.name} was not executed: {blank[0]} is blank. {self.usage()}")
        # JSON Schema holds NaN to no bound.
        numbers = ((key, number) for key, value in filled.items() for number in _numbers(value))
        if odd := [key for key, number in numbers if isinstance(number, float) and not math.isfinite(number)]:
            raise CallError(f"{self.name} was not executed: {odd[0]} is no finite number. {self.usage()}")
        return {key: _whole(filled[key], part) for key, part in properties.items() if key in filled}

    @property
    def feels(self) -> bool:
        """Whether its plan depends on what the body feels of itself."""
        return "body" in inspect.signature(self.plan).parameters

    def planned(self, params: Mapping[str, Any], body: ProprioceptiveState | None) -> tuple[Part, ...]:
        """Return the parts of a checked call. body: only for a skill that feels it.

        Raises MotionError for a plan that cannot be played.
        """
        return parts(self.plan(params, body) if self.feels else self.plan(params))

    def usage(self) -> str:
        """Write one line that says how to call the skill."""
        parts = [
            f"{key}: {part.get('type', 'value')} {values(part)}".strip()
            for key, part in self.schema.get("properties", {}).items()
        ]
        return f"Call {self.name} with {{{', '.join(parts)}}}."

    @classmethod
    def from_folder(cls, folder: Path | str) -> Self:
        """Load schema.json, checklist.toml (optional) and the place of adapter.safetensors; the folder names the
        skill."""
        folder = Path(folder)
        schema = read_schema(folder)
        adapter, (checks, faults) = folder / "adapter.safetensors", read_checks(folder / "checklist.toml")
        for fault in faults:
            raise fault
        return cls.of_schema(folder.name, schema, checks, adapter)

    @classmethod
    def of_schema(
        cls, name: str, schema: Mapping[str, Any], checks: tuple[Check, ...] = (), adapter: Path = Path()
    ) -> Self:
        """Make a skill whose parameters are those of its adapter, as schema.json declares them."""

        def plan(params: Mapping[str, Any]) -> Control:
            return Control(adapter, {si_name(key): to_si(key, value) for key, value in params.items()})

        rest = {word: value for word, value in schema.items() if word not in ("description", "x-role")}
        role = schema.get("x-role", "gesture")
        return cls(name, schema.get("description", ""), rest, plan, checks, adapter, role, adapter.parent)


def suited(skills: Iterable[Skill], *measures: str, role: Role = "locomotion") -> Skill | None:
    """Of the skills of a role that command all these measures the one that commands least besides; the first of
    equals. One that goes up or down a step is suited to nothing else: where no step is asked for, there is none."""
    step = not _STEPS.isdisjoint(measures)
    fitting = [skill for skill in skills if skill.role == role and all(map(skill.commands, measures))]
    fitting = [skill for skill in fitting if step or not skill.climbs]
    return min(fitting, key=lambda skill: len(skill.parameters), default=None)


def find_suited(skills: Iterable[Skill], *measures: str, role: Role = "locomotion") -> Skill:
    """Return the suited skill. Raises PluginError if there is none, or if its adapter is not trained."""
    skill = suited(skills, *measures, role=role)
    if skill is None:
        wanted = f"a skill of role {role}" + (f" that commands {', '.join(measures)}" if measures else "")
        remedy = "Install the first-party skills, for tasks of hands also the extra hands."
        raise PluginError(f"this needs {wanted}, and none is installed.", remedy)
    if not skill.trained:
        missing = untrained(skill)
        raise PluginError(missing.message, missing.remedy)  # Of every episode, so that a run ends.
    return skill


def untrained(skill: Skill) -> CheckpointError:
    """Return the error for a skill whose adapter is missing."""
    return CheckpointError(
        f"skill {skill.name!r} has no trained adapter: there is no {skill.adapter}.",
        f"Train it with `humanclaw train adapter --skill {skill.adapter.parent if skill.adapter else skill.name}`.",
    )


def faults_of(value: object, schema: Mapping[str, Any]) -> list[str]:
    """Return what keeps a value from fitting a JSON schema, a sentence each."""
    import jsonschema  # Imported here: training, which needs numpy alone, checks no call.

    errors = jsonschema.Draft202012Validator(dict(schema)).iter_errors(value)
    return [_explain(fault) for fault in sorted(errors, key=lambda fault: list(map(str, fault.absolute_path)))]


def read_checks(path: Path) -> tuple[tuple[Check, ...], tuple[ContractError, ...]]:
    """Read `[[check]]` tables of id and question, and tell of anything else, which would go unasked."""
    if not os.path.lexists(path):
        return (), ()
    try:
        content = tomllib.loads(read_file(path, _CHECKLIST).decode("utf-8"))
    except (OSError, ValueError, RecursionError) as error:
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


def _numbers(value: Any) -> list[Any]:
    """Return the values of a flat parameter."""
    return value if isinstance(value, list) else [value]


def _whole(value: Any, part: Mapping[str, Any]) -> Any:
    """Return what JSON Schema takes for an integer as one, also in a list."""
    if isinstance(value, list):
        return [_whole(inner, part["items"]) for inner in value]
    return int(value) if part.get("type") == "integer" and isinstance(value, float) else value


def _explain(fault: jsonschema.ValidationError) -> str:
    """Return one fault in words; long text of a model is shortened."""
    where = ".".join(map(str, fault.absolute_path))
    message = fault.message if len(fault.message) <= LONGEST_FAULT else f"{fault.message[:LONGEST_FAULT]}..."
    return f"{where}: {message}" if where else message


def bounds(part: Mapping[str, Any], between: str = " to ") -> str:
    """Write the bounds of a parameter as text, such as "0 to 80"; empty where its schema has none."""
    return f"{part['minimum']}{between}{part['maximum']}" if {"minimum", "maximum"} <= part.keys() else ""


def values(part: Mapping[str, Any]) -> str:
    """Write the values that a parameter takes, such as "0..80" or "1|2|3"; empty where its schema limits none."""
    return "|".join(map(str, part["enum"])) if "enum" in part else bounds(part, "..")


def check_call(call: Call, skills: Mapping[str, Skill]) -> Call:
    """Return the call with defaults filled in. Raises CallError, whose text is for the model."""
    if call.skill not in skills:
        message = f"Nothing was executed: there is no skill {call.skill[:64]!r}."
        known = f"The skills are {', '.join(skills)}."
        raise CallError(" ".join(filter(None, (message, did_you_mean(call.skill, skills), known))))
    skill = skills[call.skill]
    if not skill.trained:
        raise CallError(
            f"Nothing was executed: {call.skill} is not available, its adapter is not trained. Use another skill."
        )
    return Call(call.skill, skill.check(call.params))
