"""Progressive success of tasks for hands, and the root cause of a failure, from the record alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import Final

import numpy as np

from humanclaw import RecordedEpisode, StepRecord
from humanclaw.body import JOINT_INDEX, Array
from humanclaw.records import (
    SEEN_PIXELS,
    Goal,
    Vec3,
    acknowledges,
    answered,
    brought,
    is_met,
    opened,
    role_of,
)
from humanclaw.world import distance_to_nearest
from humanclaw_bench.failure_modes import Rule, Stage, first_cause
from humanclaw_bench.hands import Family, family_of
from humanclaw_bench.oneself import STAGE

_HOLDING: Final[tuple[Stage, ...]] = ("find", "nav", "reach", "hold")
STAGES: Final[Mapping[Family, tuple[Stage, ...]]] = {
    "bring": (*_HOLDING, "place"),
    "tidy": (*_HOLDING, "place"),
    "open": (*_HOLDING, "open"),
    "look": (*_HOLDING, "open", "answer"),
}
"""What an episode of each family has to pass, in order."""
NEARBY: Final = 0.7
"""Metres over the floor from the pelvis to a thing: an arm's length."""
AT_HAND: Final = 0.12
"""Metres from the knuckles to a thing's box at which a hand has reached it."""
_STOREY: Final = 1.2
"""Metres from the pelvis up or down to a thing on the same floor."""
_ALSO: Final[Mapping[str, tuple[str, ...]]] = {
    "stove": ("oven",), "fridge": ("refrigerator",), "wardrobe": ("closet",), "cup": ("mug",)
}  # fmt: skip
"""Further words for a category: that of its instruction, and plain synonyms."""


def says_seen(step: StepRecord, category: str) -> bool:
    """Tell whether the answer of a step says that a thing is in view, in any of its words."""
    return any(acknowledges(step.decision.visible_state, word) for word in (category, *_ALSO.get(category, ())))


@dataclass(frozen=True, eq=False)
class HandFacts:
    """An episode with a goal for hands, as its record tells it."""

    recorded: RecordedEpisode

    @property
    def goal(self) -> Goal:
        goal = self.recorded.record.spec.goal
        assert goal is not None
        return goal

    @property
    def steps(self) -> tuple[StepRecord, ...]:
        return self.recorded.steps

    @property
    def own(self) -> frozenset[int]:
        """The targets without the place that a thing is put on."""
        return frozenset(self.recorded.record.spec.target_ids) - {self.goal.on}

    def in_view(self, step: StepRecord) -> bool:
        return sum(step.target_pixels.get(key, 0) for key in self.own) >= SEEN_PIXELS

    def boxes(self, step: StepRecord) -> dict[int, tuple[Vec3, Vec3]]:
        targets = step.targets or self.recorded.record.targets
        return {key: box for key, box in targets.items() if key in self.own}

    def near(self, step: StepRecord) -> bool:
        """Tell whether the pelvis ends within an arm's length of a thing."""
        here = np.array(step.end)
        boxes = [np.array(box) for box in self.boxes(step).values()]
        boxes = [box for box in boxes if box[0, 1] - _STOREY < here[1] < box[1, 1] + _STOREY]
        flat = [1.0, 0.0, 1.0]
        return distance_to_nearest(here * flat, [(low * flat, high * flat) for low, high in boxes]) <= NEARBY

    @cached_property
    def hands(self) -> Array:
        """(S, 2, 3) knuckles at the end of each step; none without motion."""
        if not self.recorded.has_motion or not self.steps:
            return np.zeros((0, 2, 3))
        joints = [self.recorded.motion("simulated")[end - 1 : end].joints()[0] for _, end in self.recorded.spans]
        return np.array(joints)[:, [JOINT_INDEX["left_hand"], JOINT_INDEX["right_hand"]]]

    @cached_property
    def reached(self) -> bool:
        """Whether a hand ended a step at a thing."""
        pairs = zip(self.steps, self.hands, strict=False)
        things = self.goal.things
        return any(
            distance_to_nearest(hands, [(np.array(low), np.array(high))]) <= AT_HAND
            for step, hands in pairs for key, (low, high) in self.boxes(step).items() if key in things
        )  # fmt: skip

    @cached_property
    def held(self) -> bool:
        return any(set(step.held.values()) & set(self.goal.things) for step in self.steps)

    @cached_property
    def dropped(self) -> int:
        """How often a thing left a hand that was not told to open."""
        pairs = zip(self.steps, self.steps[1:], strict=False)
        lost = [(a.held.keys() - b.held.keys(), b) for a, b in pairs]
        return sum(len(sides) for sides, step in lost if role_of(self.recorded, step) != "release")

    @cached_property
    def ever(self) -> bool:
        """Whether the world was as the goal has it after any step."""
        return any(brought(self.goal, self.steps[: k + 1]) for k in range(len(self.steps)))

    @cached_property
    def ever_open(self) -> bool:
        return any(opened(self.goal, self.steps[: k + 1]) for k in range(len(self.steps)))

    @property
    def stopped(self) -> bool:
        return self.recorded.record.outcome == "stopped"

    @property
    def answers(self) -> bool:
        """Whether the last call says the answer, however it was found."""
        return self.stopped and answered(self.goal, self.steps[-1])

    @property
    def says(self) -> bool:
        """Whether the last call says anything."""
        call = self.steps[-1].call if self.stopped else None
        return call is not None and any(isinstance(value, str) for value in call.params.values())

    def moved(self) -> bool:
        """Tell whether a thing on a joint ever moved by a twentieth of its way."""
        states = [(key, step.joints[key]) for step in self.steps for key in self.goal.ways if key in step.joints]
        return any(abs(value - a) > 0.05 * abs(b - a) for key, value in states for a, b in [self.goal.ways[key]])


_TWINS: Final[Mapping[Stage, Callable[[HandFacts], bool]]] = {
    "find": lambda f: any(map(f.in_view, f.steps)),
    "nav": lambda f: any(map(f.near, f.steps)),
    "reach": lambda f: f.reached or f.held,
    "hold": lambda f: f.held,
    "place": lambda f: f.ever,
    "open": lambda f: f.ever_open,
    "answer": lambda f: f.answers,
}


def stages_of(recorded: RecordedEpisode) -> dict[str, bool]:
    """Return whether each stage of an episode with a goal is passed, and all before it; by itself: geo_ and its name.

    Passed, beyond that: the target is also named (find), the end is as it should be at an active stop (the last one).
    """
    facts, spec = HandFacts(recorded), recorded.record.spec
    if facts.goal.asks:
        return {STAGE + facts.goal.asks: is_met(facts.goal, facts.steps)}
    stages = STAGES[family_of(spec)]
    twins = {stage: bool(_TWINS[stage](facts)) for stage in stages}
    said = any(facts.in_view(step) and says_seen(step, spec.target_category) for step in facts.steps)
    whole = twins | {"find": said, stages[-1]: is_met(facts.goal, facts.steps)}
    passed: Iterator[bool] = accumulate((whole[stage] for stage in stages), lambda before, now: before and now)
    return dict(zip(stages, passed, strict=True)) | {f"geo_{stage}": met for stage, met in twins.items()}


# -- root causes -------------------------------------------------------------------------------------------------------
def first_failed(stages: Mapping[str, bool]) -> Stage:
    """Return the first stage that was not passed of those of a failed episode; a question alone has but its answer."""
    failed = (stage for family in STAGES.values() for stage in family if not stages.get(stage, True))
    return next(failed, "answer")


def cause_of(recorded: RecordedEpisode, stage: Stage) -> Rule[HandFacts]:
    """Return the root cause of an episode that failed at a stage."""
    return first_cause(CAUSES, stage, HandFacts(recorded))


def _called(role: str) -> Callable[[HandFacts], bool]:
    return lambda f: any(role_of(f.recorded, step) == role for step in f.steps)


def _holds(facts: HandFacts) -> bool:
    return bool(facts.steps and set(facts.steps[-1].held.values()) & set(facts.goal.things))


_ALWAYS: Final[Callable[[HandFacts], bool]] = lambda f: True  # noqa: E731
CAUSES: Final[tuple[Rule[HandFacts], ...]] = (
    Rule("find", "target in view but not seen", "perception", _TWINS["find"]),
    Rule("find", "near but not in view", "mid-level reasoning", _TWINS["nav"]),
    Rule("find", "ineffective exploration", "mid-level reasoning", _ALWAYS),
    Rule("nav", "stop while far", "ego-spatial distance", lambda f: f.stopped),
    Rule("nav", "never came near", "action", _ALWAYS),
    Rule("reach", "never reached out", "decision", lambda f: not any(step.aims for step in f.steps)),
    Rule("reach", "out of reach", "ego-spatial distance",
         lambda f: min(aim.error for step in f.steps for aim in step.aims) > AT_HAND),
    Rule("reach", "reached elsewhere", "ego-spatial distance", _ALWAYS),
    Rule("hold", "never closed", "decision", lambda f: not _called("grasp")(f)),
    Rule("hold", "took another thing", "perception", lambda f: any(step.held for step in f.steps)),
    Rule("hold", "closed on nothing", "body awareness", _ALWAYS),
    Rule("place", "never let go", "decision", _holds),
    Rule("place", "never stopped", "decision", lambda f: f.ever and not f.stopped),
    Rule("place", "dropped", "body awareness", lambda f: f.dropped > 0),
    Rule("place", "put elsewhere", "ego-spatial distance", _ALWAYS),
    Rule("open", "never stopped", "decision", lambda f: f.ever_open and not f.stopped),
    Rule("open", "shut again", "body awareness", lambda f: f.ever_open),
    Rule("open", "never moved", "action", lambda f: not f.moved()),
    Rule("open", "not far enough", "body awareness", _ALWAYS),
    Rule("answer", "no answer", "decision", lambda f: not f.says),
    Rule("answer", "answered without a look", "decision", lambda f: f.answers),
    Rule("answer", "wrong answer", "perception", _ALWAYS),
)  # fmt: skip
"""Root causes of tasks for hands, in the order of their rules."""
