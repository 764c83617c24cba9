"""Laws about a body, and the list of all. `humanclaw physics` prints them.

Each law is a function of a Fixture that yields Findings: a measured number with its bounds. Most use the motion that
skills generate. Where that would prove little, they use commands that no skill would give.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from humanclaw.body.limits import shoe_heights
from humanclaw.body.pose import FPS, FUTURE, HISTORY, Array, Motion, forward_kinematics, matrix_from_vector, rest_pose
from humanclaw.laws.fixture import DROP, FORWARD, HEIGHT, RISE, Command, Finding, Fixture, walk
from humanclaw.laws.objects import boxes, chair, door, hinges, lids, slides
from humanclaw.world.joints import GRAVITY
from humanclaw.world.scene import Scene
from humanclaw.world.scene_builder import SceneBuilder
from humanclaw.world.simulator import Execution

STEP_DEPTH: Final = 0.28
"""Depth of the stairs' treads, metres."""
RISES: Final = (0.10, 0.13, 0.16, 0.19, 0.22)
STEPS: Final = 6
SEATS: Final = (0.36, 0.42, 0.46, 0.50, 0.55, 0.60, 0.65)
"""Heights of seats, metres. The knees are at 0.49."""
REACHED: Final = 0.5
"""Highest seat from which the feet reach the floor, metres."""


# -- the checks --------------------------------------------------------------------------------------------------------
def free_space(fixture: Fixture) -> Iterator[Finding]:
    """Check a walk of a falling body that touches nothing.

    Heights are not commanded, so they are compared relative to the root.
    """
    command = fixture.imagine(walk(2, 0.6))[HISTORY:]
    path = np.arange(1, 11)[:, None] / FPS * [0.0, 0.0, 5.0]
    off = Motion(rest_pose().root + path, rest_pose(10).rotations)
    gap = (off.root[-1] - command.root[0]) * [1, 0, 1] + [0.0, 0.0, 0.12]
    builder = SceneBuilder()
    builder.box("floor", (0.8, 30, 0.8), (0, -30, 0))
    simulator, scene = fixture.simulator(), builder.scene()
    simulator.reset(scene, scene.start)
    simulator.execute(off)
    falling = Motion(command.root + gap, command.rotations)
    simulated = simulator.execute(falling).simulated
    touching = simulator.execute(falling[-1:]).contacts
    simulator.close()
    drop = (simulated.root[:, 1] - falling.root[:, 1])[:, None, None] * [0.0, 1.0, 0.0]
    error = np.linalg.norm(simulated.joints() - drop - falling.joints(), axis=-1)[5:]
    yield Finding("free space", "mean joint error", 1000 * float(error.mean()), "mm", high=1.0)
    yield Finding("free space", "largest joint error", 1000 * float(error.max()), "mm", high=10.0)
    yield Finding("free space", "contacts meanwhile", len(touching), "", high=0)


def walls(fixture: Fixture) -> Iterator[Finding]:
    """Check two seconds of walking into walls of random distance, angle and thickness."""
    rng = np.random.default_rng([fixture.seed, 1])
    depths, beyond, imagined = [np.zeros(1)], 0, 0
    for _ in range(fixture.samples):
        distance, angle, thickness = rng.uniform(0.6, 1.0), rng.uniform(-0.6, 0.6), rng.uniform(0.08, 0.2)
        normal = np.array([np.sin(angle), 0.0, np.cos(angle)])
        builder = SceneBuilder.on_floor()
        place = tuple((normal * thickness / 2 + [0.0, 0.0, distance]).tolist())
        wall = builder.box("wall", (6, 2.5, thickness), place, rotation=(0, np.sin(angle / 2), 0, np.cos(angle / 2)))
        commands = walk(4, float(rng.integers(50, 81)) / 100)
        played = fixture.perform(builder.scene(), commands)
        depths.append(played.depths(wall))
        beyond += bool(((played.simulated.root - [0, 0, distance]) @ normal).max() > 0)
        imagined += bool((fixture.imagine(commands).root[-1] - [0, 0, distance]) @ normal > thickness)
    depth = 100 * np.concatenate(depths)
    share = 100 / fixture.samples
    yield Finding("a wall blocks", f"deepest contact of {fixture.samples} walls", float(depth.max()), "cm", high=1.0)
    yield Finding("a wall blocks", "bodies behind the wall", share * beyond, "%", high=0)
    yield Finding("a wall blocks", "pure kinematics behind it", share * imagined, "%", low=100)


def ledge(fixture: Fixture) -> Iterator[Finding]:
    """Check a step over the edge of a platform, and the free fall."""
    builder = SceneBuilder()
    builder.box("floor", (2, 12, 1.6), (0, -12, 0))
    played = fixture.perform(builder.scene(), walk(5, 0.8))
    touching = [
        k * FUTURE + contact.frames[0] for k, chunk in enumerate(played.chunks) for contact in chunk.execution.contacts
    ]
    begun = max(touching) + 2
    fall = np.diff(played.simulated.root[begun : begun + FUTURE, 1], 2).mean() * FPS**2
    yield Finding("a step into the air falls", "acceleration", -float(fall), "m/s2", 0.98 * GRAVITY, 1.02 * GRAVITY)


def stairs(fixture: Fixture) -> Iterator[Finding]:
    """Check six stairs up and down, begun one tread before the first riser and half a foot before the first edge."""
    for change, check in ((RISE, "stairs carry up"), (DROP, "stairs carry down")):
        heights, advances = [], []
        for rise in RISES:
            builder, up = SceneBuilder(), change == RISE
            builder.floor()
            (builder.steps if up else builder.descent)(STEPS, rise, STEP_DEPTH, STEP_DEPTH + 0.12 if up else 0.16)
            played = fixture.perform(
                builder.scene(0.0 if up else STEPS * rise), [{change: rise, FORWARD: STEP_DEPTH}] * (STEPS + 1)
            )
            heights.append(abs(played.simulated.root[-1, 1] - played.began.body.root[-1, 1]) / (STEPS * rise))
            advances.append(played.achieved()[2])
        worst = int(np.argmax(np.abs(np.array(advances) - 1)))
        what = f"{100 * min(RISES):.0f} to {100 * max(RISES):.0f} cm"
        yield Finding(check, f"least height of the flight reached, {what}", 100 * min(heights), "%", 95, 105)
        yield Finding(check, "forward travel, worst simulated/commanded", 100 * advances[worst], "%", 95, 105)


def seats(fixture: Fixture) -> Iterator[Finding]:
    """Check sitting down on benches of 36 to 65 cm, half a metre behind the body. Feet reach the floor from 50 cm."""
    touched, gaps, shoes = 0, [], []
    for seat in SEATS:
        builder = SceneBuilder.on_floor()
        bench = builder.box("couch", (1.6, seat, 0.8), (0, 0, -0.53))
        played = fixture.perform(builder.scene(), [{HEIGHT: seat + 0.13}] * 3)
        last = played.chunks[-1].execution
        touched += any(c.joint == "pelvis" and c.object_id == bench and FUTURE - 1 in c.frames for c in last.contacts)
        gaps.append(last.simulated.root[-1, 1] - seat - 0.14)
        if seat <= REACHED:
            shoes += shoe_heights(*forward_kinematics(last.simulated.root[-1], last.simulated.rotations[-1])).tolist()
    share = 100 * touched / len(SEATS)
    yield Finding(
        "sitting touches the seat", f"pelvis on seats of {SEATS[0]:g} to {SEATS[-1]:g} m", share, "%", low=100
    )
    yield Finding("sitting touches the seat", "highest pelvis over its seat", 100 * float(max(gaps)), "cm", high=1.0)
    what = f"highest shoe over the floor, seats up to {REACHED:g} m"
    yield Finding("sitting touches the seat", what, 100 * max(shoes), "cm", high=1.0)


def wild(fixture: Fixture) -> Iterator[Finding]:
    """Check random poses (held, jittering, upright), far beyond any skill, in a small furnished room."""
    rng, worst = np.random.default_rng([fixture.seed, 2]), _Worst()
    simulator = fixture.simulator()
    for number in range(fixture.chunks):
        if number % 250 == 0:
            state = simulator.reset(_furnished(), _furnished().start)
        before = state.body.root
        execution = simulator.execute(_wild(rng, number, before))
        state = simulator.state()
        worst.add(execution, before, upright=number % 3 == 2)
        fixture.progress()
    simulator.close()
    check = f"{fixture.chunks} random chunks"
    bound = fixture.profile.max_link_speed + fixture.profile.max_speed
    yield Finding(check, "not finite", worst.broken, "", high=0)
    yield Finding(check, "upright poses that did not end upright", worst.fallen, "", high=0)
    yield Finding(check, "lowest joint", 100 * worst.lowest, "cm", low=-2.0)
    yield Finding(check, "outside the room", worst.outside, "", high=0)
    yield Finding(check, "fastest link", worst.speed, "m/s", high=bound)
    yield Finding(check, "deepest contact with the building", 100 * worst.depth, "cm", high=5.0)


def _furnished() -> Scene:
    builder = SceneBuilder()
    builder.room()
    builder.box("couch", (1.6, 0.45, 0.8), (0, 0, -1.0))
    builder.box("box", (0.3, 0.3, 0.3), (0.8, 0, 0.8), movable=True, mass=2.0)
    return builder.scene()


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
        joints = execution.simulated.joints()
        if not np.isfinite(joints).all() or not all(np.isfinite(path).all() for path in execution.objects.values()):
            self.broken += 1
            return
        up = float(matrix_from_vector(execution.simulated.rotations[-1, 0])[1, 1])
        self.fallen += upright and up < 0.99
        self.outside += bool(np.abs(joints[..., [0, 2]]).max() > 2.0)
        self.lowest = min(self.lowest, float(joints[..., 1].min()))
        self.speed = max(self.speed, float(np.linalg.norm(np.diff(joints, axis=0), axis=-1).max() * FPS))
        self.depth = max([self.depth, *(c.depth for c in execution.contacts if not c.movable)])


def rates(fixture: Fixture) -> Iterator[Finding]:
    """Check the same commands at 60, 120 and 240 Hz: on a floor, at a wall, up the stairs and onto a seat."""
    apart = {name: _apart(fixture, scene, commands) for name, (scene, commands) in _rate_scenes().items()}
    for name, metres in apart.items():
        yield Finding("60, 120 and 240 Hz agree", f"root apart, {name}", 100 * metres, "cm", high=2.0)


def _rate_scenes() -> dict[str, tuple[Scene, Sequence[Command]]]:
    builders = {name: SceneBuilder() for name in ("walking", "at a wall", "on stairs", "on a seat")}
    for builder in builders.values():
        builder.floor()
    builders["at a wall"].box("wall", (6, 2.5, 0.2), (0, 0, 0.9))
    builders["on stairs"].steps(STEPS, 0.16, STEP_DEPTH, STEP_DEPTH + 0.12)
    builders["on a seat"].box("couch", (1.6, 0.42, 0.8), (0, 0, -0.53))
    climb = {RISE: 0.16, FORWARD: STEP_DEPTH}
    commands: list[Sequence[Command]] = [walk(4), walk(4), [climb] * 4, [{HEIGHT: 0.55}] * 3]
    return {name: (builder.scene(), call) for (name, builder), call in zip(builders.items(), commands, strict=True)}


def _apart(fixture: Fixture, scene: Scene, commands: Sequence[Command]) -> float:
    """Largest distance between the ends of any two rates."""
    profiles = [replace(fixture.profile, substeps=substeps) for substeps in (2, 4, 8)]
    ends = [fixture.perform(scene, commands, profile).simulated.root[-1] for profile in profiles]
    return float(max(np.linalg.norm(a - b) for a in ends for b in ends))


CHECKS: Final[Mapping[str, Callable[[Fixture], Iterator[Finding]]]] = {
    "free-space": free_space, "walls": walls, "ledge": ledge, "stairs": stairs, "boxes": boxes, "chair": chair,
    "door": door, "hinges": hinges, "slides": slides, "lids": lids, "seats": seats, "rates": rates, "wild": wild,
}  # fmt: skip


def table(findings: Sequence[Finding]) -> str:
    """Write the findings as a Markdown table."""
    lines = ["| check | measure | found | bound | holds |", "| --- | --- | --- | --- | --- |"]
    for f in findings:
        bounds = [f"{sign} {bound:g}" for sign, bound in (("≥", f.low), ("≤", f.high)) if np.isfinite(bound)]
        value = f"{f.value:.3g} {f.unit}".strip()
        lines.append(f"| {f.check} | {f.measure} | {value} | {', '.join(bounds)} | {'yes' if f.holds else '**no**'} |")
    return "\n".join(lines)
