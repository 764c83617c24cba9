"""Agents that do not see: one stands still, one acts at random, one wanders. They bound the metrics from below."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from humanclaw import Call, Decision, EpisodeContext, HistoryEntry, Observation, Skill
from humanclaw_scripted.actions import TURN, WALK, answering, asking, ending


class StillAgent:
    """Stops at once: the lower bound of every metric."""

    name = "still"
    privileged = False
    settings: Mapping[str, Any] = {}

    def begin(self, context: EpisodeContext) -> None:
        self._stop = ending(context.skills)

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        return Decision((Call(self._stop),), reasoning="I stop without trying.", mid_level_change="keep")


class GuessingAgent:
    """Answers at once with one of the options that an instruction ends in: chance. Stops where there are none."""

    name = "guess"
    privileged = False

    def __init__(self, first: bool = False) -> None:
        """first: always the first option, instead of one at random."""
        self._first = first
        self.settings: Mapping[str, Any] = {"first": True} if first else {}

    def begin(self, context: EpisodeContext) -> None:
        self._context = context

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        listed = re.findall(r"Answer with one of: (.+)\.$", self._context.spec.instruction)
        options = listed[0].split("; ") if listed else []
        if self._first:
            options = options[:1]
        skills, rng = self._context.skills, np.random.default_rng(self._context.seed)
        call = answering(skills, str(rng.choice(options))) if options else Call(ending(skills))
        return Decision((call,), reasoning="I guess.", mid_level_change="keep")


class RandomAgent:
    """Draws a trained skill uniformly, and its parameters uniformly from their bounds."""

    name = "random"
    privileged = False
    settings: Mapping[str, Any] = {}

    def begin(self, context: EpisodeContext) -> None:
        self._skills = {name: skill for name, skill in context.skills.items() if skill.trained}
        self._seed = context.seed

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        # The step is part of the seed, so that a resumed episode continues with the same draws.
        rng = np.random.default_rng([self._seed, observation.step])
        name = str(rng.choice(sorted(self._skills)))
        params = {key: _draw(part, rng) for key, part in _properties(self._skills[name]).items()}
        return Decision((Call(name, params),), reasoning="A random draw.", mid_level_change="keep")


class WanderingAgent:
    """Walks and turns at random and never stops: chance."""

    name = "wanderer"
    privileged = False

    def begin(self, context: EpisodeContext) -> None:
        self._context = context

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        # A stream of its own (80), so that it shares no draws with other scripted agents.
        rng = np.random.default_rng([self._context.seed, observation.step, 80])
        amounts = (rng.uniform(-0.1, 0.1), rng.uniform(0.2, 0.6), rng.uniform(-0.5, 0.5))
        turns = rng.random() < 0.3
        skills = self._context.skills
        call = asking(skills, TURN, (rng.uniform(-1.3, 1.3),)) if turns else asking(skills, WALK, amounts)
        return Decision((call,), reasoning="Somewhere else.", mid_level_change="keep")


def _draw(part: Mapping[str, Any], rng: np.random.Generator) -> Any:
    """Return a value that a parameter's schema allows."""
    if "enum" in part:
        return part["enum"][int(rng.integers(len(part["enum"])))]
    if part.get("type") == "boolean":
        return bool(rng.integers(2))
    if part.get("type") == "string":
        return str(rng.choice(["yes", "no"]))
    low, high = part.get("minimum", 0), part.get("maximum", 10)
    return int(rng.integers(low, high + 1)) if part.get("type") == "integer" else float(rng.uniform(low, high))


def _properties(skill: Skill) -> Mapping[str, Mapping[str, Any]]:
    return skill.schema.get("properties", {})  # type: ignore[no-any-return]  # A checked schema maps its properties.
