"""The decorator @skill: a function's name, docstring and annotated arguments are a skill's contract."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter

from humanclaw.errors import PluginError
from humanclaw.skills.contract import Check, Skill
from humanclaw.skills.measures import Role
from humanclaw.skills.plan_motion import Plan
from humanclaw.skills.proprioception import ProprioceptiveState

F = TypeVar("F", bound=Callable[..., Plan])


def skill(checks: Sequence[str | Check] = (), name: str | None = None, role: Role = "gesture") -> Callable[[F], Skill]:
    """Make a Skill of a function: its name, docstring and annotated arguments are the contract, its result the
    motion.

    An argument of type ProprioceptiveState is no parameter: it gets what the body feels of itself.
    """

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
        description, source = inspect.getdoc(function) or "", Path(inspect.getfile(function))
        return Skill(title, description, schema, _planner(function), listed, None, role, source)

    return wrap


def _planner(function: Callable[..., Plan]) -> Callable[..., Plan]:
    hints = inspect.get_annotations(function, eval_str=True)
    feeling = [name for name, hint in hints.items() if hint is ProprioceptiveState]
    if feeling:
        return lambda params, body: function(**params, **dict.fromkeys(feeling, body))
    return lambda params: function(**params)


def _signature_schema(function: Callable[..., Plan]) -> dict[str, Any]:
    """Return the JSON schema of a function's arguments, read off its annotations."""
    hints = inspect.get_annotations(function, eval_str=True)
    arguments = inspect.signature(function).parameters
    asked = {key: argument for key, argument in arguments.items() if hints.get(key) is not ProprioceptiveState}
    properties = {key: _argument_schema(function, argument, hints) for key, argument in asked.items()}
    required = [key for key, part in properties.items() if "default" not in part]
    return {"type": "object", "properties": properties, "required": required, "additionalProperties": False}


def _argument_schema(
    function: Callable[..., Plan], argument: inspect.Parameter, hints: Mapping[str, Any]
) -> dict[str, Any]:
    where = f"argument {argument.name!r} of skill {function.__name__!r}"
    if argument.kind not in (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY):
        message = f"{where} is {argument.kind.description}."
        raise PluginError(message, "Take each parameter of a call by its name: no *, ** or /.")
    if argument.name not in hints:
        raise PluginError(f"{where} has no type.", "Annotate it, as in int.")
    adapter: TypeAdapter[Any] = TypeAdapter(hints[argument.name])
    part = _inclusive(adapter.json_schema())
    if "const" in part:  # A Literal of one choice.
        part["enum"] = [part.pop("const")]
    if argument.default is not inspect.Parameter.empty:
        part["default"] = adapter.dump_python(argument.default, mode="json", warnings=False)
    return part


def _inclusive(part: dict[str, Any]) -> dict[str, Any]:
    """Turn exclusive bounds of integers into inclusive ones, which constrained decoders support."""
    if part.get("type") == "integer":
        for word, bound, step in (("exclusiveMinimum", "minimum", 1), ("exclusiveMaximum", "maximum", -1)):
            if word in part:
                part[bound] = int(part.pop(word)) + step
    return part
