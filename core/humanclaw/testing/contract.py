"""The checks that every skill passes, ours and anybody else's."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from humanclaw._skill_check import skill_faults
from humanclaw.contract import Control, Keyframes, Skill
from humanclaw.errors import CallError
from humanclaw.measures import MEASURES, Measure
from humanclaw.motion.checkpoint import read_header, shipped_base


def check_skill(skill: Skill | Path, measures: Mapping[str, Measure] = MEASURES) -> Skill:
    """Hold a skill, or a skill folder, to the contract as the plugin host does, and play it at the corners of its
    bounds.

    measures: what its parameters may command; Plugins.measures has those of plugins too.
    Raises AssertionError that says what to mend; returns the skill.
    """
    loaded = Skill.from_folder(skill) if isinstance(skill, Path) else skill
    faults = skill_faults(loaded, measures, read_header(shipped_base())["digest"])
    assert not faults, " ".join(map(str, faults))
    _check_refusals(loaded)
    _check_plan(loaded)
    return loaded


def corners(skill: Skill) -> list[dict[str, Any]]:
    """Return the lowest and the highest legal call of a skill: all parameters at their minimum, and all at their
    maximum."""
    parts = skill.schema.get("properties", {})
    return [{key: _bound(part, end) for key, part in parts.items()} for end in ("minimum", "maximum")]


def _bound(part: Mapping[str, Any], end: str) -> Any:
    return part.get(end, part.get("default", 1))


def _check_refusals(skill: Skill) -> None:
    for legal in corners(skill):
        skill.check(legal)
        wrong: list[dict[str, Any]] = [legal | {"no_such_parameter": 1}]
        for key, part in skill.schema.get("properties", {}).items():
            wrong += [legal | {key: "a text"}, legal | {key: float("nan")}]
            wrong += [legal | {key: part["maximum"] + 1}] if "maximum" in part else []
            wrong += [legal | {key: part["minimum"] - 1}] if "minimum" in part else []
        for params in wrong:
            with pytest.raises(CallError):
                skill.check(params)


def _check_plan(skill: Skill) -> None:
    for legal in corners(skill):
        plan = skill.plan(skill.check(legal))
        assert isinstance(plan, Control | Keyframes), (
            f"{skill.name}: a skill returns a Control or Keyframes; got {plan!r}"
        )
        if isinstance(plan, Control):
            names = {parameter.name for parameter in skill.parameters}
            assert set(plan.values) == names, f"{skill.name}: one value a parameter, by its name without the unit"
