"""Progressive success of tasks with a partner, and the root cause of a failure, from the records of both alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Final

import numpy as np

from humanclaw import RecordedEpisode
from humanclaw.body import HISTORY, Array, Motion, rest_pose, wrap_angle
from humanclaw.records import Partner, in_view
from humanclaw_bench.failure_modes import Rule, Stage
from humanclaw_bench.hands.scores import CAUSES as OF_HANDS, HandFacts
from humanclaw_bench.two.partners import ARRIVED, PARTNER

MEETING: Final = 1.0
"""Metres from pelvis to pelvis at most where two have met."""
FACING: Final = float(np.radians(45))
"""Bearing of a partner who is faced, at most, radians."""
NEAR: Final = 2.0
"""Metres from pelvis to pelvis at most of who follows."""
GIVING: Final = 1.2
"""Metres from pelvis to pelvis at most of two who pass a thing on, at arm's length each."""
_STOOD: Final = 0.5
"""Metres from its start within which a body has hardly moved."""


@dataclass(frozen=True, eq=False)
class Together:
    """An episode with a partner, as the records of the two tell it."""

    recorded: RecordedEpisode
    other: Motion
    """Of the partner, from the same start; where it ends, the partner stands."""
    holds: frozenset[int] = frozenset()
    """What the partner holds at the end."""

    @classmethod
    @lru_cache(1)  # Scores and root cause need the same.
    def of(cls, recorded: RecordedEpisode) -> Together:
        """Read the partner's motion too, once the episode has some itself. Raises RecordError if it is missing."""
        if not recorded.has_motion:
            return cls(recorded, rest_pose(0))
        partner = RecordedEpisode(recorded.folder / PARTNER)
        return cls(recorded, partner.motion(), frozenset(partner.steps[-1].held.values() if partner.steps else ()))

    @property
    def partner(self) -> Partner:
        partner = self.recorded.record.spec.partner
        assert partner is not None
        return partner

    @cached_property
    def _own(self) -> Array:
        """(T, 3) the pelvis in each frame until the episode ended."""
        count = self.recorded.spans[-1][1] if self.recorded.steps else HISTORY
        root: Array = self.recorded.motion().root[:count] if self.recorded.has_motion else np.empty((0, 3))
        return root

    @cached_property
    def _others(self) -> Array:
        """(T, 3) the partner's pelvis in the same frames."""
        return self.other.root[np.minimum(np.arange(len(self._own)), len(self.other) - 1)]

    @cached_property
    def distances(self) -> Array:
        """(T,) from pelvis to pelvis in each frame, metres; none without motion."""
        return np.linalg.norm(self._others - self._own, axis=1) if len(self._own) else np.empty(0)

    @property
    def mean_distance(self) -> float:
        return float(self.distances.mean()) if len(self.distances) else float("nan")

    @property
    def bearing(self) -> float:
        """Where the partner is at the end, radians to the left of straight ahead."""
        left, ahead = (self._others[-1] - self._own[-1])[[0, 2]]
        yaw = self.recorded.motion().yaw()[len(self._own) - 1]
        return float(wrap_angle(np.arctan2(left, ahead) - yaw))

    @property
    def stopped(self) -> bool:
        return self.recorded.record.outcome == "stopped"

    @property
    def found(self) -> bool:
        """Whether the partner was in view before a decision."""
        return any(map(in_view, self.recorded.steps))

    @property
    def near(self) -> bool:
        """Whether the episode ends beside the partner."""
        return bool(len(self.distances) and self.distances[-1] <= MEETING)

    @property
    def faces(self) -> bool:
        """Whether the partner is ahead at the end and in the last view, not behind a wall."""
        return abs(self.bearing) <= FACING and in_view(self.recorded.steps[-1])

    @property
    def met(self) -> bool:
        return self.stopped and self.near and self.faces

    @cached_property
    def arrival(self) -> int | None:
        """The frame in which the partner has come to the end of its way; None if it has not."""
        if not (len(self._own) and self.partner.way):
            return None
        left = np.linalg.norm(self._others[:, [0, 2]] - self.partner.way[-1], axis=1)
        return int(np.argmax(left <= ARRIVED)) if (left <= ARRIVED).any() else None

    @property
    def touched(self) -> bool:
        return any(contact.person for step in self.recorded.steps for contact in step.contacts)

    @property
    def kept(self) -> bool:
        """Whether the body stayed near until the partner arrived, without a touch."""
        until = None if self.arrival is None else self.arrival + 1
        return bool(len(self.distances)) and float(self.distances[:until].max()) <= NEAR and not self.touched

    @property
    def stood(self) -> bool:
        return not len(self._own) or float(np.linalg.norm(self._own - self._own[0], axis=1).max()) < _STOOD

    @property
    def words(self) -> int:
        """How many words were spoken: the texts of calls that took no time and did not end the episode."""
        speeches = (step.call for step in self.recorded.steps if step.status == "executed" and not step.motion_frames)
        said = (value for call in speeches if call for value in call.params.values() if isinstance(value, str))
        return sum(len(text.split()) for text in said)

    @cached_property
    def hands(self) -> HandFacts:
        return HandFacts(self.recorded)

    @property
    def given(self) -> bool:
        """Whether the partner holds the thing at the end, and the body lets it."""
        own = self.recorded.steps[-1].held.values() if self.recorded.steps else ()
        return set(self.hands.goal.things) <= self.holds - set(own)

    @property
    def _giving(self) -> dict[str, bool]:
        nav = any(map(self.hands.near, self.recorded.steps))
        reach = nav and (self.hands.reached or self.hands.held)
        hold = reach and self.hands.held
        return {"nav": nav, "reach": reach, "hold": hold, "give": hold and self.given and self.stopped}

    @property
    def stages(self) -> dict[str, bool]:
        """Whether each stage of the task is passed, and all before it."""
        if self.partner.task == "give":
            return self._giving
        if self.partner.task == "meet":
            return {"find": self.found, "meet": self.found and self.met}
        kept = self.found and self.kept
        return {"find": self.found, "keep": kept, "end": kept and self.arrival is not None and self.stopped}


def first_failed(stages: Mapping[str, bool]) -> Stage:
    """Return the first stage of a failed episode that was not passed."""
    order: tuple[Stage, ...] = ("find", "meet", "keep", "end", "nav", "reach", "hold", "give")
    return next(stage for stage in order if not stages.get(stage, True))


def _holding(stage: Stage) -> Iterator[Rule[Together]]:
    """Yield the root causes of tasks for hands that end at a stage."""
    for cause in OF_HANDS:
        if cause.stage == stage:
            # mypy infers no lambda with a default.
            yield Rule(stage, cause.name, cause.capability, lambda f, rule=cause.rule: rule(f.hands))  # type: ignore[misc]


CAUSES: Final[tuple[Rule[Together], ...]] = (
    Rule("find", "near but not in view", "mid-level reasoning",
         lambda f: bool((f.distances <= NEAR).any())),
    Rule("find", "ineffective exploration", "mid-level reasoning", lambda f: True),
    Rule("meet", "stopped turned away", "body awareness", lambda f: f.stopped and f.near),
    Rule("meet", "stopped while far", "ego-spatial distance", lambda f: f.stopped),
    Rule("meet", "never stopped", "decision", lambda f: bool((f.distances <= MEETING).any())),
    Rule("meet", "never came near", "action", lambda f: True),
    Rule("keep", "touched the other", "body awareness", lambda f: f.touched),
    Rule("keep", "stayed behind", "decision", lambda f: f.stood),
    Rule("keep", "fell behind", "action", lambda f: True),
    Rule("end", "stopped too early", "decision", lambda f: f.stopped),
    Rule("end", "never stopped", "decision", lambda f: f.arrival is not None),
    Rule("end", "out of steps", "action", lambda f: True),
    Rule("nav", "never heard the wish", "decision", lambda f: not any(step.heard for step in f.recorded.steps)),
    Rule("nav", "never saw the thing", "mid-level reasoning",
         lambda f: not any(map(f.hands.in_view, f.recorded.steps))),
    *_holding("nav"), *_holding("reach"), *_holding("hold"),
    Rule("give", "never stopped", "decision", lambda f: f.given),
    Rule("give", "dropped", "body awareness", lambda f: f.hands.dropped > 0),
    Rule("give", "stopped while far", "ego-spatial distance", lambda f: f.stopped and f.distances[-1] > GIVING),
    Rule("give", "never came near", "action", lambda f: not (f.distances <= GIVING).any()),
    Rule("give", "let go untaken", "decision", lambda f: not f.recorded.steps[-1].held),
    Rule("give", "not held out", "body awareness", lambda f: True),
)  # fmt: skip
"""Root causes of tasks with a partner, in the order of their rules."""
