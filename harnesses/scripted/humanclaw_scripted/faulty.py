"""An agent that fails in known ways, and a verifier with true knowledge, to check root causes.

The agent is the oracle without one capability, so every failure is due to that: root causes should find it. Its results
say nothing about any model; they show that the benchmark responds to a fault.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from humanclaw import Call, Decision, EpisodeContext, EpisodeSpec, HistoryEntry, Observation, Skill, Verdict
from humanclaw.body import Array
from humanclaw.records import REACHED, SEATS, Answer as CheckAnswer, Feedback, acknowledges
from humanclaw_scripted.actions import ending
from humanclaw_scripted.behaviours import BEHAVIOURS, Snapshot
from humanclaw_scripted.faults import FAULTS, Fault
from humanclaw_scripted.ground_truth import Perception
from humanclaw_scripted.narration import Narrator
from humanclaw_scripted.options import FaultyOptions, VerifierOptions
from humanclaw_scripted.oracle import OracleAgent


def oracle(context: EpisodeContext, spec: EpisodeSpec, words: str = "map") -> OracleAgent:
    """Return an oracle that has begun this episode with another task."""
    agent = OracleAgent(words)
    agent.begin(replace(context, spec=spec))
    return agent


class FaultyAgent:
    """The oracle with a fault."""

    name = "faulty"
    privileged = True

    def __init__(self, given: FaultyOptions) -> None:
        self.options = given
        self.settings = given.model_dump()

    def begin(self, context: EpisodeContext) -> None:
        spec = context.spec
        self._perception = Perception(context)
        self._begun = spec.difficulty.distance if spec.difficulty else self._perception.away()
        self._stop = ending(context.skills)
        self._fault = self._shown(spec)
        standing = self._fault is not None and self._fault.standing
        task = spec.model_copy(update={"interact": False}) if standing else spec
        self._oracle = oracle(context, task, self.options.words)
        self._errand = self._to_another_seat() if self._fault and self._fault.elsewhere else None
        self._pad: tuple[dict[str, int], list[Array]] = {}, []
        self._has_seen = False
        self._narrator = Narrator() if self.options.words == "eyes" else None
        if self._narrator:
            self._narrator.begin(context)

    def _to_another_seat(self) -> OracleAgent:
        """Return an oracle that sits down on the nearest seat of another category than the target."""
        context, scene = self._perception.context, self._perception.context.scene
        assert scene is not None
        others = set(SEATS) - {context.spec.target_category}
        seats = tuple(obj.id for obj in scene.objects if obj.category in others)
        task = context.spec.model_copy(update={"target_ids": seats, "target_category": "seat"})
        return oracle(context, task, self.options.words)

    def _shown(self, spec: EpisodeSpec) -> Fault | None:
        """Return the fault; None if the episode cannot show it, or if it is repaired."""
        fault = FAULTS.get(self.options.fault)
        return fault if fault and fault.fits(spec) and fault.capability != self.options.repair else None

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        if self._errand:
            errand = self._errand.decide(observation, history)
            if errand.calls[0].skill != self._stop:
                return errand
            self._errand = None
        decision = meant = self._oracle.decide(observation, history)
        seen = acknowledges(decision.visible_state, self._perception.context.spec.target_category)
        if self._fault:
            decision = BEHAVIOURS[self._fault.name](self._snapshot(decision, seen, observation.step))
        self._has_seen |= seen
        return self._told(decision, meant.visible_state, history)

    def _told(self, decision: Decision, seen: str, history: Sequence[HistoryEntry]) -> Decision:
        """Return the decision with words from the eyes, if asked for. What a fault claims to see stays: it is the
        fault. Its reasons would tell what only the map knows."""
        if self._narrator is None:
            return decision
        narrated = self._narrator(decision, history)
        claimed = narrated.visible_state if decision.visible_state == seen else decision.visible_state
        return replace(narrated, visible_state=claimed)

    def _snapshot(self, decision: Decision, seen: bool, step: int) -> Snapshot:
        left = self._perception.context.spec.max_steps - step
        return Snapshot(self._perception, decision, left, seen, self._has_seen, self._stop, self._begun, *self._pad)


# -- a verifier -------------------------------------------------------------------------------------------------------
_NO_VIEW: Final = np.zeros((0, 0, 3), np.uint8)


class OracleVerifier:
    """Replaces a stop out of reach of the target by the oracle's call."""

    name = "oracle"
    privileged = True

    def __init__(self, given: VerifierOptions) -> None:
        self._miss = given.miss
        self.settings = given.model_dump()

    def begin(self, context: EpisodeContext) -> None:
        self._perception = Perception(context)
        self._oracle = oracle(context, context.spec)
        self._history: list[HistoryEntry] = []

    def verify(self, observation: Observation, call: Call, skill: Skill, goal: str) -> Verdict:
        advice = self._oracle.decide(observation, self._history)
        # Its own stream (79): the agent's draws of the same step must not decide what the verifier overlooks.
        lets_pass = np.random.default_rng([self._perception.context.seed, observation.step, 79]).random() < self._miss
        accepted = skill.role != "stop" or self._perception.reach() <= REACHED or lets_pass
        done = call if accepted else advice.calls[0]
        # The oracle learns from the executed call whether the body is blocked or sits. It recalls no view.
        self._history.append(HistoryEntry(observation.step, advice, Feedback(done), _NO_VIEW))
        answer = CheckAnswer("within_reach", accepted, "" if accepted else "The target is not within reach.")
        return Verdict(accepted, None if accepted else done, (answer,))
