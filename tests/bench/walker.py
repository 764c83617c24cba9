"""A body without dynamics for the tests of agents: it moves as it is told, give or take some noise, and walls stop it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from humanclaw.bench.routes import FloorPlan
from humanclaw.contract import Skill
from humanclaw.episode import EpisodeSpec
from humanclaw.interfaces import Call, Decision, DecisionMaker, EpisodeContext, Observation, Past, WorldState
from humanclaw.pose import STANDING_HEIGHT, Motion, rest_pose
from humanclaw.scene import Scene

ROOT = Path(__file__).parents[2]
_FOLDERS = [path.parent for path in sorted(ROOT.glob("skills/*/*/*/schema.json"))]
# A walker needs no adapters.
SKILLS = {folder.name: replace(Skill.from_folder(folder), adapter=None) for folder in _FOLDERS}
PICTURE = np.zeros((2, 2, 3), np.uint8)


@dataclass
class Walker:
    """Displacements and turns come out at 0.9 to 1.1 of what was asked, plus a centimetre and a degree of noise."""

    scene: Scene
    targets: tuple[int, ...] = ()
    seed: int = 0
    noise: float = 1.0
    x: float = 0.0
    z: float = 0.0
    yaw: float = 0.0
    height: float = STANDING_HEIGHT
    sat: bool = False
    solid: FloorPlan | None = None
    """What really is in the way, where that differs from the scene."""
    track: list[tuple[float, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        start = self.scene.start
        self.x, self.z, self.yaw = start.x, start.z, start.yaw
        self.rng = np.random.default_rng(self.seed)
        plan = self.solid or FloorPlan.of(self.scene, start.floor)
        mine = np.isin(plan.owners, self.targets)
        # Legs may touch the target itself; everything else keeps the shoulders off.
        self._target, self._rest = replace(plan, blocked=mine), replace(plan, blocked=plan.blocked & ~mine)

    def state(self) -> WorldState:
        body = rest_pose()
        rotations = body.rotations.copy()
        rotations[:, 0] = (0.0, self.yaw, 0.0)
        return WorldState(Motion(np.array([[self.x, self.scene.start.floor + self.height, self.z]]), rotations), {})

    def execute(self, call: Call) -> None:
        if self.sat and call.skill != "stop":
            self.sat, self.height = False, STANDING_HEIGHT
            self._go(0.0, 0.36, 0.0, through=True)
        params = {key: value * self._gain() for key, value in call.params.items()}
        left, forward = params.get("x_cm", 0.0) / 100, params.get("z_cm", 0.0) / 100
        if call.skill == "sit_in_place":
            self._go(0.0, -0.36, 0.0, through=True)
            self.sat, self.height = True, max(params["h_cm"] / 100, self._seat() + 0.14)
        elif call.skill != "stop":
            jitter = self.rng.normal(0, 0.01 * self.noise, 2) if params else np.zeros(2)
            turn = np.radians(params.get("yaw_deg", 0.0) + self.rng.normal(0, self.noise))
            self._go(left + jitter[0], (-forward if call.skill == "step_back" else forward) + jitter[1], turn)

    def _gain(self) -> float:
        return 1 + self.noise * float(self.rng.uniform(-0.1, 0.1))

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

    def _fits(self, step: np.ndarray) -> bool:
        here = np.array([self.x, self.z])
        plans = ((self._target, 0.06), (self._rest, 0.17))
        return all(
            plan.at(plan.clearance, here + step) >= min(radius, plan.at(plan.clearance, here) - 1e-9)
            for plan, radius in plans
        )

    def _seat(self) -> float:
        """Height of the seat below the hips, 0 over the floor."""
        for key in self.targets:
            low, high = self.scene.aabb(key)
            if low[0] < self.x < high[0] and low[2] < self.z < high[2]:
                return float(self.scene.assets[self.scene.by_id[key].asset].seat_height or 0.0)
        return 0.0


def play(
    maker: DecisionMaker, walker: Walker, spec: EpisodeSpec, skills: dict[str, Skill] = SKILLS
) -> list[tuple[Decision, Call]]:
    """The loop, without pictures and records: decisions and the checked calls, up to the active stop."""
    context = EpisodeContext(spec, skills, spec.seed)
    if maker.privileged:
        context = replace(context, scene=walker.scene, state=walker.state)
    maker.begin(context)
    history: list[Past] = []
    for step in range(spec.max_steps):
        decision = maker.decide(Observation(step, spec.instruction, PICTURE), history)
        (proposed,) = decision.calls
        call = Call(proposed.skill, skills[proposed.skill].check(proposed.params))
        walker.execute(call)
        history.append(Past(step, decision, call, "", PICTURE))
        if skills[call.skill].ends_episode:
            break
    return [(past.decision, past.executed) for past in history if past.executed]
