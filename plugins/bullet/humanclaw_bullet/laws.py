"""The laws of half-physics, measured: what `humanclaw physics` prints.

Each law is a function of a Lab that yields Findings: what was measured, and within what bounds it has to lie. They are measured
with the motion that skills generate, and, where that would prove little, with commands that no skill would ever give.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from humanclaw.contract import Control
from humanclaw.errors import HumanclawError
from humanclaw.interfaces import Execution, MotionGenerator
from humanclaw.plugins import Plugins
from humanclaw.pose import FPS, FUTURE, HISTORY, Array, Motion, matrix_from_vector, rest_pose
from humanclaw.scene import Scene
from humanclaw_bullet.profile import Profile, find_profile
from humanclaw_bullet.simulator import HalfPhysics
from humanclaw_bullet.workshop import Workshop
from humanclaw_train.realised import anchored

Calls = Sequence[tuple[str, dict[str, float]]]
Tick = Callable[[], object]
GRAVITY: Final = 9.81
STRIDE: Final = 0.28
"""Depth of the stairs' treads, metres."""
RISES: Final = (0.10, 0.13, 0.16, 0.19, 0.22)
STEPS: Final = 6
SEATS: Final = (0.36, 0.42, 0.46, 0.50, 0.55, 0.60, 0.65)
"""Heights of seats, metres; the knees are at 0.49."""
MASSES: Final = (1.0, 5.0, 10.0, 20.0)


@dataclass(frozen=True)
class Finding:
    """A measured number and the bounds that the law sets it."""

    law: str
    measure: str
    value: float
    unit: str
    low: float = -np.inf
    high: float = np.inf

    @property
    def holds(self) -> bool:
        return bool(self.low <= self.value <= self.high)


@dataclass(frozen=True)
class Played:
    """What was commanded and what became of it, chunk after chunk, world frame."""

    start: Array
    """(3,) root before the first chunk."""
    commanded: tuple[Motion, ...]
    executions: tuple[Execution, ...]
    objects: dict[int, Array]
    """Movable object id to (7,) at the end."""

    @property
    def realised(self) -> Motion:
        parts = [execution.realised for execution in self.executions]
        return Motion(np.concatenate([p.root for p in parts]), np.concatenate([p.rotations for p in parts]))

    def achieved(self) -> Array:
        """(3,) displacement of the root, as a share of the displacement that was commanded chunk by chunk."""
        ends = np.stack([self.start, *(execution.realised.root[-1] for execution in self.executions)])
        asked = np.stack([motion.root[-1] for motion in self.commanded]) - ends[:-1]
        return np.asarray((ends[-1] - ends[0]) / asked.sum(axis=0))

    def depths(self, thing: int) -> Array:
        """How deep links were in an object, metres, in every frame in which they touched it."""
        return np.array([c.depth for e in self.executions for c in e.contacts if c.object_id == thing])


@dataclass
class Lab:
    """Where laws are measured. samples: of random walls; chunks: of random commands."""

    profile: Profile
    samples: int = 200
    chunks: int = 10_000
    seed: int = 0
    plugins: Plugins = field(default_factory=Plugins.discover)

    def __post_init__(self) -> None:
        self._generator: MotionGenerator = self.plugins.make("motion_generators", "dit")

    @classmethod
    def of(cls, profile: str, **numbers: int) -> Lab:
        return cls(find_profile(profile), **numbers)

    def start(self) -> Motion:
        """Five frames of standing at the origin."""
        return self._generator.start()

    def generate(self, history: Motion, skill: str, params: dict[str, float], number: int) -> Motion:
        chosen = self.plugins.skill(skill)
        plan = chosen.plan(chosen.check(params))
        if not isinstance(plan, Control):
            raise HumanclawError(f"the laws are measured with motion that is generated, and {skill} is not.")
        return self._generator.generate(history, plan.adapter, plan.values, (self.seed, number))

    def perform(self, scene: Scene, calls: Calls, profile: Profile | None = None) -> Played:
        """Let a body that stands on the scene's start carry out some calls."""
        simulator = HalfPhysics(profile or self.profile)
        body = simulator.reset(scene, scene.start).body
        history, commanded, executions = anchored(self.start(), body), [], []
        for number, (skill, params) in enumerate(calls):
            motion = self.generate(history, skill, params, number)
            execution = simulator.execute(motion)
            history = anchored(history.then(motion)[-HISTORY:], execution.realised)
            commanded.append(motion)
            executions.append(execution)
        objects = dict(simulator.state().objects)
        simulator.close()
        return Played(body.root[-1], tuple(commanded), tuple(executions), objects)

    def imagine(self, calls: Calls) -> Motion:
        """The same calls as pure kinematics: generated motion played back, and no world."""
        motion = self.start()
        for number, (skill, params) in enumerate(calls):
            motion = motion.then(self.generate(motion[-HISTORY:], skill, params, number))
        return motion


def walk(count: int, z_cm: int = 50, **params: float) -> Calls:
    return [("walk", {"z_cm": z_cm, **params})] * count


# -- the laws ----------------------------------------------------------------------------------------------------------
def free_space(lab: Lab, tick: Tick) -> Iterator[Finding]:
    """A walk commanded to a body that falls and touches nothing; heights, which are not commanded, are taken from the root."""
    command = lab.imagine(walk(2, 60))[HISTORY:]
    path = np.arange(1, 11)[:, None] / FPS * [0.0, 0.0, 5.0]
    off = Motion(rest_pose().root + path, rest_pose(10).rotations)
    gap = (off.root[-1] - command.root[0]) * [1, 0, 1] + [0.0, 0.0, 0.12]
    shop = Workshop()
    shop.box("floor", (0.8, 30, 0.8), (0, -30, 0))
    simulator, scene = HalfPhysics(lab.profile), shop.scene()
    simulator.reset(scene, scene.start)
    simulator.execute(off)
    falling = Motion(command.root + gap, command.rotations)
    realised = simulator.execute(falling).realised
    touching = simulator.execute(falling[-1:]).contacts
    simulator.close()
    drop = (realised.root[:, 1] - falling.root[:, 1])[:, None, None] * [0.0, 1.0, 0.0]
    error = np.linalg.norm(realised.joints() - drop - falling.joints(), axis=-1)[5:]
    yield Finding("free space", "mean joint error", 1000 * float(error.mean()), "mm", high=1.0)
    yield Finding("free space", "largest joint error", 1000 * float(error.max()), "mm", high=10.0)
    yield Finding("free space", "contacts meanwhile", len(touching), "", high=0)
    tick()


def walls(lab: Lab, tick: Tick) -> Iterator[Finding]:
    """Two seconds of walking at walls of any distance, angle and thickness."""
    rng = np.random.default_rng([lab.seed, 1])
    depths, beyond, imagined = [np.zeros(1)], 0, 0
    for _ in range(lab.samples):
        distance, angle, thickness = rng.uniform(0.6, 1.0), rng.uniform(-0.6, 0.6), rng.uniform(0.08, 0.2)
        normal = np.array([np.sin(angle), 0.0, np.cos(angle)])
        shop = Workshop()
        shop.floor()
        place = tuple((normal * thickness / 2 + [0.0, 0.0, distance]).tolist())
        wall = shop.box("wall", (6, 2.5, thickness), place, rotation=(0, np.sin(angle / 2), 0, np.cos(angle / 2)))
        calls = walk(4, int(rng.integers(50, 81)))
        played = lab.perform(shop.scene(), calls)
        depths.append(played.depths(wall))
        beyond += bool(((played.realised.root - [0, 0, distance]) @ normal).max() > 0)
        imagined += bool((lab.imagine(calls).root[-1] - [0, 0, distance]) @ normal > thickness)
        tick()
    depth = 100 * np.concatenate(depths)
    share = 100 / lab.samples
    yield Finding("a wall blocks", f"deepest contact of {lab.samples} walls", float(depth.max()), "cm", high=1.0)
    yield Finding("a wall blocks", "bodies behind the wall", share * beyond, "%", high=0)
    yield Finding("a wall blocks", "pure kinematics behind it", share * imagined, "%", low=100)


def ledge(lab: Lab, tick: Tick) -> Iterator[Finding]:
    """A step over the edge of a platform, and the fall while nothing is touched."""
    shop = Workshop()
    shop.box("floor", (2, 12, 1.6), (0, -12, 0))
    played = lab.perform(shop.scene(), walk(5, 80))
    touching = [k * FUTURE + contact.frames[0] for k, e in enumerate(played.executions) for contact in e.contacts]
    begun = max(touching) + 2
    fall = np.diff(played.realised.root[begun : begun + FUTURE, 1], 2).mean() * FPS**2
    yield Finding("a step into the air falls", "acceleration", -float(fall), "m/s2", 0.98 * GRAVITY, 1.02 * GRAVITY)
    tick()


def stairs(lab: Lab, tick: Tick) -> Iterator[Finding]:
    """A flight of six, up and down, begun one tread before the first riser, and half a foot before the first edge."""
    for skill, law in (("climb_upstairs", "stairs carry up"), ("walk_downstairs", "stairs carry down")):
        heights, advances = [], []
        for rise in RISES:
            shop, up = Workshop(), skill == "climb_upstairs"
            shop.floor()
            (shop.steps if up else shop.descent)(STEPS, rise, STRIDE, STRIDE + 0.12 if up else 0.16)
            call = (skill, {"h_cm": round(100 * rise), "d_cm": round(100 * STRIDE)})
            played = lab.perform(shop.scene(0.0 if up else STEPS * rise), [call] * (STEPS + 1))
            heights.append(abs(played.realised.root[-1, 1] - played.start[1]) / (STEPS * rise))
            advances.append(played.achieved()[2])
            tick()
        worst = int(np.argmax(np.abs(np.array(advances) - 1)))
        what = f"{100 * min(RISES):.0f} to {100 * max(RISES):.0f} cm"
        yield Finding(law, f"least height of the flight reached, {what}", 100 * min(heights), "%", 95, 105)
        yield Finding(law, "forward travel, worst realised/commanded", 100 * advances[worst], "%", 95, 105)


def boxes(lab: Lab, tick: Tick) -> Iterator[Finding]:
    """A box of 40 cm in the way of two seconds of walking."""
    for mass in MASSES:
        shop = Workshop()
        shop.floor()
        box = shop.box("box", (0.4, 0.4, 0.4), (0, 0, 0.6), movable=True, mass=mass)
        shift = lab.perform(shop.scene(), walk(4)).objects[box][2] - 0.6
        yield Finding("a pushed box moves", f"way of {mass:g} kg", float(shift), "m", low=0.3)
        tick()


def door(lab: Lab, tick: Tick) -> Iterator[Finding]:
    """A gap of 60 cm between two walls; the body with its arms hanging is 75 cm wide."""
    offsets, through, depths = (-0.04, -0.02, 0.0, 0.02, 0.04), 0, [np.zeros(1)]
    for offset in offsets:
        shop = Workshop()
        shop.floor()
        sides = [shop.box("wall", (2, 2.5, 0.1), (offset + x, 0, 0.8)) for x in (-1.3, 1.3)]
        played = lab.perform(shop.scene(), walk(5))
        through += bool(played.realised.root[-1, 2] > 1.1)
        depths += [played.depths(side) for side in sides]
        tick()
    yield Finding("a 60 cm door is squeezed through", "bodies through it", 100 * through / len(offsets), "%", low=100)
    depth = 100 * float(np.concatenate(depths).max())
    yield Finding("a 60 cm door is squeezed through", "deepest contact", depth, "cm", high=1.0)


def seats(lab: Lab, tick: Tick) -> Iterator[Finding]:
    """Benches from 36 to 65 cm, lower and higher than the knees, half a metre behind the body."""
    touched, gaps = 0, []
    for seat in SEATS:
        shop = Workshop()
        shop.floor()
        bench = shop.box("couch", (1.6, seat, 0.8), (0, 0, -0.53))
        played = lab.perform(shop.scene(), [("sit_in_place", {"h_cm": round(100 * seat + 13)})] * 3)
        last = played.executions[-1]
        touched += any(c.joint == "pelvis" and c.object_id == bench and FUTURE - 1 in c.frames for c in last.contacts)
        gaps.append(last.realised.root[-1, 1] - seat - 0.14)
        tick()
    share = 100 * touched / len(SEATS)
    yield Finding(
        "sitting touches the seat", f"pelvis on seats of {SEATS[0]:g} to {SEATS[-1]:g} m", share, "%", low=100
    )
    yield Finding("sitting touches the seat", "highest pelvis over its seat", 100 * float(max(gaps)), "cm", high=1.0)


def wild(lab: Lab, tick: Tick) -> Iterator[Finding]:
    """Random poses, held, jittering or upright, far beyond what any skill commands, in a small furnished room."""
    rng, worst = np.random.default_rng([lab.seed, 2]), _Worst()
    simulator = HalfPhysics(lab.profile)
    for number in range(lab.chunks):
        if number % 250 == 0:
            state = simulator.reset(_furnished(), _furnished().start)
        before = state.body.root
        execution = simulator.execute(_wild(rng, number, before))
        state = simulator.state()
        worst.add(execution, before, upright=number % 3 == 2)
        tick()
    simulator.close()
    law = f"{lab.chunks} random chunks"
    bound = lab.profile.max_link_speed + lab.profile.max_speed
    yield Finding(law, "not finite", worst.broken, "", high=0)
    yield Finding(law, "upright poses that did not end upright", worst.fallen, "", high=0)
    yield Finding(law, "lowest joint", 100 * worst.lowest, "cm", low=-2.0)
    yield Finding(law, "outside the room", worst.outside, "", high=0)
    yield Finding(law, "fastest link", worst.speed, "m/s", high=bound)
    yield Finding(law, "deepest contact with the building", 100 * worst.depth, "cm", high=5.0)


def _furnished() -> Scene:
    shop = Workshop()
    shop.room()
    shop.box("couch", (1.6, 0.45, 0.8), (0, 0, -1.0))
    shop.box("box", (0.3, 0.3, 0.3), (0.8, 0, 0.8), movable=True, mass=2.0)
    return shop.scene()


def _wild(rng: np.random.Generator, number: int, before: Array) -> Motion:
    held, jitter = rng.normal(0, 1.2, (1, 24, 3)).repeat(FUTURE, axis=0), rng.normal(0, 1.0, (FUTURE, 24, 3))
    path = np.cumsum(rng.normal(0, 0.03, 3) + rng.normal(0, 0.05, (FUTURE, 3)), axis=0)
    return Motion(before + path, (held, jitter, rest_pose(FUTURE).rotations)[number % 3])


@dataclass
class _Worst:
    broken: int = 0
    fallen: int = 0
    outside: int = 0
    lowest: float = np.inf
    speed: float = 0.0
    depth: float = 0.0

    def add(self, execution: Execution, before: Array, upright: bool) -> None:
        joints = execution.realised.joints()
        if not np.isfinite(joints).all() or not all(np.isfinite(path).all() for path in execution.objects.values()):
            self.broken += 1
            return
        up = float(matrix_from_vector(execution.realised.rotations[-1, 0])[1, 1])
        self.fallen += upright and up < 0.99
        self.outside += bool(np.abs(joints[..., [0, 2]]).max() > 2.0)
        self.lowest = min(self.lowest, float(joints[..., 1].min()))
        self.speed = max(self.speed, float(np.linalg.norm(np.diff(joints, axis=0), axis=-1).max() * FPS))
        self.depth = max([self.depth, *(c.depth for c in execution.contacts if not c.movable)])


def rates(lab: Lab, tick: Tick) -> Iterator[Finding]:
    """The same commands at 60, 120 and 240 Hz: on a floor, at a wall, up the stairs and onto a seat."""
    apart = {name: _apart(lab, scene, calls, tick) for name, (scene, calls) in _rate_scenes().items()}
    for name, metres in apart.items():
        yield Finding("60, 120 and 240 Hz agree", f"root apart, {name}", 100 * metres, "cm", high=2.0)


def _rate_scenes() -> dict[str, tuple[Scene, Calls]]:
    shops = {name: Workshop() for name in ("walking", "at a wall", "on stairs", "on a seat")}
    for shop in shops.values():
        shop.floor()
    shops["at a wall"].box("wall", (6, 2.5, 0.2), (0, 0, 0.9))
    shops["on stairs"].steps(STEPS, 0.16, STRIDE, STRIDE + 0.12)
    shops["on a seat"].box("couch", (1.6, 0.42, 0.8), (0, 0, -0.53))
    climb: tuple[str, dict[str, float]] = ("climb_upstairs", {"h_cm": 16, "d_cm": 28})
    calls: list[Calls] = [walk(4), walk(4), [climb] * 4, [("sit_in_place", {"h_cm": 55})] * 3]
    return {name: (shop.scene(), call) for (name, shop), call in zip(shops.items(), calls, strict=True)}


def _apart(lab: Lab, scene: Scene, calls: Calls, tick: Tick) -> float:
    """Largest distance between the ends of any two rates."""
    ends = []
    for substeps in (2, 4, 8):
        ends.append(lab.perform(scene, calls, replace(lab.profile, substeps=substeps)).realised.root[-1])
        tick()
    return float(max(np.linalg.norm(a - b) for a in ends for b in ends))


LAWS: Final[dict[str, Callable[[Lab, Tick], Iterator[Finding]]]] = {
    "free-space": free_space, "walls": walls, "ledge": ledge, "stairs": stairs, "boxes": boxes, "door": door, "seats": seats,
    "rates": rates, "wild": wild,
}  # fmt: skip


def ticks(lab: Lab, names: Sequence[str]) -> int:
    """How often the laws of these names will tick."""
    each: dict[str, Any] = {
        "free-space": 1, "walls": lab.samples, "ledge": 1, "stairs": 2 * len(RISES), "boxes": len(MASSES), "door": 5,
        "seats": len(SEATS), "rates": 12, "wild": lab.chunks,
    }  # fmt: skip
    return sum(each[name] for name in names)


def table(findings: Sequence[Finding]) -> str:
    """The findings as a Markdown table."""
    lines = ["| law | measure | found | bound | holds |", "| --- | --- | --- | --- | --- |"]
    for f in findings:
        bounds = [f"{sign} {bound:g}" for sign, bound in (("≥", f.low), ("≤", f.high)) if np.isfinite(bound)]
        found = f"{f.value:.3g} {f.unit}".strip()
        lines.append(f"| {f.law} | {f.measure} | {found} | {', '.join(bounds)} | {'yes' if f.holds else '**no**'} |")
    return "\n".join(lines)
