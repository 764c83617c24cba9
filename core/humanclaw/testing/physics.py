"""Physics checks: what half-physics has to keep to, measured on any simulator. `humanclaw physics` prints them.

Each check is a function of a Fixture that yields Findings: what was measured, and within what bounds it has to lie.
They are measured with the motion that skills generate, and, where that would prove little, with commands that no skill
would ever give.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from humanclaw.body.pose import (
    FPS,
    FUTURE,
    HISTORY,
    Array,
    Motion,
    matrix_from_quaternion,
    matrix_from_vector,
    re_rooted,
    rest_pose,
    vector_from_quaternion,
)
from humanclaw.episodes.backends import default_simulator
from humanclaw.episodes.embodiment import stand
from humanclaw.errors import HumanclawError
from humanclaw.motion.generator import MotionGenerator
from humanclaw.plugins.host import Plugins
from humanclaw.skills.contract import Skill
from humanclaw.skills.measures import from_si
from humanclaw.skills.plan import Control
from humanclaw.testing.scenes import SceneBuilder, block
from humanclaw.world.half_physics.exertion import GROUND_FRICTION
from humanclaw.world.half_physics.profile import Profile, find_profile
from humanclaw.world.scene import Scene
from humanclaw.world.simulator import Execution, Simulator

Command = Mapping[str, float]
"""What a chunk is to do: measure to its value, metres or radians."""
Tick = Callable[[], object]
FORWARD, TURN, RISE, DROP, HEIGHT = "hips.forward", "heading.left", "hips.rise", "hips.drop", "hips.height"
GRAVITY: Final = 9.81
STEP_DEPTH: Final = 0.28
"""Depth of the stairs' treads, metres."""
RISES: Final = (0.10, 0.13, 0.16, 0.19, 0.22)
STEPS: Final = 6
SEATS: Final = (0.36, 0.42, 0.46, 0.50, 0.55, 0.60, 0.65)
"""Heights of seats, metres; the knees are at 0.49."""
MASSES: Final = {
    1.0: (0.3, np.inf),
    10.0: (0.3, np.inf),
    30.0: (0.3, 2.2),
    60.0: (0.3, 2.0),
    100.0: (0.1, 1.6),
    300.0: (-0.01, 0.02),
    1000.0: (-0.01, 0.01),
}
"""Kilograms of a box, to how far two seconds of walking (2 m) must and may push it, metres."""
STRENGTH: Final = 600.0
"""What a person pushes with at most, newtons."""


@dataclass(frozen=True)
class Finding:
    """A measured number and the bounds that the check sets it."""

    check: str
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
    def simulated(self) -> Motion:
        parts = [execution.simulated for execution in self.executions]
        return Motion(np.concatenate([p.root for p in parts]), np.concatenate([p.rotations for p in parts]))

    def achieved(self) -> Array:
        """Return (3,) displacement of the root, as a share of the displacement that was commanded chunk by chunk."""
        ends = np.stack([self.start, *(execution.simulated.root[-1] for execution in self.executions)])
        asked = np.stack([motion.root[-1] for motion in self.commanded]) - ends[:-1]
        return np.asarray((ends[-1] - ends[0]) / asked.sum(axis=0))

    def path(self, object_id: int, begin: Array, above: float = 0.0) -> Array:
        """Return (frames + 1, 3) where the point that high above the base of an upright movable object was, from where
        it began."""
        places = self.places(object_id, np.array([*begin, 0.0, 0.0, 0.0, 1.0]))
        return np.asarray(places[:, :3] + above * _upward(places[:, 3:]))

    def places(self, object_id: int, begin: Array) -> Array:
        """Return (frames + 1, 7) where a movable object was, from where it began."""
        rows = [begin[None]]
        for execution in self.executions:
            still = np.repeat(rows[-1][-1:], len(execution.simulated), axis=0)
            rows.append(execution.objects.get(object_id, still))
        return np.concatenate(rows)

    def depths(self, object_id: int) -> Array:
        """Measure how deep links were in an object, metres, in every frame in which they touched it."""
        return np.array([c.depth for e in self.executions for c in e.contacts if c.object_id == object_id])


@dataclass
class Fixture:
    """Where checks are measured. samples: of random walls; chunks: of random commands."""

    make: Callable[[Profile], Simulator]
    """The simulator under test, as a plugin's factory makes it."""
    profile: Profile
    samples: int = 200
    chunks: int = 10_000
    seed: int = 0
    plugins: Plugins = field(default_factory=Plugins.discover)

    def __post_init__(self) -> None:
        self._generator: MotionGenerator = self.plugins.make("motion_generators", "dit")

    @classmethod
    def of(cls, simulator: str, profile: str = "default", **numbers: int) -> Fixture:
        """Return a fixture of an installed simulator.

        Empty: the default one. Raises HumanclawError for unknown names.
        """
        plugins = Plugins.discover()
        simulator = simulator or default_simulator(plugins)
        return cls(
            lambda chosen: plugins.make("simulators", simulator, profile=chosen),
            find_profile(profile), plugins=plugins, **numbers,
        )  # fmt: skip

    def simulator(self) -> Simulator:
        """Return a simulator of the fixture's profile."""
        return self.make(self.profile)

    def stand(self, simulator: Simulator, scene: Scene) -> Motion:
        """Put the body on a scene's start; returns the history of its first motion, (5,) frames."""
        return stand(simulator, self._generator, scene, scene.start)

    def generate(self, history: Motion, command: Command, number: int) -> Motion:
        """15 frames of the skill that commands these measures."""
        skill, keys = skill_with(self.plugins, *command)
        plan = skill.plan(skill.check({keys[measure]: _written(keys[measure], x) for measure, x in command.items()}))
        if not isinstance(plan, Control):
            raise HumanclawError(f"the checks are measured with motion that is generated, and {skill.name} is not.")
        return self._generator.generate(history, plan.adapter, plan.values, (self.seed, number))

    def perform(self, scene: Scene, commands: Sequence[Command], profile: Profile | None = None) -> Played:
        """Let a body that stands on the scene's start carry out some commands."""
        simulator = self.make(profile or self.profile)
        history = self.stand(simulator, scene)
        start, commanded, executions = history.root[-1], [], []
        for number, command in enumerate(commands):
            motion = self.generate(history, command, number)
            execution = simulator.execute(motion)
            history = re_rooted(history.then(motion)[-HISTORY:], execution.simulated)
            commanded.append(motion)
            executions.append(execution)
        objects = dict(simulator.state().objects)
        simulator.close()
        return Played(start, tuple(commanded), tuple(executions), objects)

    def imagine(self, commands: Sequence[Command]) -> Motion:
        """Return the same commands as pure kinematics: generated motion played back, and no world."""
        motion = self._generator.start()
        for number, command in enumerate(commands):
            motion = motion.then(self.generate(motion[-HISTORY:], command, number))
        return motion


def skill_with(plugins: Plugins, *measures: str) -> tuple[Skill, Mapping[str, str]]:
    """Return the installed skill whose parameters command these measures, the fewest others beside them; and measure to
    parameter.

    Raises HumanclawError if there is none.
    """
    found = {name: _commands(skill) for name, skill in sorted(plugins.skills.items())}
    able = [name for name, keys in found.items() if set(measures) <= set(keys)]
    if not able:
        raise HumanclawError(
            f"no installed skill commands {' and '.join(measures)}.", "Install the skills of HumanCLAW."
        )
    name = min(able, key=lambda name: len(found[name]))
    return plugins.skill(name), found[name]


def _commands(skill: Skill) -> Mapping[str, str]:
    """Measure to the parameter that commands it."""
    return {one.measure: one.key for one in skill.parameters if one.measure}


def _written(key: str, value: float) -> int:
    """Metres or radians in the unit of a parameter, which is an integer."""
    return round(from_si(key, value))


def walk(count: int, metres: float = 0.5, turn: float = 0.0) -> Sequence[Command]:
    """So many half seconds of walking, each so far, turning so many radians."""
    return [{FORWARD: metres, TURN: turn}] * count


# -- the checks --------------------------------------------------------------------------------------------------------
def free_space(fixture: Fixture, tick: Tick) -> Iterator[Finding]:
    """Check a walk commanded to a body that falls and touches nothing.

    Heights, which are not commanded, are taken from the root.
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
    tick()


def walls(fixture: Fixture, tick: Tick) -> Iterator[Finding]:
    """Two seconds of walking at walls of any distance, angle and thickness."""
    rng = np.random.default_rng([fixture.seed, 1])
    depths, beyond, imagined = [np.zeros(1)], 0, 0
    for _ in range(fixture.samples):
        distance, angle, thickness = rng.uniform(0.6, 1.0), rng.uniform(-0.6, 0.6), rng.uniform(0.08, 0.2)
        normal = np.array([np.sin(angle), 0.0, np.cos(angle)])
        builder = SceneBuilder()
        builder.floor()
        place = tuple((normal * thickness / 2 + [0.0, 0.0, distance]).tolist())
        wall = builder.box("wall", (6, 2.5, thickness), place, rotation=(0, np.sin(angle / 2), 0, np.cos(angle / 2)))
        commands = walk(4, float(rng.integers(50, 81)) / 100)
        played = fixture.perform(builder.scene(), commands)
        depths.append(played.depths(wall))
        beyond += bool(((played.simulated.root - [0, 0, distance]) @ normal).max() > 0)
        imagined += bool((fixture.imagine(commands).root[-1] - [0, 0, distance]) @ normal > thickness)
        tick()
    depth = 100 * np.concatenate(depths)
    share = 100 / fixture.samples
    yield Finding("a wall blocks", f"deepest contact of {fixture.samples} walls", float(depth.max()), "cm", high=1.0)
    yield Finding("a wall blocks", "bodies behind the wall", share * beyond, "%", high=0)
    yield Finding("a wall blocks", "pure kinematics behind it", share * imagined, "%", low=100)


def ledge(fixture: Fixture, tick: Tick) -> Iterator[Finding]:
    """Check a step over the edge of a platform, and the fall while nothing is touched."""
    builder = SceneBuilder()
    builder.box("floor", (2, 12, 1.6), (0, -12, 0))
    played = fixture.perform(builder.scene(), walk(5, 0.8))
    touching = [k * FUTURE + contact.frames[0] for k, e in enumerate(played.executions) for contact in e.contacts]
    begun = max(touching) + 2
    fall = np.diff(played.simulated.root[begun : begun + FUTURE, 1], 2).mean() * FPS**2
    yield Finding("a step into the air falls", "acceleration", -float(fall), "m/s2", 0.98 * GRAVITY, 1.02 * GRAVITY)
    tick()


def stairs(fixture: Fixture, tick: Tick) -> Iterator[Finding]:
    """Check a flight of six, up and down, begun one tread before the first riser, and half a foot before the first
    edge."""
    for change, check in ((RISE, "stairs carry up"), (DROP, "stairs carry down")):
        heights, advances = [], []
        for rise in RISES:
            builder, up = SceneBuilder(), change == RISE
            builder.floor()
            (builder.steps if up else builder.descent)(STEPS, rise, STEP_DEPTH, STEP_DEPTH + 0.12 if up else 0.16)
            played = fixture.perform(
                builder.scene(0.0 if up else STEPS * rise), [{change: rise, FORWARD: STEP_DEPTH}] * (STEPS + 1)
            )
            heights.append(abs(played.simulated.root[-1, 1] - played.start[1]) / (STEPS * rise))
            advances.append(played.achieved()[2])
            tick()
        worst = int(np.argmax(np.abs(np.array(advances) - 1)))
        what = f"{100 * min(RISES):.0f} to {100 * max(RISES):.0f} cm"
        yield Finding(check, f"least height of the flight reached, {what}", 100 * min(heights), "%", 95, 105)
        yield Finding(check, "forward travel, worst simulated/commanded", 100 * advances[worst], "%", 95, 105)


@dataclass(frozen=True)
class Pushed:
    """What became of a box that somebody walked against."""

    way: float
    """Metres along +Z."""
    speed: float
    """The highest, m/s."""
    force: float
    """The highest that its frames tell of, friction included, newtons."""
    work: float
    """Joules, friction included."""


def _upward(quaternions: Array) -> Array:
    """(N, 4) x, y, z, w to (N, 3) where the vertical of each points."""
    x, y, z, w = quaternions.T
    return np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], -1)


def push(fixture: Fixture, mass: float, count: int = 4, profile: Profile | None = None) -> Pushed:
    """So many half seconds of walking against a box of 40 cm."""
    builder = SceneBuilder()
    builder.floor()
    box = builder.box("box", (0.4, 0.4, 0.4), (0, 0, 0.6), movable=True, mass=mass)
    played = fixture.perform(builder.scene(), walk(count), profile)
    # Of the centre of mass: a box that tips has a base that is faster, and nobody pushed that.
    path = played.path(box, np.array([0, 0, 0.6]), above=0.2)
    steps = np.linalg.norm(np.diff(path[:, [0, 2]], axis=0), axis=1)
    speed, friction = steps * FPS, GROUND_FRICTION**2 * mass * GRAVITY
    gains = np.diff(speed, prepend=0.0)
    force = np.where(gains > 0.01, mass * gains * FPS + friction * (speed > 0.1), 0.0)
    energy = 0.5 * mass * np.maximum(np.diff(speed**2, prepend=0.0), 0.0).sum() + friction * steps.sum()
    return Pushed(float(path[-1, 2] - 0.6), float(speed.max()), float(force.max()), float(energy))


def boxes(fixture: Fixture, tick: Tick) -> Iterator[Finding]:
    """Check a box of 40 cm in the way of two seconds of walking, from light to immovable."""
    pushes = {}
    for mass, (low, high) in MASSES.items():
        pushes[mass] = push(fixture, mass)
        yield Finding("mass counts", f"way of {mass:g} kg", pushes[mass].way, "m", low, high)
        tick()
    heavy = [pushed for mass, pushed in pushes.items() if mass >= 30]
    yield Finding("mass counts", "largest push, 30 kg and more", max(p.force for p in heavy), "N", high=STRENGTH)
    fastest = max(pushed.speed for mass, pushed in pushes.items() if mass >= 60)
    yield Finding("mass counts", "fastest, 60 kg and more", fastest, "m/s", high=1.5)
    spare = min(STRENGTH * max(p.way, 0.01) - p.work for p in pushes.values())
    yield Finding("mass counts", f"work left of {STRENGTH:g} N over the way, least", spare, "J", low=0.0)
    yield from squeezed(fixture, tick)


def squeezed(fixture: Fixture, tick: Tick) -> Iterator[Finding]:
    """Check a box of 5 kg between the body and one of a tonne, walked against for four seconds."""
    builder = SceneBuilder()
    builder.floor()
    light = builder.box("box", (0.4, 0.4, 0.4), (0, 0, 0.7), movable=True, mass=5)
    heavy = builder.box("box", (0.6, 0.6, 0.6), (0, 0, 1.25), movable=True, mass=1000)
    played = fixture.perform(builder.scene(), walk(8, 0.8))
    way = np.linalg.norm(played.path(heavy, np.array([0, 0, 1.25]))[-1] - [0, 0, 1.25])
    rise = 100 * played.path(light, np.array([0, 0, 0.7]), above=0.2)[:, 1].max() - 20
    yield Finding("mass counts", "way of 1000 kg behind 5 kg", float(way), "m", high=0.05)
    yield Finding("mass counts", "highest rise of the 5 kg", float(rise), "cm", high=20.0)
    tick()


def chair(fixture: Fixture, tick: Tick) -> Iterator[Finding]:
    """Check a chair of 5 kg between the body and a wall, pushed for two seconds."""
    builder = SceneBuilder()
    builder.floor()
    legs = [block((x, 0, z), (x + 0.04, 0.44, z + 0.04)) for x in (-0.22, 0.18) for z in (-0.22, 0.18)]
    hulls = [block((-0.22, 0.44, -0.22), (0.22, 0.48, 0.22)), block((-0.22, 0.48, 0.18), (0.22, 0.95, 0.22)), *legs]
    pushed = builder.solid("chair", hulls, (0, 0, 0.75), movable=True, mass=5.0)
    builder.box("wall", (6, 2.5, 0.2), (0, 0, 1.2))
    path = fixture.perform(builder.scene(), walk(4)).path(pushed, np.array([0, 0, 0.75]))
    speed = np.linalg.norm(np.diff(path, axis=0), axis=1).max() * FPS
    yield Finding("a chair against a wall stays down", "highest rise", 100 * float(path[:, 1].max()), "cm", high=10.0)
    yield Finding("a chair against a wall stays down", "fastest", float(speed), "m/s", high=3.0)
    yield Finding("a chair against a wall stays down", "furthest", float(path[:, 2].max()), "m", high=0.9)
    tick()


def door(fixture: Fixture, tick: Tick) -> Iterator[Finding]:
    """Check a gap of 60 cm between two walls; the body with its arms hanging is 75 cm wide."""
    offsets, through, depths = (-0.04, -0.02, 0.0, 0.02, 0.04), 0, [np.zeros(1)]
    for offset in offsets:
        builder = SceneBuilder()
        builder.floor()
        sides = [builder.box("wall", (2, 2.5, 0.1), (offset + x, 0, 0.8)) for x in (-1.3, 1.3)]
        played = fixture.perform(builder.scene(), walk(5))
        through += bool(played.simulated.root[-1, 2] > 1.1)
        depths += [played.depths(side) for side in sides]
        tick()
    yield Finding("a 60 cm door is squeezed through", "bodies through it", 100 * through / len(offsets), "%", low=100)
    depth = 100 * float(np.concatenate(depths).max())
    yield Finding("a 60 cm door is squeezed through", "deepest contact", depth, "cm", high=1.0)


@dataclass(frozen=True)
class Turned:
    """What became of a door that somebody walked against."""

    through: bool
    """Whether the hips got beyond the wall."""
    angles: Array
    """(frames + 1,) degrees from shut, open positive."""
    hinge: float
    """How far the hinge moved, metres."""
    torque: float
    """The largest that made it faster, hinge's friction included, newton metres."""
    depth: float
    """The deepest that a link was in it, metres."""


def swing(fixture: Fixture, count: int = 5, mass: float = 25.0, away: bool = True, **place: float) -> Turned:
    """So many half seconds of walking against a door."""
    builder = SceneBuilder()
    builder.floor()
    door = builder.door(mass=mass, away=away, **place)
    scene = builder.scene()
    played, leaf = fixture.perform(scene, walk(count)), scene.by_id[door]
    assert leaf.joint is not None
    rows = played.places(door, np.array([*leaf.position, *leaf.rotation]))
    hinge = rows[:, :3] + matrix_from_quaternion(rows[:, 3:]) @ np.array(leaf.joint.point)
    angles = (-1 if away else 1) * np.degrees(vector_from_quaternion(rows[:, 3:])[:, 1])
    faster = np.diff(np.abs(np.diff(np.radians(angles), prepend=np.radians(angles[0])) * FPS)).max() * FPS
    inertia = mass * (0.88**2 / 12 + 0.45**2)
    return Turned(
        bool(played.simulated.root[-1, 2] > 1.1), angles, float(np.linalg.norm(hinge - hinge[0], axis=1).max()),
        float(inertia * faster + leaf.joint.friction), float(played.depths(door).max(initial=0.0)),
    )  # fmt: skip


def hinges(fixture: Fixture, tick: Tick) -> Iterator[Finding]:
    """Check a door of 25 kg, shut or ajar, that opens away from the body, one that would have to be pulled, and one of
    a tonne."""
    opened, held = [], []
    for place in ({"x": -0.1}, {"x": 0.1}, {"angle": np.radians(30)}, {"angle": np.radians(60)}):
        opened.append(swing(fixture, **place))
        tick()
    for place in ({}, {"angle": np.radians(30)}):
        held.append(swing(fixture, away=False, **place))
        tick()
    check, doors = "a door is pushed open", [*opened, *held]
    beyond = max(max(door.angles.max() - 95, -door.angles.min()) for door in doors)
    yield Finding(check, "bodies through it", 100 * sum(d.through for d in opened) / len(opened), "%", low=100)
    yield Finding(check, "least angle reached", float(min(d.angles.max() for d in opened)), "degrees", 60, 96)
    yield Finding(check, "largest torque", max(d.torque for d in doors), "N m", 20, STRENGTH * 0.9)
    yield Finding(check, "furthest beyond its range", float(beyond), "degrees", high=1.0)
    yield Finding(check, "way of the hinge", 100 * max(d.hinge for d in doors), "cm", high=1.0)
    yield Finding(check, "deepest contact", 100 * max(d.depth for d in doors), "cm", high=1.0)
    check = "a door that opens towards the body blocks"
    yield Finding(check, "bodies through it", 100 * sum(d.through for d in held) / len(held), "%", high=0)
    yield Finding(check, "angle at the end", float(max(d.angles[-1] for d in held)), "degrees", high=1.0)
    heavy = swing(fixture, mass=1000.0)
    tick()
    yield Finding("mass counts", "angle of a door of 1,000 kg", float(heavy.angles[-1]), "degrees", 5, 60)


def seats(fixture: Fixture, tick: Tick) -> Iterator[Finding]:
    """Benches from 36 to 65 cm, lower and higher than the knees, half a metre behind the body."""
    touched, gaps = 0, []
    for seat in SEATS:
        builder = SceneBuilder()
        builder.floor()
        bench = builder.box("couch", (1.6, seat, 0.8), (0, 0, -0.53))
        played = fixture.perform(builder.scene(), [{HEIGHT: seat + 0.13}] * 3)
        last = played.executions[-1]
        touched += any(c.joint == "pelvis" and c.object_id == bench and FUTURE - 1 in c.frames for c in last.contacts)
        gaps.append(last.simulated.root[-1, 1] - seat - 0.14)
        tick()
    share = 100 * touched / len(SEATS)
    yield Finding(
        "sitting touches the seat", f"pelvis on seats of {SEATS[0]:g} to {SEATS[-1]:g} m", share, "%", low=100
    )
    yield Finding("sitting touches the seat", "highest pelvis over its seat", 100 * float(max(gaps)), "cm", high=1.0)


def wild(fixture: Fixture, tick: Tick) -> Iterator[Finding]:
    """Random poses, held, jittering or upright, far beyond what any skill commands, in a small furnished room."""
    rng, worst = np.random.default_rng([fixture.seed, 2]), _Worst()
    simulator = fixture.simulator()
    for number in range(fixture.chunks):
        if number % 250 == 0:
            state = simulator.reset(_furnished(), _furnished().start)
        before = state.body.root
        execution = simulator.execute(_wild(rng, number, before))
        state = simulator.state()
        worst.add(execution, before, upright=number % 3 == 2)
        tick()
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


def rates(fixture: Fixture, tick: Tick) -> Iterator[Finding]:
    """Check the same commands at 60, 120 and 240 Hz: on a floor, at a wall, up the stairs and onto a seat."""
    apart = {name: _apart(fixture, scene, commands, tick) for name, (scene, commands) in _rate_scenes().items()}
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


def _apart(fixture: Fixture, scene: Scene, commands: Sequence[Command], tick: Tick) -> float:
    """Largest distance between the ends of any two rates."""
    ends = []
    for substeps in (2, 4, 8):
        ends.append(fixture.perform(scene, commands, replace(fixture.profile, substeps=substeps)).simulated.root[-1])
        tick()
    return float(max(np.linalg.norm(a - b) for a in ends for b in ends))


CHECKS: Final[Mapping[str, Callable[[Fixture, Tick], Iterator[Finding]]]] = {
    "free-space": free_space, "walls": walls, "ledge": ledge, "stairs": stairs, "boxes": boxes, "chair": chair,
    "door": door, "hinges": hinges, "seats": seats, "rates": rates, "wild": wild,
}  # fmt: skip


def ticks(fixture: Fixture, names: Sequence[str]) -> int:
    """Measure how often the checks of these names will tick."""
    each: Mapping[str, int] = {
        "free-space": 1, "walls": fixture.samples, "ledge": 1, "stairs": 2 * len(RISES), "boxes": len(MASSES) + 1,
        "chair": 1, "door": 5, "hinges": 7, "seats": len(SEATS), "rates": 12, "wild": fixture.chunks,
    }  # fmt: skip
    return sum(each[name] for name in names)


def table(findings: Sequence[Finding]) -> str:
    """Write the findings as a Markdown table."""
    lines = ["| check | measure | found | bound | holds |", "| --- | --- | --- | --- | --- |"]
    for f in findings:
        bounds = [f"{sign} {bound:g}" for sign, bound in (("≥", f.low), ("≤", f.high)) if np.isfinite(bound)]
        found = f"{f.value:.3g} {f.unit}".strip()
        lines.append(f"| {f.check} | {f.measure} | {found} | {', '.join(bounds)} | {'yes' if f.holds else '**no**'} |")
    return "\n".join(lines)
