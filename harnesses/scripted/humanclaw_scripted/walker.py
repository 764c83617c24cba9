"""Walk through a house, over floors and stairs, to the place with the cheapest route; break free when blocked."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from humanclaw import Call, EpisodeContext, EpisodeSpec, HistoryEntry, PluginError
from humanclaw.body import STANDING_HEIGHT, wrap_angle
from humanclaw.world import DistanceField, MultiFloorMap, OccupancyGrid, StairRun, Viewpoint, WorldState
from humanclaw_scripted.actions import (
    BACK,
    DOWN,
    MAX_STEP,
    SIDE,
    TURN,
    TURN_FIRST,
    UP,
    WALK,
    asking,
    ending,
    looked_for,
    require_target,
    skill_for,
    way_of,
)
from humanclaw_scripted.ground_truth import BodyView
from humanclaw_scripted.path_following import BEFORE_STEPS, ONTO_FLOOR, LevelSegment, aim, on_stairs, parts, side_of


@dataclass
class Memory:
    """The oracle's state from step to step."""

    floors: MultiFloorMap
    way: list[LevelSegment | StairRun] = field(default_factory=list)
    """The rest of the way, the current part first; empty without a plan."""
    stand: Viewpoint | None = None
    before: BodyView | None = None
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


class Walker(ABC):
    """Walks to one of the places to stand, from the true state. A subclass says which those are, and acts there."""

    ready = staticmethod(require_target)

    def begin(self, context: EpisodeContext) -> None:
        if context.scene is None or context.state is None:
            raise PluginError("the oracle needs the scene and the state.", "Run it through the loop.")
        self._context, self._scene, self._state = context, context.scene, context.state
        self._noun, self._stop = looked_for(context.spec), ending(context.skills)
        self._bound_for = self._noun
        for needed in (WALK, TURN, SIDE, BACK):
            skill_for(context.skills, needed)
        self._memory = Memory(MultiFloorMap.of(self._scene, context.state().objects))

    @abstractmethod
    def _stands(self) -> list[Viewpoint]:
        """Return places to stand."""

    @abstractmethod
    def _at_stand(self, pose: BodyView) -> tuple[Call, str]:
        """Take one step on the last part of the way, or at its end."""

    @property
    def _spec(self) -> EpisodeSpec:
        return self._context.spec

    @property
    def _room(self) -> float:
        """Metres that a straight step keeps from everything."""
        return 0.2

    # the way
    def _plan(self, pose: BodyView) -> OccupancyGrid:
        """Return the grid of the floor or the stairs that the body is on."""
        return self._memory.floors.grids[int(self._memory.floors.level(pose.root))]

    def _go(self, state: WorldState, pose: BodyView) -> tuple[Call, str]:
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

    def _choose(self, pose: BodyView) -> bool:
        """Pick the target and the standing place with the cheapest route; False if there is none."""
        memory = self._memory
        routes = DistanceField.comfortable(memory.floors, pose.root)
        stands = [s for s in self._stands() if (s.x, s.z) not in memory.given_up]
        prices = routes.at(np.array([s.place for s in stands]).reshape(-1, 3)) + [6.0 * s.gap for s in stands]
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

    def _arrived(self, pose: BodyView, stand: Viewpoint, tolerance: float) -> bool:
        if np.linalg.norm(pose.point - stand.point) < tolerance:
            self._memory.arrived = True
        return self._memory.arrived

    @property
    def _last(self) -> LevelSegment:
        """Return the last part of the way, which ends at the standing place."""
        part = self._memory.way[-1]
        assert isinstance(part, LevelSegment)
        return part

    def _follow(self, pose: BodyView, part: LevelSegment) -> tuple[Call, str]:
        """Take one step along a segment of the way."""
        towards, rest = aim(part.grid, part.path, pose.point, self._room)
        left, forward = pose.on_floor(towards)
        error = float(np.arctan2(left, forward))
        if abs(error) > TURN_FIRST and np.hypot(left, forward) > 0.25:
            return self._turn(error), f"The way to the {self._bound_for} leads to my {side_of(left)}: I turn."
        if rest < 0.35 and forward < 0.1:
            return self._shuffle(left, forward), "I am almost at the place and adjust my footing."
        step = min(MAX_STEP, float(np.hypot(left, forward)), max(0.15, rest))
        reason = f"I walk on along the way to the {self._bound_for}."
        return self._walk(0.3 * left, step * float(np.cos(error)), 0.7 * error), reason

    def _shuffle(self, left: float, forward: float) -> Call:
        if abs(left) > abs(forward):
            return self._side(left)
        return self._back(-forward) if forward < 0 else self._walk(0.0, forward, 0.0)

    # on stairs
    def _to_stairs(self, state: WorldState, pose: BodyView, part: LevelSegment) -> tuple[Call, str]:
        """Walk on this floor to the next stairs."""
        if np.linalg.norm(pose.point - part.path[-1]) > 0.2:
            return self._follow(pose, part)
        self._memory.way.pop(0)
        return self._go(state, pose)

    def _climb(self, pose: BodyView, run: StairRun) -> tuple[Call, str]:
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

    # when blocked
    def _notice(self, pose: BodyView, history: Sequence[HistoryEntry]) -> None:
        """Compare the last step with its call: count blocked steps."""
        memory = self._memory
        last = history[-1].executed if history else None
        if last is None or memory.before is None:
            return
        wanted = way_of(self._context.skills, last)
        if wanted >= 0.08:
            moved = float(np.linalg.norm(pose.point - memory.before.point))
            memory.blocked = memory.blocked + 1 if moved < 0.35 * wanted else 0

    def _break_free(self, pose: BodyView) -> tuple[Call, str]:
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
