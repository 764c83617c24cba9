"""The verifier."""

from __future__ import annotations

from humanclaw import Call, EpisodeContext, Observation, Skill, Verdict
from humanclaw.measures import suited
from humanclaw.records import Answer


class ExampleVerifier:
    """Lets nobody stop before the third step: they look around instead."""

    name = "example"

    def __init__(self, least: int = 3) -> None:
        self.least = least

    def begin(self, context: EpisodeContext) -> None:
        """Find a skill that turns, to put in the place of a stop that comes too early."""
        turns = suited([skill.declaration for skill in context.skills.values()], "heading.left")
        parameter = turns.commands("heading.left") if turns else None
        self._instead = Call(turns.skill, {parameter.key: 30}) if turns and parameter else None

    def verify(self, observation: Observation, call: Call, skill: Skill, goal: str) -> Verdict:
        """Accept a call, or put another one in its place. `observation.rgb` is what the eyes see."""
        if skill.role != "stop" or observation.step >= self.least or self._instead is None:
            return Verdict(True)
        return Verdict(False, self._instead, (Answer("looked_around", False),))
