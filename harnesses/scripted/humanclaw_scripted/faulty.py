"""An agent that fails in known ways, and a verifier with true knowledge, to check ablations and root causes.

The agent is the oracle with one change, so every failure is due to that change. Its results say nothing about any
model; they show that harness and benchmark respond to a fault.

A `fault` removes a capability: root causes should find it. A `bounded` agent keeps its capabilities, but its memory,
attention and distance estimates have limits. The harness's settings (history, images, mid_level, a verifier) widen or
narrow these limits: the ablations of the paper's table 3 should show them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from humanclaw import Call, Decision, EpisodeContext, EpisodeSpec, HistoryEntry, Observation, Skill, Verdict
from humanclaw.body import Array
from humanclaw.records import REACHED, SEATS, Answer as CheckAnswer, Feedback, acknowledges
from humanclaw_scripted.actions import BACK, TURN, asking, ending
from humanclaw_scripted.behaviours import BEHAVIOURS, LOOK_AROUND, Snapshot
from humanclaw_scripted.faults import FAULTS, Fault
from humanclaw_scripted.ground_truth import Perception
from humanclaw_scripted.narration import Narrator
from humanclaw_scripted.options import FaultyOptions, VerifierOptions
from humanclaw_scripted.oracle import OracleAgent

AT_HAND: Final = 1.5
"""Distance to the target within which an agent sits down, metres."""


def oracle(context: EpisodeContext, spec: EpisodeSpec, words: str = "map") -> OracleAgent:
    """Return an oracle that has begun this episode with another task."""
    agent = OracleAgent(words)
    agent.begin(replace(context, spec=spec))
    return agent


class FaultyAgent:
    """The oracle with faults, with limits, or with both."""

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
        self._faults = self._chosen(spec)
        standing = any(fault.standing for fault in self._faults)
        task = spec.model_copy(update={"interact": False}) if standing else spec
        self._oracle = oracle(context, task, self.options.words)
        self._errand = self._to_another_seat() if any(fault.elsewhere for fault in self._faults) else None
        self._pads: dict[str, tuple[dict[str, int], list[Array]]] = {fault.name: ({}, []) for fault in self._faults}
        self._last_seen: int | None = None
        self._limits = BoundedRationality(self.options, self._perception, self._stop)
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

    def _chosen(self, spec: EpisodeSpec) -> tuple[Fault, ...]:
        """Return the faults of this episode, without those that it cannot show or that are repaired."""
        named = (FAULTS[name] for name in self.options.fault.split("+") if name in FAULTS)
        return tuple(fault for fault in named if fault.fits(spec) and fault.capability != self.options.repair)

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        if self._errand:
            errand = self._errand.decide(observation, history)
            if errand.calls[0].skill != self._stop:
                return errand
            self._errand = None
        decision = meant = self._oracle.decide(observation, history)
        seen = acknowledges(decision.visible_state, self._perception.context.spec.target_category)
        for fault in self._faults:
            decision = BEHAVIOURS[fault.name](self._snapshot(fault, decision, seen, observation.step))
        self._last_seen = observation.step if seen else self._last_seen
        if self.options.bounded:
            decision = self._limits.limit(decision, observation.step, self._last_seen, history)
        return self._told(decision, meant.visible_state, history)

    def _told(self, decision: Decision, seen: str, history: Sequence[HistoryEntry]) -> Decision:
        """Return the decision with words from the eyes, if asked for. What a fault claims to see stays: it is the
        fault. Its reasons would tell what only the map knows."""
        if self._narrator is None:
            return decision
        narrated = self._narrator(decision, history)
        claimed = narrated.visible_state if decision.visible_state == seen else decision.visible_state
        return replace(narrated, visible_state=claimed)

    def _snapshot(self, fault: Fault, decision: Decision, seen: bool, step: int) -> Snapshot:
        left = self._perception.context.spec.max_steps - step
        before = self._last_seen is not None
        pad = self._pads[fault.name]
        return Snapshot(self._perception, decision, left, seen, before, self._stop, self._begun, *pad)


# -- a bounded agent ---------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class BoundedRationality:
    """The oracle's decision, within limits.

    Memory: the agent knows the place of a target out of view for as many steps as the history has; then it looks
    around. Commitment: to turn its back on a seat and sit down takes several steps, and so a mid-level goal; without
    one the agent stops in front of the seat. Attention: among n pictures it may take an old one for the current one,
    and repeat the call that followed it. Distance: it may take a target in view within 4 m to be within reach.
    """

    options: FaultyOptions
    perception: Perception
    stop: str

    def limit(self, decision: Decision, step: int, last_seen: int | None, history: Sequence[HistoryEntry]) -> Decision:
        """Return the limited decision. last_seen: last step with the target in view, this one included, or None."""
        rng = np.random.default_rng([self.perception.context.seed, step, 78])
        # Every step draws all three numbers, so that one limit does not change the draws of another.
        draws = rng.random(3)
        old = self._mistaken_for(draws[:2], history)
        if old is not None:
            return replace(decision, calls=(old,), reasoning="The view is as it was: I do the same again.")
        if last_seen == step and 3 * REACHED < self.perception.away() < 4.0 and draws[2] < self.options.misjudged:
            return replace(decision, calls=(Call(self.stop),), reasoning="It looks close enough to touch, so I stop.")
        if last_seen is not None and step - last_seen > self.options.history:
            around = asking(self.perception.context.skills, TURN, (np.radians(LOOK_AROUND),))
            return replace(decision, calls=(around,), reasoning="I do not know where it is: I look around.")
        if not self.options.mid_level and last_seen is not None and self._in_routine(decision.calls[0]):
            return replace(decision, calls=(Call(self.stop),), reasoning="I stand before it, so I am done.")
        return decision

    def _mistaken_for(self, draws: Any, history: Sequence[HistoryEntry]) -> Call | None:
        """Return the call that followed an older view, if the agent takes that view for the current one."""
        others = min(self.options.images - 1, len(history))
        competing = self.options.confusion * others
        if not others or draws[0] >= competing / (1 + competing):
            return None
        return history[-1 - int(draws[1] * others)].executed

    def _in_routine(self, call: Call) -> bool:
        """Tell whether a call belongs to sitting down: the turn before the seat, the step back, or the sit."""
        skill = self.perception.context.skills[call.skill].declaration
        measures = tuple(parameter.measure for parameter in skill.parameters)
        sits = skill.role == "sit" or measures == BACK
        near = self.perception.context.spec.interact and self.perception.away() < AT_HAND
        return near and (sits or (measures == TURN and self.perception.reach() < 2 * REACHED))


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
