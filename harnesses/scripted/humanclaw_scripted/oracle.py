"""The oracle: it plans on the true scene and calls skills as a model does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from humanclaw import Call, Decision, EpisodeContext, HistoryEntry, Observation
from humanclaw.body import Array, wrap_angle
from humanclaw.world import Viewpoint, WorldState, distance_to_nearest, room_at, viewpoints
from humanclaw_scripted.actions import AT_SEAT, HIPS_OVER_SEAT, LEVEL_THIGHS, SIT, skill_for
from humanclaw_scripted.ground_truth import BodyView, box, in_view, on_seat
from humanclaw_scripted.narration import Narrator
from humanclaw_scripted.path_following import remaining, side_of
from humanclaw_scripted.walker import Walker

STOP_DISTANCE: Final = 0.19
"""Distance to the target's bounding box at which the oracle stops, metres: just below the benchmark's 0.2."""

_BOARD: Final = 0.35
"""Depth of a shelf, metres."""


class OracleAgent(Walker):
    """Walks to the target with the cheapest route, and sits down on it if the task says so.

    Privileged: it reads the scene and the true state before every call, and plans again when blocked.
    """

    name = "oracle"
    privileged = True

    def __init__(self, words: str = "map") -> None:
        """words: "map" tells what the agent knows, "eyes" only what its view shows (humanclaw_scripted.narration)."""
        self.settings: Mapping[str, Any] = {"words": words} if words != "map" else {}
        self._narrator = Narrator() if words == "eyes" else None

    def begin(self, context: EpisodeContext) -> None:
        super().begin(context)
        self._gaze = context.gaze
        if self._narrator:
            self._narrator.begin(context)
        if context.spec.interact:
            skill_for(context.skills, SIT)

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        state = self._state()
        pose = BodyView(state)
        self._notice(pose, history)
        sat = [self._sits(past.executed) for past in reversed(history)]
        self._memory.sits = next((k for k, is_sit in enumerate(sat) if not is_sit), len(sat))
        view = self._look(state)
        (call, reason), self._memory.before = self._act(state, pose), pose
        change = "revise" if self._memory.goal != self._goal() else "keep"
        self._memory.goal = self._goal()
        decision = Decision((call,), view, self._progress(pose), self._goal(), change, reason, raw="", prompt_digest="")
        return self._narrator(decision, history) if self._narrator else decision

    # the task
    def _act(self, state: WorldState, pose: BodyView) -> tuple[Call, str]:
        if not self._spec.target_ids:
            return Call(self._stop), f"There is no {self._noun} here, so I stop."
        if self._spec.interact and self._memory.sits:
            return self._after_sitting(state)
        if not self._spec.interact and self._distance(state) <= STOP_DISTANCE:
            return Call(self._stop), "I am within reach of the target, so the task is complete."
        return self._go(state, pose)

    def _at_stand(self, pose: BodyView) -> tuple[Call, str]:
        return self._seat(pose) if self._spec.interact else self._reach(pose)

    def _stands(self) -> list[Viewpoint]:
        """Return places to stand at the targets."""
        sit, floors = self._spec.interact, self._memory.floors
        return [s for key in self._spec.target_ids for s in viewpoints(floors, self._scene, key, sit=sit)]

    # at the target
    def _reach(self, pose: BodyView) -> tuple[Call, str]:
        """Go to the standing place, then approach the target until it is within reach."""
        stand = self._memory.stand
        assert stand is not None
        if not self._arrived(pose, stand, 0.2):
            return self._follow(pose, self._last)
        low, high = (corner[[0, 2]] for corner in box(self._scene, self._state(), stand.target))
        edge = np.clip(pose.point, low, high)
        self._memory.sideways |= self._memory.blocked > 0
        if self._memory.sideways:
            return self._sideways(pose, edge)
        left, forward = pose.on_floor(edge)
        error = float(np.arctan2(left, forward))
        if abs(error) > np.radians(20) and np.hypot(left, forward) > 0.05:
            return self._turn(error), "I am beside the target and turn to face it."
        gap = float(np.hypot(left, forward))
        return self._walk(0.0, min(0.25, max(0.1, gap)), error), "The target is right in front of me: I close the gap."

    def _sideways(self, pose: BodyView, edge: Array) -> tuple[Call, str]:
        """Turn the nearer side to the target: an arm reaches over furniture that stops the toes."""
        left, forward = pose.on_floor(edge)
        bearing = float(np.arctan2(left, forward))
        side = 1.0 if bearing >= 0 else -1.0
        error = float(wrap_angle(bearing - side * np.pi / 2))
        if abs(error) > np.radians(20):
            return self._turn(error), f"My feet cannot get closer to the {self._noun}: I turn my side to it."
        return self._side(side * 0.15), f"I step sideways towards the {self._noun}."

    def _seat(self, pose: BodyView) -> tuple[Call, str]:
        """Go to the place in front of the seat, turn round, step back to its edge and sit down."""
        stand = self._memory.stand
        assert stand is not None
        assert stand.seat_height is not None
        if not self._arrived(pose, stand, 0.15):
            return self._follow(pose, self._last)
        error = float(wrap_angle(stand.yaw - pose.yaw))
        if not self._memory.seen:
            self._memory.seen = abs(float(wrap_angle(error + np.pi))) < np.radians(45)
            return self._turn(
                float(wrap_angle(error + np.pi))
            ), f"I should look at the {self._noun} before I turn my back to it."
        if abs(error) > np.radians(12):
            return self._turn(error), f"I stand in front of the {self._noun} and turn my back to it."
        left, ahead = pose.on_floor(stand.point)
        gap = stand.gap - ahead
        # Too far off for shuffling: plan the way to the seat again.
        if gap > 0.9 or gap < -0.3 or abs(left) > 0.6:
            self._memory.way = []
            return self._act(self._state(), pose)
        if abs(left) > 0.12:
            return self._side(left), f"I line up with the {self._noun} behind me."
        if gap > AT_SEAT + 0.05 and not (self._memory.blocked and gap < 0.25):
            return self._back(
                gap - AT_SEAT
            ), f"My back faces the {self._noun}: I close the gap of {round(100 * gap)} cm."
        return self._sit(stand.seat_height), f"The edge of the {self._noun} is right behind my legs: I sit down."

    def _after_sitting(self, state: WorldState) -> tuple[Call, str]:
        memory = self._memory
        if any(on_seat(self._scene, state, key) for key in self._spec.target_ids):
            return Call(self._stop), f"I am sitting on the {self._noun}: the task is complete."
        if memory.sits < len(HIPS_OVER_SEAT) and memory.stand is not None and memory.stand.seat_height is not None:
            return self._sit(memory.stand.seat_height), f"My hips are not on the {self._noun} yet: I sit lower."
        if memory.stand is not None:
            memory.given_up.add((memory.stand.x, memory.stand.z))
        memory.way = []
        return self._walk(0.0, 0.3, 0.0), f"I do not sit on the {self._noun}: I get up and try another place on it."

    def _sits(self, call: Call | None) -> bool:
        return call is not None and self._context.skills[call.skill].role == "sit"

    def _sit(self, seat_height: float) -> Call:
        tries = self._memory.sits
        return self._call(SIT, min(seat_height + HIPS_OVER_SEAT[tries], LEVEL_THIGHS[tries]))

    # words
    def _distance(self, state: WorldState) -> float:
        """Return the distance from the nearest joint to the nearest target, metres."""
        return distance_to_nearest(state.body.joints()[-1], [box(self._scene, state, k) for k in self._spec.target_ids])

    def _goal(self) -> str:
        if not self._spec.target_ids:
            return "Stop."
        if self._memory.stand is None or not self._memory.arrived:
            return f"Straight to the {self._noun}."
        return f"Sit down on the {self._noun}." if self._spec.interact else f"Get within reach of the {self._noun}."

    def _progress(self, pose: BodyView) -> str:
        if self._memory.sits:
            return f"I have reached the {self._noun} and sat down."
        if self._memory.arrived:
            return f"I have reached the {self._noun}."
        if not self._memory.way:
            return "I am looking for a way."
        return f"I am on the way, with {remaining(self._memory.way, pose):.1f} m left to walk."

    def _look(self, state: WorldState) -> str:
        """Describe the room, and the nearest target in view."""
        pose = BodyView(state)
        plan = self._plan(pose)
        name = room_at(self._scene, float(pose.point[0]), float(pose.point[1]), plan.floor)
        room_words = next((room.told for room in self._scene.rooms if room.name == name), "")
        here = f"I am {'on' if name == 'stairs' else 'in'} {room_words}." if room_words else "I am between two rooms."
        # The map has a column where there is a shelf: what stands on a board of it is not in one.
        last = 0.1 if self._spec.goal is None else _BOARD
        looks = (in_view(plan, self._scene, state, key, self._gaze, last) for key in self._spec.target_ids)
        seen = [look for look in looks if look]
        if not seen:
            return f"{here} No {self._noun} is in view." if self._spec.target_ids else here
        angle, distance = min(seen, key=lambda look: look[1])
        self._memory.seen = True
        side = "ahead" if abs(angle) < np.radians(15) else f"ahead on the {side_of(angle)}"
        return f"{here} A {self._noun} is {side}, about {distance:.1f} m away."
