"""Skill calls as vectors of integers, a form that every reinforcement-learning library takes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.spaces import MultiDiscrete
from numpy.typing import NDArray

from humanclaw import Call, HumanclawError, Skill
from humanclaw.skills import parameter_schema

Action = NDArray[np.int64]
_MAX_LEVELS = 10_000  # A policy has an output for each level.


@dataclass(frozen=True)
class Parameter:
    """A parameter of a skill and its possible values, in order."""

    skill: str
    name: str
    values: tuple[Any, ...]


class Actions:
    """The first number of an action selects the skill; each further number selects a value of one skill's parameter.

    Numbers of other skills are ignored. Skills with parameters other than bounded integers, booleans or choices do not
    fit into a vector; `left_out` names them.
    """

    def __init__(self, skills: Mapping[str, Skill]) -> None:
        """Build the space, without untrained skills. Raises HumanclawError if no skill is left."""
        tables = {name: _parameters(skill) for name, skill in skills.items() if skill.trained}
        usable = {name: table for name, table in tables.items() if table is not None}
        if not usable:
            raise HumanclawError("no skill can be called by an environment.", "Install one: humanclaw-skill-walk.")
        self.skills = tuple(sorted(usable))
        self.left_out = tuple(sorted(set(skills) - set(usable)))
        self.parameters = tuple(parameter for name in self.skills for parameter in usable[name])
        self.space = MultiDiscrete([len(self.skills), *(len(parameter.values) for parameter in self.parameters)])

    def decode(self, action: Action) -> Call:
        """Return the call of an action. Raises ValueError for an action outside the space."""
        numbers = np.asarray(action)
        if not self.space.contains(numbers.astype(self.space.dtype)):
            raise ValueError(
                f"an action is {len(self.parameters) + 1} integers below {self.space.nvec}; got {action!r}"
            )
        skill = self.skills[int(numbers[0])]
        chosen = zip(self.parameters, numbers[1:], strict=True)
        return Call(skill, {p.name: p.values[int(index)] for p, index in chosen if p.skill == skill})

    def encode(self, skill: str, **params: Any) -> Action:
        """Return the action of a call. An omitted parameter takes its value nearest to 0.

        Raises ValueError for an unknown skill or parameter, or an impossible value.
        """
        if skill not in self.skills:
            raise ValueError(f"there is no skill {skill!r} among {', '.join(self.skills)}")
        own = {parameter.name for parameter in self.parameters if parameter.skill == skill}
        if unknown := sorted(set(params) - own):
            raise ValueError(f"{skill} has no parameter {unknown[0]!r}; it has {', '.join(sorted(own)) or 'none'}")
        indices = [_index(p, params) if p.skill == skill else 0 for p in self.parameters]
        return np.array([self.skills.index(skill), *indices], dtype=np.int64)


def _index(parameter: Parameter, params: Mapping[str, Any]) -> int:
    if parameter.name not in params:
        return min(range(len(parameter.values)), key=lambda index: _size(parameter.values[index]))
    if params[parameter.name] not in parameter.values:
        first, last = parameter.values[0], parameter.values[-1]
        raise ValueError(f"{parameter.name} must be {first} to {last}; got {params[parameter.name]!r}")
    return parameter.values.index(params[parameter.name])


def _size(value: Any) -> float:
    return abs(value) if isinstance(value, int | float) else 0.0


def _parameters(skill: Skill) -> tuple[Parameter, ...] | None:
    """Return a skill's parameters; None if one has no finite list of values."""
    parameters = [Parameter(skill.name, name, _values(part)) for name, part in parameter_schema(skill).items()]
    return tuple(parameters) if all(parameter.values for parameter in parameters) else None


def _values(part: Mapping[str, Any]) -> tuple[Any, ...]:
    if "enum" in part:
        return tuple(part["enum"])
    if part.get("type") == "boolean":
        return (False, True)
    if part.get("type") == "integer" and {"minimum", "maximum"} <= set(part):
        steps = range(part["minimum"], part["maximum"] + 1, part.get("multipleOf", 1))
        return tuple(steps) if len(steps) <= _MAX_LEVELS else ()
    return ()
