"""An agent with its own view and nothing else: no map, no pose.

It has the depth of its view, and knows its target by the ids of drawn objects. It maps what it sees, explores
frontiers (Yamauchi 1997) until a target comes into view, goes to the target, and sits down if that is the task. It
estimates its pose from its own calls, corrected by aligning its views.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from humanclaw import Call, Decision, EpisodeContext, HistoryEntry, HumanclawError, Observation
from humanclaw.body import Array, Pose2D, wrap_angle
from humanclaw.records import SEEN_PIXELS
from humanclaw.skills import to_si
from humanclaw.world import DistanceField, MultiFloorMap, OccupancyGrid
from humanclaw_scripted.actions import (
    AT_SEAT,
    BACK,
    HIPS_OVER_SEAT,
    LEVEL_THIGHS,
    MAX_STEP,
    SIDE,
    SIT,
    TURN,
    TURN_FIRST,
    WALK,
    asking,
    ending,
    looked_for,
    require_target,
)
from humanclaw_scripted.depth_mapping import SeenMap, Sight, edges, gap_to, moved, placed, seats
from humanclaw_scripted.path_following import aim

TOUCHING_DISTANCE = 0.27
"""Distance from the pelvis to the target at which it stops, metres: chest and hands are nearer."""
LOOKS = 4
"""Turns on the spot at the start, until a target is in view."""
LOOK = np.radians(72)
"""Angle of each of these turns, radians."""
BLOCKED = 0.35
"""A step counts as blocked below this share of its commanded distance."""


@dataclass(frozen=True)
class Stand:
    """A place to go to."""

    point: Array
    """(2,)"""
    seat: Array | None = None
    """(2,) edge of the seat, if the agent should sit down there."""
    inward: float = 0.0
    """Heading from the place to the middle of the seat, radians."""
    height: float = 0.0
    """Height of the seat, metres."""
    at_target: bool = True
    """Whether the place is at a target; else it is at a frontier."""


@dataclass
class SeeingMemory:
    """The agent's state from step to step."""

    map: SeenMap = field(default_factory=SeenMap.empty)
    pose: Pose2D = field(default_factory=Pose2D)
    stand: Stand | None = None
    arrived: bool = False
    seen: bool = False
    looks: int = 0
    blocked: int = 0
    jams: int = 0
    sat: bool = False


class SeeingAgent:
    """Finds its way by its own view. Privileged only in that it gets the depth and ids of that view."""

    name = "seeing"
    privileged = True
    settings: Mapping[str, Any] = {"words": "eyes"}
    ready = staticmethod(require_target)

    def begin(self, context: EpisodeContext) -> None:
        if context.view is None:
            raise HumanclawError("the seeing agent needs its view with depth and ids.", "Run it through the loop.")
        self._view, self._skills, self._spec, self._gaze = context.view, context.skills, context.spec, context.gaze
        self._noun = looked_for(context.spec)
        self._stop = ending(context.skills)
        self._memory = SeeingMemory()

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        sight = Sight.of(self._view(), self._spec.target_ids, self._gaze)
        self._locate(sight, history[-1].executed if history else None)
        self._memory.map.add(sight, self._memory.pose)
        said = self._say(sight)
        call, reason = self._act()
        goal = f"Get to the {self._noun}." if self._memory.seen else f"Find a {self._noun}."
        return Decision((call,), said, "", goal, "keep", reason)

    # pose
    def _locate(self, sight: Sight, last: Call | None) -> None:
        """Update the pose by the whole, half or none of the commanded displacement, whichever fits the view best."""
        memory, (left, ahead, turn) = self._memory, self._asked(last)
        guesses = [moved(memory.pose, share * left, share * ahead, turn) for share in (1.0, 0.5, 0.0)]
        new = memory.map.locate(sight, guesses if np.hypot(left, ahead) > 0.05 else guesses[:1])
        wanted, went = np.hypot(left, ahead), np.hypot(new.x - memory.pose.x, new.z - memory.pose.z)
        if wanted >= 0.08:
            memory.blocked = memory.blocked + 1 if went < BLOCKED * wanted else 0
        memory.pose = new

    def _asked(self, call: Call | None) -> tuple[float, float, float]:
        """Return the commanded displacement to the left and ahead, metres, and turn, radians."""
        asked = dict.fromkeys(("hips.left", "hips.forward", "hips.back", "heading.left"), 0.0)
        for parameter in self._skills[call.skill].parameters if call else ():
            asked[parameter.measure] = to_si(parameter.key, float(call.params.get(parameter.key, 0))) if call else 0.0
        return asked["hips.left"], asked["hips.forward"] - asked["hips.back"], asked["heading.left"]

    def _local(self, point: Array) -> tuple[float, float]:
        """Return bearing (radians, left positive) and distance (metres) of a (2,) place."""
        pose = self._memory.pose
        x, z = point - [pose.x, pose.z]
        return float(wrap_angle(np.arctan2(x, z) - pose.yaw)), float(np.hypot(x, z))

    @property
    def _here(self) -> Array:
        return np.array([self._memory.pose.x, self._memory.pose.z])

    # decision
    def _act(self) -> tuple[Call, str]:
        memory = self._memory
        if memory.sat:
            return Call(self._stop), f"I sit on the {self._noun}: the task is complete."
        grid = memory.map.grid()
        heights = memory.map.heights(grid)
        gap = float(grid.at(gap_to(heights > 0), self._here))
        if not self._spec.interact and (gap <= TOUCHING_DISTANCE or (memory.arrived and memory.blocked >= 2)):
            return Call(self._stop), f"The {self._noun} is within reach: I stop."
        if memory.blocked >= 2 and not (memory.arrived and memory.stand and memory.stand.seat is not None):
            return self._break_free(grid)
        if not memory.seen and memory.looks < LOOKS:
            memory.looks += 1
            return self._turn(float(LOOK)), f"I look round for a {self._noun}."
        if not memory.arrived or memory.stand is None:
            # Each view can show a nearer place, so the choice is made anew until the agent has arrived.
            memory.stand = self._choose(grid, heights)
        if memory.stand is None:
            return Call(self._stop), f"I have been everywhere and found no {self._noun}."
        return self._go(grid, heights, memory.stand)

    def _choose(self, grid: OccupancyGrid, heights: Array) -> Stand | None:
        """Choose a place at a target that can be reached; else the frontier that is cheapest to reach."""
        routes = DistanceField.comfortable(MultiFloorMap((grid,)), np.array([self._here[0], 0.0, self._here[1]]))
        costs = routes.metres[0]
        if (heights > 0).any():
            stand = self._seat(grid, heights, costs) if self._spec.interact else self._beside(grid, heights, costs)
            if stand is not None:
                return stand
        return self._edge(grid, heights, costs)

    def _beside(self, grid: OccupancyGrid, heights: Array, costs: Array) -> Stand | None:
        gap = gap_to(heights > 0)
        price = np.where((gap < 1.0) & np.isfinite(costs), costs + 6 * gap, np.inf)
        best = np.unravel_index(int(np.argmin(price)), price.shape)
        return Stand(grid.point(np.array(best))) if np.isfinite(price[best]) else None

    def _seat(self, grid: OccupancyGrid, heights: Array, costs: Array) -> Stand | None:
        """Find a place in front of a low part of the target without a high part in between."""
        low = seats(heights)
        gap, any_gap = gap_to(low), gap_to(heights > 0)
        before = (gap > 0.2) & (gap < 0.7) & (gap < any_gap + 0.06) & grid.fits(0.2) & np.isfinite(costs)
        price = np.where(before, costs + 4 * np.abs(gap - 0.35), np.inf)
        best = np.unravel_index(int(np.argmin(price)), price.shape)
        if not np.isfinite(price[best]):
            return None
        point, cells = grid.point(np.array(best)), grid.point(np.argwhere(low))
        edge = cells[int(np.argmin(np.linalg.norm(cells - point, axis=1)))]
        near = np.linalg.norm(cells - edge, axis=1) < 0.45
        x, z = cells[near].mean(0) - point
        height = float(np.median(grid.at(heights, cells[near])))
        return Stand(point, edge, float(np.arctan2(x, z)), height)

    def _edge(self, grid: OccupancyGrid, heights: Array, costs: Array) -> Stand | None:
        """Pick the cheapest stretch of the edge: a long one is a little cheaper, and one near a seen target much."""
        gap = gap_to(heights > 0)
        best, least = None, np.inf
        for stretch in edges(grid):
            prices = grid.at(costs, stretch)
            place = stretch[int(np.argmin(prices))]
            price = float(prices.min()) - min(1.5, 0.03 * len(stretch)) + 0.5 * abs(self._local(place)[0])
            price += 3 * float(grid.at(gap, place)) if np.isfinite(gap).any() else 0.0
            if price < least:
                best, least = Stand(place, at_target=False), price
        return best

    def _go(self, grid: OccupancyGrid, heights: Array, stand: Stand) -> tuple[Call, str]:
        if not self._memory.arrived:
            if np.linalg.norm(stand.point - self._here) > (0.15 if stand.at_target else 0.4):
                return self._follow(grid, stand)
            if not stand.at_target:
                # Otherwise a frontier that stays unseen would attract the agent forever.
                self._memory.map.known |= self._memory.map.disk(stand.point, 0.4)
                return self._turn(float(LOOK)), "Nothing new here: I look round."
            self._memory.arrived = True
        return self._sit_down(grid, heights, stand) if stand.seat is not None else self._close_in(grid, heights)

    def _close_in(self, grid: OccupancyGrid, heights: Array) -> tuple[Call, str]:
        cells = grid.point(np.argwhere(heights > 0))
        angle, gap = self._local(cells[int(np.argmin(np.linalg.norm(cells - self._here, axis=1)))])
        if abs(angle) > np.radians(20):
            return self._turn(angle), f"I turn to the {self._noun}."
        return self._walk(max(0.1, min(0.25, gap - 0.1)), angle), f"I close the gap to the {self._noun}."

    def _sit_down(self, grid: OccupancyGrid, heights: Array, stand: Stand) -> tuple[Call, str]:
        assert stand.seat is not None
        outward = float(wrap_angle(stand.inward + np.pi - self._memory.pose.yaw))
        if abs(outward) > np.radians(12):
            return self._turn(outward), f"I stand before the {self._noun} and turn my back to it."
        away = stand.seat - self._here
        gap = float(away @ [np.sin(stand.inward), np.cos(stand.inward)])
        if gap > AT_SEAT + 0.05 and not self._memory.blocked:
            back = asking(self._skills, BACK, (min(0.4, gap - AT_SEAT),))
            return back, f"The {self._noun} is behind me: I step back to it."
        self._memory.sat = True
        low = min(stand.height + HIPS_OVER_SEAT[0], LEVEL_THIGHS[0])
        return asking(self._skills, SIT, (low,)), f"The {self._noun} is right behind my legs: I sit down."

    def _follow(self, grid: OccupancyGrid, stand: Stand) -> tuple[Call, str]:
        """Take one step of the way to a place."""
        here = np.array([self._here[0], 0.0, self._here[1]])
        goal = np.array([stand.point[0], 0.0, stand.point[1]])
        ways = DistanceField.comfortable(MultiFloorMap((grid,)), here).route(goal)
        path = np.concatenate([way.points for way in ways]) if ways else np.array([self._here, stand.point])
        towards, rest = aim(grid, path, self._here)
        angle, distance = self._local(towards)
        if abs(angle) > TURN_FIRST:
            return self._turn(angle), "The way leads to the side: I turn."
        step = min(MAX_STEP, distance, max(0.15, rest))
        what = f"The {self._noun} is over there" if stand.at_target else "There I have not been yet"
        return self._walk(step, angle), f"{what}: I walk on."

    def _break_free(self, grid: OccupancyGrid) -> tuple[Call, str]:
        """Remember the obstacle, and step to a side with room."""
        memory = self._memory
        ahead = placed(memory.pose, np.array([[0.0, 0.35], [0.3, 0.0], [-0.3, 0.0], [0.0, -0.3]]))
        memory.map.bump(ahead[0])
        memory.blocked, memory.arrived, memory.jams = 0, False, memory.jams + 1
        room = grid.at(grid.clearance, ahead[1:])
        best = int(np.argsort(-room)[memory.jams % 4 // 2])
        calls = (asking(self._skills, SIDE, (0.3,)), asking(self._skills, SIDE, (-0.3,)))
        return (*calls, asking(self._skills, BACK, (0.3,)))[best], "Something is in my way: I step aside."

    def _turn(self, angle: float) -> Call:
        return asking(self._skills, TURN, (angle,))

    def _walk(self, ahead: float, angle: float) -> Call:
        return asking(self._skills, WALK, (ahead * np.sin(angle), ahead * np.cos(angle), 0.7 * angle))

    # words
    def _say(self, sight: Sight) -> str:
        if sight.pixels < SEEN_PIXELS or not sight.mine.any():
            return f"No {self._noun} is in view."
        self._memory.seen = True
        away = float(np.hypot(sight.points[sight.mine][:, 0], sight.points[sight.mine][:, 2]).min())
        return f"A {self._noun} is in view, about {away:.1f} m away."
