"""The oracle: it plans on the true scene and calls skills as a model does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from humanclaw import Call, Decision, EpisodeContext, EpisodeSpec, HistoryEntry, Observation, PluginError
from humanclaw.body import STANDING_HEIGHT, Array, wrap_angle
from humanclaw.world import (
    MultiFloorMap,
    OccupancyGrid,
    Routes,
    StairRun,
    Viewpoint,
    WorldState,
    distance_to_nearest,
    room_at,
    viewpoints,
)
from humanclaw_scripted.calls import (
    AT_SEAT,
    BACK,
    DOWN,
    HIPS_OVER_SEAT,
    LEVEL_THIGHS,
    MAX_STEP,
    SIDE,
    SIT,
    TURN,
    TURN_FIRST,
    UP,
    WALK,
    asking,
    ending,
    looked_for,
    skill_for,
    way_of,
)
from humanclaw_scripted.telling import Teller
from humanclaw_scripted.truth import PelvisPose, box, in_view, on_seat
from humanclaw_scripted.way import BEFORE_STEPS, ONTO_FLOOR, LevelSegment, aim, on_stairs, parts, remaining, side_of

STOP_DISTANCE: Final = 0.19
"""Distance to the target's bounding box at which the oracle stops, metres: just below the benchmark's 0.2."""


@dataclass
class Memory:
    """The oracle's state from step to step."""

    floors: MultiFloorMap
    way: list[LevelSegment | StairRun] = field(default_factory=list)
    """The rest of the way, the current part first; empty without a plan."""
    stand: Viewpoint | None = None
    before: PelvisPose | None = None
    blocked: int = 0
    """Consecutive steps that should have moved the body and did not."""
    sits: int = 0
    """Consecutive sits up to now."""
    arrived: bool = False
    """Whether the body has reached the standing place; from there on it goes by the target, not by the path."""
    sideways: bool = False
    """Whether the feet cannot get near enough when the body faces the target."""
    seen: bool = False
    """Whether a target has been in view."""
    given_up: set[tuple[float, float]] = field(default_factory=set)
    jams: int = 0
    goal: str = ""


class OracleAgent:
    """Walks to the target with the cheapest route, and sits down on it if the task says so.

    Privileged: it reads the scene and the true state before every call, and plans again when blocked.
    """

    name = "oracle"
    privileged = True

    def __init__(self, words: str = "map") -> None:
        """words: "map" tells what the agent knows, "eyes" only what its view shows (humanclaw_scripted.telling)."""
        self.settings: Mapping[str, Any] = {"words": words} if words != "map" else {}
        self._teller = Teller() if words == "eyes" else None

    def begin(self, context: EpisodeContext) -> None:
        if context.scene is None or context.state is None:
            raise PluginError("the oracle needs the scene and the state.", "Run it through the loop.")
        self._context, self._scene, self._state = context, context.scene, context.state
        self._noun, self._gaze = looked_for(context.spec), context.gaze
        if self._teller:
            self._teller.begin(context)
        self._stop = ending(context.skills)
        for needed in (WALK, TURN, SIDE, BACK, *([SIT] if context.spec.interact else [])):
            skill_for(context.skills, needed)
        self._memory = Memory(MultiFloorMap.of(self._scene, context.state().objects))

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        state = self._state()
        pose = PelvisPose.of(state)
        self._notice(pose, history)
        view = self._look(state)
        (call, reason), self._memory.before = self._act(state, pose), pose
        change = "revise" if self._memory.goal != self._goal() else "keep"
        self._memory.goal = self._goal()
        decision = Decision((call,), view, self._progress(pose), self._goal(), change, reason, raw="", prompt_digest="")
        return self._teller(decision, history) if self._teller else decision

    _room = 0.2  # Metres that a straight step keeps from everything.

    # the task
    @property
    def _spec(self) -> EpisodeSpec:
        return self._context.spec

    def _act(self, state: WorldState, pose: PelvisPose) -> tuple[Call, str]:
        if not self._spec.target_ids:
            return Call(self._stop), f"There is no {self._noun} here, so I stop."
        if self._spec.interact and self._memory.sits:
            return self._after_sitting(state)
        if not self._spec.interact and self._distance(state) <= STOP_DISTANCE:
            return Call(self._stop), "I am within reach of the target, so the task is complete."
        return self._go(state, pose)

    def _go(self, state: WorldState, pose: PelvisPose) -> tuple[Call, str]:
        """Take one step to the standing place, and on from there."""
        if self._memory.blocked >= 2:
            return self._break_free(pose)
        if not self._memory.way and not self._choose(pose):
            return Call(self._stop), "There is no way to any of the targets for a body, so I stop."
        part = self._memory.way[0]
        if isinstance(part, StairRun):
            return self._climb(pose, part)
        if len(self._memory.way) > 1:
            return self._to_stairs(state, pose, part)
        return self._at_stand(pose)

    def _at_stand(self, pose: PelvisPose) -> tuple[Call, str]:
        return self._seat(pose) if self._spec.interact else self._reach(pose)

    def _choose(self, pose: PelvisPose) -> bool:
        """Pick the target and the standing place with the cheapest route; False if there is none."""
        memory = self._memory
        routes = Routes.of(memory.floors, pose.root)
        stands = [s for s in self._stands() if (s.x, s.z) not in memory.given_up]
        prices = routes.to(np.array([s.place for s in stands]).reshape(-1, 3)) + [6.0 * s.gap for s in stands]
        if not len(stands) or not np.isfinite(prices).any():
            return False
        memory.stand = stands[int(np.argmin(prices))]
        memory.way = parts(routes.route(memory.stand.place))
        memory.arrived = memory.sideways = False
        # Stair skills are needed only in houses with stairs, so begin does not ask for them.
        if any(isinstance(part, StairRun) for part in memory.way):
            for needed in (UP, DOWN):
                skill_for(self._context.skills, needed)
        return bool(memory.way)

    def _stands(self) -> list[Viewpoint]:
        """Return places to stand at the targets."""
        sit, floors = self._spec.interact, self._memory.floors
        return [s for key in self._spec.target_ids for s in viewpoints(floors, self._scene, key, sit=sit)]

    # on stairs
    def _to_stairs(self, state: WorldState, pose: PelvisPose, part: LevelSegment) -> tuple[Call, str]:
        """Walk on this floor to the next stairs."""
        if np.linalg.norm(pose.point - part.path[-1]) > 0.2:
            return self._follow(pose, part)
        self._memory.way.pop(0)
        return self._go(state, pose)

    def _climb(self, pose: PelvisPose, run: StairRun) -> tuple[Call, str]:
        """Take one step up or down from the true place of the body: contact shortens some steps."""
        along, left = on_stairs(pose, run)
        k = int(np.argmin(np.abs(run.levels - (pose.root[1] - STANDING_HEIGHT))))
        if k == len(run.edges):
            self._memory.way.pop(0)
            return self._go(self._state(), pose)
        word = "up" if run.levels[-1] > run.levels[0] else "down"
        error = float(wrap_angle(run.yaw - pose.yaw))
        if abs(error) > np.radians(8 if k == 0 else 12):
            return self._turn(error), f"I square up to the stairs that lead {word}."
        if abs(left) > (0.12 if k == 0 else 0.2):
            return self._side(-left), "I keep to the middle of the stairs."
        gap = float(run.edges[k]) - along
        if k == 0 and gap > BEFORE_STEPS + 0.06:
            return self._walk(
                0.0, gap - BEFORE_STEPS, error
            ), f"I walk up to the first step of the stairs that lead {word}."
        tread = (run.edges[k + 1] - run.edges[k]) / 2 if k + 1 < len(run.edges) else ONTO_FLOOR
        height = abs(float(run.levels[k + 1] - run.levels[k]))
        call = self._call(UP if word == "up" else DOWN, height, gap + float(tread))
        return call, f"I take step {k + 1} of {len(run.edges)} {word} the stairs."

    # at the target
    def _reach(self, pose: PelvisPose) -> tuple[Call, str]:
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
        left, forward = pose.local(edge)
        error = float(np.arctan2(left, forward))
        if abs(error) > np.radians(20) and np.hypot(left, forward) > 0.05:
            return self._turn(error), "I am beside the target and turn to face it."
        gap = float(np.hypot(left, forward))
        return self._walk(0.0, min(0.25, max(0.1, gap)), error), "The target is right in front of me: I close the gap."

    def _sideways(self, pose: PelvisPose, edge: Array) -> tuple[Call, str]:
        """Turn the nearer side to the target: an arm reaches over furniture that stops the toes."""
        left, forward = pose.local(edge)
        bearing = float(np.arctan2(left, forward))
        side = 1.0 if bearing >= 0 else -1.0
        error = float(wrap_angle(bearing - side * np.pi / 2))
        if abs(error) > np.radians(20):
            return self._turn(error), f"My feet cannot get closer to the {self._noun}: I turn my side to it."
        return self._side(side * 0.15), f"I step sideways towards the {self._noun}."

    def _seat(self, pose: PelvisPose) -> tuple[Call, str]:
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
        left, ahead = pose.local(stand.point)
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

    def _arrived(self, pose: PelvisPose, stand: Viewpoint, tolerance: float) -> bool:
        if np.linalg.norm(pose.point - stand.point) < tolerance:
            self._memory.arrived = True
        return self._memory.arrived

    @property
    def _last(self) -> LevelSegment:
        """Return the last part of the way, which ends at the standing place."""
        part = self._memory.way[-1]
        assert isinstance(part, LevelSegment)
        return part

    def _follow(self, pose: PelvisPose, part: LevelSegment) -> tuple[Call, str]:
        """Take one step along a segment of the way."""
        towards, rest = aim(part.grid, part.path, pose.point, self._room)
        left, forward = pose.local(towards)
        error = float(np.arctan2(left, forward))
        if abs(error) > TURN_FIRST and np.hypot(left, forward) > 0.25:
            return self._turn(error), f"The way to the {self._noun} leads to my {side_of(left)}: I turn."
        if rest < 0.35 and forward < 0.1:
            return self._shuffle(left, forward), "I am almost at the place and adjust my footing."
        step = min(MAX_STEP, float(np.hypot(left, forward)), max(0.15, rest))
        reason = f"The way to the {self._noun} is {rest:.1f} m further: I walk on."
        return self._walk(0.3 * left, step * float(np.cos(error)), 0.7 * error), reason

    def _shuffle(self, left: float, forward: float) -> Call:
        if abs(left) > abs(forward):
            return self._side(left)
        return self._back(-forward) if forward < 0 else self._walk(0.0, forward, 0.0)

    # when blocked
    def _notice(self, pose: PelvisPose, history: Sequence[HistoryEntry]) -> None:
        """Compare the last step with its call: count sits and blocked steps."""
        memory = self._memory
        last = history[-1].executed if history else None
        sat = [self._sits(past.executed) for past in reversed(history)]
        memory.sits = next((k for k, is_sit in enumerate(sat) if not is_sit), len(sat))
        if last is None or memory.before is None:
            return
        wanted = way_of(self._context.skills, last)
        if wanted >= 0.08:
            moved = float(np.linalg.norm(pose.point - memory.before.point))
            memory.blocked = memory.blocked + 1 if moved < 0.35 * wanted else 0

    def _break_free(self, pose: PelvisPose) -> tuple[Call, str]:
        """Remember the obstacle, step to the side with most room, and plan again from there."""
        memory = self._memory
        ahead = np.array([np.sin(pose.yaw), np.cos(pose.yaw)])
        beside = np.array([ahead[1], -ahead[0]])
        if memory.stand is not None and memory.arrived:
            memory.given_up.add((memory.stand.x, memory.stand.z))
        elif memory.way and isinstance(memory.way[0], StairRun):
            memory.blocked, memory.way, memory.jams = 0, [], memory.jams + 1
            return self._back(0.15), "The stairs do not carry me on: I step back and try again."
        elif memory.way:
            # The scene shows no obstacle there, or the way would avoid it: assume one in front of the body.
            there = pose.root + 0.35 * np.array([ahead[0], 0.0, ahead[1]])
            memory.floors = memory.floors.with_obstacle(there, 0.12)
        memory.blocked, memory.way, memory.jams = 0, [], memory.jams + 1
        ways = {"back": -ahead, "left": beside, "right": -beside}
        plan = self._plan(pose)
        room = {name: float(plan.at(plan.clearance, pose.point + 0.3 * way)) for name, way in ways.items()}
        # After every second jam the next best side has its turn, since the best one did not help.
        best = sorted(room, key=lambda name: -room[name])[memory.jams % 4 // 2]
        reason = (
            f"Something is in my way: I step {'back' if best == 'back' else 'to the ' + best} and look for another way."
        )
        return (self._back(0.3) if best == "back" else self._side(0.3 if best == "left" else -0.3)), reason

    def _sits(self, call: Call | None) -> bool:
        return call is not None and self._context.skills[call.skill].role == "sit"

    # calls
    def _call(self, measures: Sequence[str], *amounts: float) -> Call:
        return asking(self._context.skills, measures, amounts)

    def _walk(self, left: float, forward: float, turn: float) -> Call:
        return self._call(WALK, left, forward, turn)

    def _turn(self, angle: float) -> Call:
        return self._call(TURN, angle)

    def _side(self, left: float) -> Call:
        return self._call(SIDE, left)

    def _back(self, distance: float) -> Call:
        return self._call(BACK, min(distance, 0.4))

    def _sit(self, seat_height: float) -> Call:
        tries = self._memory.sits
        return self._call(SIT, min(seat_height + HIPS_OVER_SEAT[tries], LEVEL_THIGHS[tries]))

    def _plan(self, pose: PelvisPose) -> OccupancyGrid:
        """Return the grid of the floor or the stairs that the body is on."""
        return self._memory.floors.grids[int(self._memory.floors.level(pose.root))]

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

    def _progress(self, pose: PelvisPose) -> str:
        if self._memory.sits:
            return f"I have reached the {self._noun} and sat down."
        if self._memory.arrived:
            return f"I have reached the {self._noun}."
        if not self._memory.way:
            return "I am looking for a way."
        return f"I am on the way, {remaining(self._memory.way, pose):.1f} m from the place to stand."

    def _look(self, state: WorldState) -> str:
        """Describe the room, and the nearest target in view."""
        pose = PelvisPose.of(state)
        plan = self._plan(pose)
        room = room_at(self._scene, float(pose.point[0]), float(pose.point[1]), plan.floor)
        on = "on" if room == "stairs" else "in"
        here = f"I am {on} the {room.replace('_', ' ')}." if room else "I am between two rooms."
        seen = [found for key in self._spec.target_ids if (found := in_view(plan, self._scene, state, key, self._gaze))]
        if not seen:
            return f"{here} No {self._noun} is in view." if self._spec.target_ids else here
        angle, distance = min(seen, key=lambda found: found[1])
        self._memory.seen = True
        side = "ahead" if abs(angle) < np.radians(15) else f"ahead on the {side_of(angle)}"
        return f"{here} A {self._noun} is {side}, about {distance:.1f} m away."
