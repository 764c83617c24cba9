"""The oracle in company: it walks up to another person, follows one who walks, or brings one a thing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from humanclaw import Call, Decision, HistoryEntry, Observation
from humanclaw.body import JOINT_INDEX, STANDING_HEIGHT, Array
from humanclaw.records import Partner
from humanclaw.skills import Side
from humanclaw.world import Viewpoint, WorldState, distance_to_nearest, person_id
from humanclaw_scripted.actions import MAX_STEP, TURN_FIRST
from humanclaw_scripted.arms import Script
from humanclaw_scripted.ground_truth import BodyView, box
from humanclaw_scripted.opening import HandyOracle

_MET: Final = 0.85
"""Metres from pelvis to pelvis at which the oracle stops, below the benchmark's 1 m."""
_FACING: Final = float(np.radians(20))
"""Turn, radians, up to which the oracle faces the other. A call for less would gain nothing."""
_RINGS: Final = {"meet": (0.7, 0.8), "follow": (0.4, 0.6), "give": (0.9, 1.0)}
"""Metres from the other person to places to stand, by task."""
_GOALS: Final = {
    "meet": "To the other person.", "follow": "Behind the other person.", "give": "To bring the other person a thing."
}  # fmt: skip
_GIVING: Final = (0.8, 1.0)
"""Metres from pelvis to pelvis of one who holds something out."""
_OUT: Final = (0.1, 1.05, 0.5)
"""Aside, over the floor, and ahead of the hips: where the hand is then, metres."""
_PATIENCE: Final = 12
"""Half seconds to hold it out."""
_AT_PALM: Final = 0.1
"""Metres from its knuckles of what a hand holds."""
_BEHIND: Final = 1.05
"""Metres behind a person who walks, within which the oracle waits for the next step."""
_CLOSEST: Final = 0.85
"""Metres to which it walks up: who turns on the spot swings the arms."""
_CLEAR: Final = 0.2
"""Metres that a straight step keeps from everything."""
_ENDED: Final = 0.3
"""Metres from the end of a way at which whoever walks it has arrived, as the benchmark has it."""


class SociableOracle(HandyOracle):
    """The oracle, with another person where the episode has a partner."""

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        self._heard = observation.feedback.heard
        return super().decide(observation, history)

    @property
    def _only_joins(self) -> Partner | None:
        """The partner, if the task is to be near them and no more."""
        return None if self._spec.goal else self._spec.partner

    def _act(self, state: WorldState, pose: BodyView) -> tuple[Call, str]:
        if (partner := self._only_joins) is None:
            return super()._act(state, pose)
        there = self._other(state)
        far, bearing = float(np.linalg.norm(there - pose.root)), float(np.arctan2(*pose.on_floor(there[[0, 2]])))
        if partner.task == "follow":
            return self._accompany(state, pose, far, bearing)
        if far > _MET or not self._sees(pose, there):
            return self._go(state, pose)
        return self._turn_to(bearing) or (Call(self._stop), "I stand before the other person: we have met.")

    def _play(self) -> Script:
        if self._spec.partner is None:
            yield from super()._play()
        (thing,) = self._spec.target_ids
        self._noun = self._scene.by_id[thing].category.replace("_", " ")
        yield from self._bring(
            thing, "other person", self._around_other, lambda side: self._give(thing, side), lambda: self._given(thing)
        )
        while True:
            yield Call(self._stop), "The other person has it: the task is complete."

    def _give(self, thing: int, side: Side) -> Script:
        """Hold a thing out until the other person says something, and let go; from elsewhere if that takes long."""
        out = 1.0 if side == "left" else -1.0
        while self._in_hand(thing):
            yield from self._face(lambda: self._other(self._state()), lambda: 0.0, _GIVING)
            for _ in range(_PATIENCE):
                yield self._to(side, np.array([_OUT[0] * out, *_OUT[1:]]), "I hold it out to the other person.")
                if self._heard or not self._in_hand(thing):
                    yield self._let_go(side)
                    yield self._back(0.2), "I step back."
                    return
            self._give_up_stand(0.3)
            yield from self._walk_to(self._around_other, lambda: self._in_hand(thing))

    def _given(self, thing: int) -> bool:
        """Tell whether a thing is in the hand of the other person, as far as one sees."""
        joints = self._state().people[person_id(1)][-1:].joints()[0]
        hands = joints[[JOINT_INDEX["left_hand"], JOINT_INDEX["right_hand"]]]
        corners = box(self._scene, self._state(), thing)
        return not self._in_hand(thing) and distance_to_nearest(hands, [corners]) < _AT_PALM

    def _accompany(self, state: WorldState, pose: BodyView, far: float, bearing: float) -> tuple[Call, str]:
        """Take one step after a person who walks, the shortest way to where the person is now."""
        assert self._spec.partner is not None
        end, there = np.array(self._spec.partner.way[-1]), self._other(state)[[0, 2]]
        if np.linalg.norm(there - end) <= _ENDED:
            return Call(self._stop), "The other person has arrived, so I stop."
        if far <= _BEHIND:
            return self._turn(bearing if abs(bearing) > _FACING else 0.0), "I am close behind, and wait."
        if self._memory.blocked < 2 and self._plan(pose).clear(pose.point, there, _CLEAR):
            if abs(bearing) > TURN_FIRST:
                return self._turn(bearing), "The other person has turned off, so I turn."
            return self._walk(0.0, min(MAX_STEP, far - _CLOSEST), 0.7 * bearing), "I walk after the other person."
        if self._memory.blocked < 2:
            self._memory.way = []  # The other person has moved on.
        return self._go(state, pose)

    def _turn_to(self, bearing: float) -> tuple[Call, str] | None:
        """Turn to the other person; None if it is ahead."""
        if abs(bearing) <= _FACING:
            return None
        return self._turn(bearing), "I turn to the other person."

    def _sees(self, pose: BodyView, there: Array) -> bool:
        """Tell whether no wall stands between."""
        return bool(self._plan(pose).sees(pose.root, there[None])[0])

    def _other(self, state: WorldState) -> Array:
        """Return the pelvis (3,) of the other person."""
        return np.asarray(state.people[person_id(1)].root[-1])

    def _stands(self) -> list[Viewpoint]:
        return self._around_other() if self._only_joins else super()._stands()

    def _around_other(self) -> list[Viewpoint]:
        """Return places to stand around the other person, at the distance of the task."""
        assert self._spec.partner is not None
        there = self._other(self._state())
        floor = self._memory.floors.grids[int(self._memory.floors.level(there))]
        places = []
        for far in _RINGS[self._spec.partner.task]:
            for yaw in np.linspace(-np.pi, np.pi, 16, endpoint=False):
                x, z = there[[0, 2]] - far * np.array([np.sin(yaw), np.cos(yaw)])
                free = floor.at(floor.clearance, np.array([x, z])) >= 0.2
                if free and floor.sees(np.array([x, there[1], z]), there[None])[0]:
                    level = float(there[1] - STANDING_HEIGHT)
                    places.append(Viewpoint(person_id(1), float(x), float(z), float(yaw), 0.0, floor=level))
        return places

    def _at_stand(self, pose: BodyView) -> tuple[Call, str]:
        if self._only_joins is None:
            return super()._at_stand(pose)
        stand = self._memory.stand
        assert stand is not None
        if not self._arrived(pose, stand, 0.12):
            return self._follow(pose, self._last)
        left, ahead = pose.on_floor(self._other(self._state())[[0, 2]])
        return self._turn_to(float(np.arctan2(left, ahead))) or (
            self._walk(0.0, 0.15, 0.0),
            "One more step to the other person.",
        )

    def _goal(self) -> str:
        if self._spec.partner is None:
            return super()._goal()
        return _GOALS[self._spec.partner.task]
