"""Laws of half-physics about objects that a body pushes, opens and squeezes through."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from humanclaw.body.pose import FPS, Array, matrix_from_quaternion, vector_from_quaternion
from humanclaw.laws.fixture import Finding, Fixture, walk
from humanclaw.world.half_physics.push_force_limit import GROUND_FRICTION
from humanclaw.world.joints import GRAVITY, Hinge, Slide
from humanclaw.world.scene_builder import SceneBuilder, block

MASSES: Final = {
    1.0: (0.3, np.inf),
    10.0: (0.3, np.inf),
    30.0: (0.3, 2.2),
    60.0: (0.3, 2.0),
    100.0: (0.1, 1.6),
    300.0: (-0.01, 0.02),
    1000.0: (-0.01, 0.01),
}
"""By mass of a box, kg: how far two seconds of walking (2 m) must and may push it, metres."""
STRENGTH: Final = 600.0
"""Maximum push of a person, newtons."""


@dataclass(frozen=True)
class Pushed:
    """A box after a body walked against it."""

    way: float
    """Displacement along +Z, metres."""
    speed: float
    """Highest speed, m/s."""
    force: float
    """Highest force that its frames imply, friction included, newtons."""
    work: float
    """Work, friction included, joules."""


def push(fixture: Fixture, mass: float) -> Pushed:
    """Walk two seconds against a box of 40 cm."""
    builder = SceneBuilder.on_floor()
    box = builder.box("box", (0.4, 0.4, 0.4), (0, 0, 0.6), movable=True, mass=mass)
    played = fixture.perform(builder.scene(), walk(4))
    # Measured at the centre of mass: the base of a tipping box moves faster without being pushed.
    path = played.path_above(box, 0.2)
    steps = np.linalg.norm(np.diff(path[:, [0, 2]], axis=0), axis=1)
    speed, friction = steps * FPS, GROUND_FRICTION**2 * mass * GRAVITY
    gains = np.diff(speed, prepend=0.0)
    force = np.where(gains > 0.01, mass * gains * FPS + friction * (speed > 0.1), 0.0)
    energy = 0.5 * mass * np.maximum(np.diff(speed**2, prepend=0.0), 0.0).sum() + friction * steps.sum()
    return Pushed(float(path[-1, 2] - 0.6), float(speed.max()), float(force.max()), float(energy))


def boxes(fixture: Fixture) -> Iterator[Finding]:
    """Check a box of 40 cm in the way of two seconds of walking, from light to immovable."""
    pushes = {}
    for mass, (low, high) in MASSES.items():
        pushes[mass] = push(fixture, mass)
        yield Finding("mass counts", f"way of {mass:g} kg", pushes[mass].way, "m", low, high)
    heavy = [pushed for mass, pushed in pushes.items() if mass >= 30]
    yield Finding("mass counts", "largest push, 30 kg and more", max(p.force for p in heavy), "N", high=STRENGTH)
    fastest = max(pushed.speed for mass, pushed in pushes.items() if mass >= 60)
    yield Finding("mass counts", "fastest, 60 kg and more", fastest, "m/s", high=1.5)
    yield Finding("mass counts", "fastest of all", max(pushed.speed for pushed in pushes.values()), "m/s", high=5.5)
    spare = min(STRENGTH * max(p.way, 0.01) - p.work for p in pushes.values())
    yield Finding("mass counts", f"work left of {STRENGTH:g} N over the way, least", spare, "J", low=0.0)
    yield from burdened(fixture)


LOADS: Final = (
    (4.0, 0.4, 1000.0, (0.0, 0.0, 1.21)),
    (4.0, 0.4, 1000.0, (0.0, 0.0, 1.25)),
    (4.0, 0.4, 1000.0, (0.0, 0.4, 0.7)),
    (4.0, 0.4, 300.0, (0.0, 0.4, 0.7)),
    (4.0, 0.4, 1000.0, (0.15, 0.4, 0.7)),
    (2.0, 0.2, 1000.0, (0.0, 0.2, 0.7)),
    (2.0, 0.04, 1000.0, (0.0, 0.04, 0.7)),
)
"""Mass and height of a box, kg and metres, and mass and place of what stands behind it or on it."""


def burdened(fixture: Fixture) -> Iterator[Finding]:
    """Check a box or board that a tonne stands behind, 1 and 5 cm away, or on, or 300 kg; walked against for four
    seconds."""
    ways, slips, rises = [], [], []
    for mass, height, load, place in fixture.some(LOADS):
        builder = SceneBuilder.on_floor()
        light = builder.box("box", (0.4, height, 0.4), (0, 0, 0.7), movable=True, mass=mass)
        heavy = builder.box("box", (0.6, 0.6, 0.6), place, movable=True, mass=load)
        played = fixture.perform(builder.scene(), walk(8, 0.8))
        ways.append(np.linalg.norm(played.paths[heavy][-1, :3] - place))
        path = played.path_above(light, height / 2)
        rises.append(path[:, 1].max() - height / 2)
        slips.append(np.linalg.norm(path[-1, [0, 2]] - [0, 0.7]) if place[1] else 0.0)
    yield Finding("mass counts", "way of 300 or 1000 kg behind or on 2 or 4 kg", float(max(ways)), "m", high=0.02)
    yield Finding("mass counts", "way of 2 or 4 kg under 300 or 1000 kg", float(max(slips)), "m", high=0.02)
    yield Finding("mass counts", "highest rise of the 2 or 4 kg", 100 * float(max(rises)), "cm", high=5.0)


CHAIRS: Final = ((5.0, 0.0, 0.5), (5.0, np.pi, 0.5), *((3.0, k * np.pi / 4, 0.8) for k in range(8)))
"""Mass of a chair before a wall, kg, its turn (at 0 its back is at the wall, at pi at the body), and the half second's
way of the body, metres."""


def chair(fixture: Fixture) -> Iterator[Finding]:
    """Check a chair between the body and a wall, pushed for four seconds. It may tip over, as a light one does for a
    person; it may not leave the floor."""
    legs = [block((x, 0, z), (x + 0.04, 0.44, z + 0.04)) for x in (-0.22, 0.18) for z in (-0.22, 0.18)]
    hulls = [block((-0.22, 0.44, -0.22), (0.22, 0.48, 0.22)), block((-0.22, 0.48, 0.18), (0.22, 0.95, 0.22)), *legs]
    paths, lows = [], []
    for mass, turn, pace in fixture.some(CHAIRS):
        builder = SceneBuilder.on_floor()
        facing = (0.0, float(np.sin(turn / 2)), 0.0, float(np.cos(turn / 2)))
        pushed = builder.solid("chair", hulls, (0, 0, 0.75), movable=True, mass=mass, rotation=facing)
        builder.box("wall", (6, 2.5, 0.2), (0, 0, 1.2))
        places = fixture.perform(builder.scene(), walk(8, pace)).paths[pushed]
        paths.append(places[:, :3])
        turned = matrix_from_quaternion(places[:, 3:]) @ np.concatenate(hulls).T
        lows.append((places[:, 1] + turned[:, 1].min(axis=-1)).max())
    path, check = np.stack(paths), "a chair against a wall stays on the floor"
    speed = np.linalg.norm(np.diff(path, axis=1), axis=2).max() * FPS
    yield Finding(check, f"highest lowest point of {len(lows)}", 100 * float(max(lows)), "cm", high=5.0)
    yield Finding(check, "fastest", float(speed), "m/s", high=3.0)
    yield Finding(check, "furthest", float(path[..., 2].max()), "m", high=0.9)


GAPS: Final = (*((0.6, offset) for offset in (-0.04, -0.02, 0.0, 0.02, 0.04)), (0.4, 0.0), (0.45, 0.0))
"""Widths of gaps between two walls, and how far they are beside the way, metres."""


def door(fixture: Fixture) -> Iterator[Finding]:
    """Check gaps between two walls. The body is 75 cm wide with its arms hanging, and 38 cm without."""
    through, depths = list[bool](), [np.zeros(1)]
    for gap, offset in GAPS:
        builder = SceneBuilder.on_floor()
        sides = [builder.box("wall", (2, 2.5, 0.1), (offset + x * (1 + gap / 2), 0, 0.8)) for x in (-1, 1)]
        played = fixture.perform(builder.scene(), walk(5))
        through.append(bool(played.simulated.root[-1, 2] > 1.1))
        depths += [played.depths(side) for side in sides]
    check = "a narrow gap is squeezed through"
    yield Finding(check, "bodies through 60 cm", 100 * sum(through[:-2]) / len(through[:-2]), "%", low=100)
    yield Finding(check, "bodies through 40 cm", 100 * through[-2], "%", high=0)
    yield Finding(check, "bodies through 45 cm", 100 * through[-1], "%", low=100)
    yield Finding(check, "deepest contact", 100 * float(np.concatenate(depths).max()), "cm", high=1.0)


def slides(fixture: Fixture) -> Iterator[Finding]:
    """Check drawers of 4 and 40 kg that stand 40 cm open towards the body, walked against for two seconds."""
    hulls = [block((-0.3, 0.0, -0.25), (0.3, 0.02, 0.25)), block((-0.3, 0.0, 0.23), (0.3, 0.25, 0.25))]
    left, off, beyond, depth = [], [], [], []
    for mass in (4.0, 40.0):
        builder = SceneBuilder.on_floor()
        drawer = builder.solid(
            "drawer", hulls, (0, 0.6, 0.85), rotation=(0.0, 1.0, 0.0, 0.0), movable=True, mass=mass,
            joint=Slide(0.0, 0.4), state=0.4,
        )  # fmt: skip
        played = fixture.perform(builder.scene(), walk(4))
        path = played.paths[drawer][:, :3]
        left.append(1.25 - path[-1, 2])
        off.append(np.abs(path[:, :2] - [0, 0.6]).max())
        beyond.append(max(path[:, 2].max() - 1.25, 0.85 - path[:, 2].min()))
        depth.append(played.depths(drawer).max(initial=0.0))
    check = "a drawer is pushed shut"
    yield Finding(check, "way left to its end, most", 100 * float(max(left)), "cm", high=1.0)
    yield Finding(check, "off its line; beyond its range", 100 * float(max(*off, *beyond)), "cm", high=1.0)
    yield Finding(check, "deepest contact", 100 * float(max(depth)), "cm", high=1.0)


def lids(fixture: Fixture) -> Iterator[Finding]:
    """Check the lid of an oven, 5 kg on a hinge at its lower edge that stands 34.4 degrees open and holds 0.5 and
    20 N m; gravity turns it with 6.9 N m."""
    angles = []
    for friction in (0.5, 20.0):
        builder = SceneBuilder.on_floor()
        hinge = Hinge((0.0, 0.0, 0.0), 0.0, np.pi / 2, friction, 1.0, axis=(1.0, 0.0, 0.0))
        leaning = (float(np.sin(0.3)), 0.0, 0.0, float(np.cos(0.3)))
        lid = builder.box(
            "oven", (0.5, 0.5, 0.03), (2, 0.3, 0), rotation=leaning, movable=True, mass=5.0, joint=hinge, state=0.6
        )
        played = fixture.perform(builder.scene(), walk(2, 0.5))
        angles.append(float(np.degrees(vector_from_quaternion(played.paths[lid][-1, 3:])[0])))
    yield Finding("a lid falls open", "angle where its hinge is loose", angles[0], "degrees", 89, 91)
    yield Finding("a lid falls open", "angle where its hinge holds it", angles[1], "degrees", 34, 35)


@dataclass(frozen=True)
class Turned:
    """A door after a body walked against it."""

    through: bool
    """Whether the hips passed the wall."""
    angles: Array
    """(frames + 1,) opening angle, degrees."""
    hinge: float
    """Displacement of the hinge, metres."""
    torque: float
    """Largest accelerating torque, the hinge's friction included, newton metres."""
    depth: float
    """Deepest penetration by a link, metres."""


def swing(fixture: Fixture, count: int = 5, mass: float = 25.0, away: bool = True, **place: float) -> Turned:
    """Walk `count` half seconds against a door."""
    builder = SceneBuilder.on_floor()
    door = builder.door(mass=mass, away=away, **place)
    scene = builder.scene()
    played, leaf = fixture.perform(scene, walk(count)), scene.by_id[door]
    assert isinstance(leaf.joint, Hinge)
    rows = played.paths[door]
    hinge = rows[:, :3] + matrix_from_quaternion(rows[:, 3:]) @ np.array(leaf.joint.point)
    angles = (-1 if away else 1) * np.degrees(vector_from_quaternion(rows[:, 3:])[:, 1])
    faster = np.diff(np.abs(np.diff(np.radians(angles), prepend=np.radians(angles[0])) * FPS)).max() * FPS
    inertia = mass * (0.88**2 / 12 + 0.45**2)
    return Turned(
        bool(played.simulated.root[-1, 2] > 1.1), angles, float(np.linalg.norm(hinge - hinge[0], axis=1).max()),
        float(inertia * faster + leaf.joint.friction), float(played.depths(door).max(initial=0.0)),
    )  # fmt: skip


def hinges(fixture: Fixture) -> Iterator[Finding]:
    """Check a door of 25 kg that opens away from the body (shut and ajar), one that would have to be pulled, and one of
    1,000 kg."""
    places = {"x": -0.1}, {"x": 0.1}, {"angle": np.radians(30)}, {"angle": np.radians(60)}
    opened = [swing(fixture, **place) for place in places]
    held = [swing(fixture, away=False, angle=angle) for angle in (0.0, np.radians(30))]
    check, doors = "a door is pushed open", [*opened, *held]
    beyond = max(max(door.angles.max() - 95, -door.angles.min()) for door in doors)
    yield Finding(check, "bodies through it", 100 * sum(d.through for d in opened) / len(opened), "%", low=100)
    yield Finding(check, "least angle reached", float(min(d.angles.max() for d in opened)), "degrees", 60, 96)
    yield Finding(check, "largest torque", max(d.torque for d in doors), "N m", 20, STRENGTH * 0.9)
    yield Finding(check, "furthest beyond its range", float(beyond), "degrees", high=1.5)
    yield Finding(check, "way of the hinge", 100 * max(d.hinge for d in doors), "cm", high=1.0)
    yield Finding(check, "deepest contact", 100 * max(d.depth for d in doors), "cm", high=1.0)
    check = "a door that opens towards the body blocks"
    yield Finding(check, "bodies through it", 100 * sum(d.through for d in held) / len(held), "%", high=0)
    yield Finding(check, "angle at the end", float(max(d.angles[-1] for d in held)), "degrees", high=1.0)
    heavy = swing(fixture, mass=1000.0)
    yield Finding("mass counts", "angle of a door of 1,000 kg", float(heavy.angles[-1]), "degrees", 5, 60)
