"""A body without dynamics for the tests of agents. It moves as commanded, with some noise, and walls stop it. Only the
skills for stairs take it from one stair to the next."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from declared import FOLDERS

from humanclaw.body import STANDING_HEIGHT, Motion, rest_pose
from humanclaw.plugins import Agent, EpisodeContext, HistoryEntry, Observation
from humanclaw.records import Decision, EpisodeSpec, Feedback
from humanclaw.skills import Call, Skill
from humanclaw.world import STEP, MultiFloorMap, OccupancyGrid, Scene, WorldState

# A walker needs no adapters.
SKILLS = {folder.name: replace(Skill.from_folder(folder), adapter=None) for folder in FOLDERS}
PICTURE = np.zeros((2, 2, 3), np.uint8)


@dataclass
class Walker:
    """Moves 0.9 to 1.1 times as far as commanded, plus noise with a standard deviation of 1 cm and 1 degree."""

    scene: Scene
    targets: tuple[int, ...] = ()
    seed: int = 0
    solid: OccupancyGrid | None = None
    """Where the obstacles are, if they differ from the scene."""

    def __post_init__(self) -> None:
        start = self.scene.start
        # `ground` is the height under the feet; `height` is that of the hips above it.
        self.x, self.z, self.yaw, self.ground = start.x, start.z, start.yaw, start.floor
        self.height, self.sat = STANDING_HEIGHT, False
        self.track: list[tuple[float, float]] = []
        self.rng = np.random.default_rng(self.seed)
        self.storeys = MultiFloorMap((self.solid,)) if self.solid else MultiFloorMap.of(self.scene)
        mine = [np.isin(plan.owners, self.targets) & (plan.slope is None) for plan in self.storeys.grids]
        # Legs may touch the target; the shoulders must clear everything else.
        self._target = [replace(plan, blocked=own) for plan, own in zip(self.storeys.grids, mine, strict=True)]
        self._rest = [
            replace(plan, blocked=plan.blocked & ~own) for plan, own in zip(self.storeys.grids, mine, strict=True)
        ]

    def state(self) -> WorldState:
        body = rest_pose()
        rotations = body.rotations.copy()
        rotations[:, 0] = (0.0, self.yaw, 0.0)
        return WorldState(Motion(np.array([[self.x, self.ground + self.height, self.z]]), rotations), {})

    def execute(self, call: Call) -> None:
        if self.sat and call.skill != "stop":
            self.sat, self.height = False, STANDING_HEIGHT
            self._go(0.0, 0.36, 0.0, through=True)
        params = {key: value * (1 + float(self.rng.uniform(-0.1, 0.1))) for key, value in call.params.items()}
        left, forward = params.get("x_cm", 0.0) / 100, params.get("z_cm", 0.0) / 100
        if call.skill == "sit_in_place":
            self._go(0.0, -0.36, 0.0, through=True)
            self.sat, self.height = True, max(params["h_cm"] / 100, self._seat() + 0.14)
        elif call.skill in ("climb_upstairs", "walk_downstairs"):
            self._go(0.0, params["d_cm"] / 100 - 0.02, 0.0, through=True)
            self._step(1.0 if call.skill == "climb_upstairs" else -1.0)
        elif call.skill != "stop":
            jitter = self.rng.normal(0, 0.01, 2) if params else np.zeros(2)
            turn = np.radians(params.get("yaw_deg", 0.0) + self.rng.normal(0, 1.0))
            self._go(left + jitter[0], (-forward if call.skill == "step_back" else forward) + jitter[1], turn)

    def _go(self, left: float, forward: float, turn: float, through: bool = False) -> None:
        ahead, beside = (np.array([np.sin(self.yaw + a), np.cos(self.yaw + a)]) for a in (0.0, np.pi / 2))
        for _ in range(15):
            step = (forward * ahead + left * beside) / 15
            for share in (step, step * [1, 0], step * [0, 1]):
                if through or self._fits(share):
                    self.x, self.z = self.x + share[0], self.z + share[1]
                    break
            self.yaw += turn / 15
            self.track.append((self.x, self.z))

    def _step(self, way: float) -> None:
        """Move onto the stair at this place, up or down; stay at the same height if there is none."""
        grounds = [float(plan.at(plan.ground, np.array([self.x, self.z]))) for plan in self.storeys.grids]
        near = [ground for ground in grounds if 0 <= way * (ground - self.ground) <= STEP]
        self.ground = max(near, key=lambda ground: way * ground, default=self.ground)

    def _fits(self, step: np.ndarray) -> bool:
        here = np.array([self.x, self.z])
        k = int(self.storeys.level(np.array([self.x, self.ground, self.z])))
        plans = ((self._target[k], 0.06), (self._rest[k], 0.17))
        return all(
            plan.at(plan.clearance, here + step) >= min(radius, plan.at(plan.clearance, here) - 1e-9)
            for plan, radius in plans
        )

    def _seat(self) -> float:
        """Return the height of the seat below the hips, metres; 0 if there is none."""
        for key in self.targets:
            low, high = self.scene.aabb(key)
            if low[0] < self.x < high[0] and low[2] < self.z < high[2]:
                return float(self.scene.assets[self.scene.by_id[key].asset].seat_height or 0.0)
        return 0.0


def play(
    agent: Agent, walker: Walker, spec: EpisodeSpec, skills: dict[str, Skill] = SKILLS
) -> list[tuple[Decision, Call]]:
    """Run the loop without pictures and records. Return decisions with their checked calls, up to the stop."""
    context = EpisodeContext(spec, skills, spec.seed)
    if agent.privileged:
        context = replace(context, scene=walker.scene, state=walker.state)
    agent.begin(context)
    history: list[HistoryEntry] = []
    for step in range(spec.max_steps):
        decision = agent.decide(Observation(step, spec.instruction, PICTURE), history)
        (proposed,) = decision.calls
        call = Call(proposed.skill, skills[proposed.skill].check(proposed.params))
        walker.execute(call)
        history.append(HistoryEntry(step, decision, Feedback(call), PICTURE))
        if skills[call.skill].role == "stop":
            break
    return [(past.decision, past.executed) for past in history if past.executed]
