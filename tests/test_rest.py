"""Movable objects come to rest once for a house and an engine, and lie there at every start."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from engines import BULLET

from humanclaw import Plugins, Scene, SceneError, Simulator
from humanclaw.body import FUTURE, Motion, Pose2D, matrix_from_quaternion, rest_pose
from humanclaw.world import Execution, SceneBuilder, block

FALLS = 9.81 * np.array([0.5, 1.0]) ** 2 / 2
"""Metres that a thing falls in half a second and in one."""


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HUMANCLAW_CACHE", str(tmp_path))
    return tmp_path


@pytest.fixture(params=[BULLET, "mujoco"])
def engine(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def simulator(engine: str, cache: Path, plugins: Plugins) -> Iterator[Simulator]:
    made = plugins.make("simulators", engine)
    yield made
    made.close()


def house() -> Scene:
    """Return a floor with a leaning pile that takes a moment to settle, two metres before the body."""
    builder = SceneBuilder.on_floor()
    builder.box("table", (1.0, 0.7, 1.0), (0, 0, 2.0))
    for level in range(4):
        builder.box("book", (0.2, 0.04, 0.15), (0.03 * level, 0.705 + 0.045 * level, 1.7), movable=True, mass=0.5)
    builder.box("box", (0.3, 0.3, 0.3), (0, 0.01, 0.6), movable=True, mass=2.0)
    return builder.scene()


def places(simulator: Simulator, scene: Scene, start: Pose2D) -> dict[int, bytes]:
    return {key: place.tobytes() for key, place in simulator.reset(scene, start).objects.items()}


def walked(simulator: Simulator, scene: Scene) -> Execution:
    """Walk into the box for half a second."""
    simulator.reset(scene, scene.start)
    path = rest_pose().root + np.linspace(0, 0.7, FUTURE)[:, None] * [0.0, 0.0, 1.0]
    return simulator.execute(Motion(path, rest_pose(FUTURE).rotations))


def same(run: Execution, other: Execution) -> bool:
    arrays = [(run.simulated.root, other.simulated.root), (run.simulated.rotations, other.simulated.rotations)]
    arrays += [(run.objects[key], other.objects[key]) for key in run.objects.keys() | other.objects.keys()]
    return run.contacts == other.contacts and all(np.array_equal(*pair) for pair in arrays)


def test_every_start_finds_every_object_at_the_same_place(simulator: Simulator) -> None:
    scene = house()
    starts = [Pose2D(), Pose2D(x=-1.0, z=0.5, yaw=2.0), Pose2D(x=2.0, z=-3.0)]
    placings = [places(simulator, scene, start) for start in starts]
    walked(simulator, scene)
    placings.append(places(simulator, scene, starts[0]))
    assert all(placing == placings[0] for placing in placings)


def test_what_is_placed_in_a_floor_stays_in_it(simulator: Simulator) -> None:
    """The top of a box 5 cm under the floor: the nearest way out of it is down, for ever."""
    builder = SceneBuilder.on_floor()
    box = builder.box("box", (0.3, 0.3, 0.3), (0, -0.35, 0.6), movable=True, mass=5.0)
    scene = builder.scene()
    simulator.reset(scene, scene.start)
    assert walked(simulator, scene).simulated.root[-1, 2] > 0.5
    np.testing.assert_array_equal(simulator.state().objects[box][:3], scene.by_id[box].position)


def test_a_house_from_the_cache_is_the_house_that_settled(engine: str, cache: Path, plugins: Plugins) -> None:
    first, later = (walked(plugins.make("simulators", engine), house()) for _ in range(2))
    assert len(list(cache.glob("*/*"))) == 1
    assert first.objects, "the box must move"
    assert same(first, later)


def test_a_damaged_entry_is_made_again(engine: str, cache: Path, plugins: Plugins) -> None:
    first = walked(plugins.make("simulators", engine), house())
    (entry,) = cache.glob("*/*")
    sound = entry.read_bytes()
    entry.write_bytes(sound[:-1] + bytes([sound[-1] ^ 1]))
    with pytest.warns(UserWarning, match="is made anew: it is damaged"):
        assert same(walked(plugins.make("simulators", engine), house()), first)
    assert entry.read_bytes() == sound


@pytest.mark.integration
def test_engines_and_profiles_do_not_share_entries(cache: Path, plugins: Plugins) -> None:
    for engine in ("bullet", "mujoco"):
        for profile in ("default", "paper", "default"):
            walked(plugins.make("simulators", engine, profile=profile), house())
    assert len(list(cache.glob("*/*"))) == 4


def test_a_tray_of_one_solid_piece_carries_a_book_on_top(simulator: Simulator) -> None:
    """Two scenes of the same points in other pieces do not share an entry: the tray is hollow, then solid."""
    bottom, sides = block((-0.5, 0, -0.5), (0.5, 0.05, 0.5)), [(-0.5, -0.4), (0.4, 0.5)]
    pieces = [bottom, *(block((low, 0.05, -0.5), (high, 0.4, 0.5)) for low, high in sides)]
    for hulls, height in ((pieces, 0.05), ([np.concatenate(pieces)], 0.4)):
        builder = SceneBuilder.on_floor()
        builder.solid("tray", hulls, (0, 0, 2.0), movable=True, mass=5.0)
        book = builder.box("book", (0.1, 0.05, 0.1), (0, 0.41, 2.0), movable=True, mass=0.3)
        placing = simulator.reset(builder.scene(), Pose2D()).objects[book]
        assert placing[1] == pytest.approx(height, abs=0.01)


def test_what_overlaps_at_the_start_comes_apart_and_stays_near(simulator: Simulator) -> None:
    """Four crates of 50 cm, each 25 cm inside the next, and one 15 cm inside a wall whose face is at z = 4.

    Apart, the outer crates are at least 1.5 m from each other, and the last one ends before z = 3.75. At half a metre a
    second they would come 12 cm further in the half second in which they settle.
    """
    builder = SceneBuilder.on_floor()
    builder.box("wall", (6.0, 2.5, 0.2), (0, 0, 4.1))
    crates = [
        builder.box("box", (0.5, 0.5, 0.5), place, movable=True, mass=5.0)
        for place in [(-0.375, 0, 2.0), (-0.125, 0, 2.0), (0.125, 0, 2.0), (0.375, 0, 2.0), (2.0, 0, 3.9)]
    ]
    scene = builder.scene()
    begun = simulator.reset(scene, Pose2D()).objects
    for _ in range(4):
        simulator.execute(rest_pose(FUTURE))
    objects = simulator.state().objects
    assert 1.49 < objects[crates[3]][0] - objects[crates[0]][0] < 1.75
    assert 3.6 < objects[crates[4]][2] < 3.76
    for key in crates:
        assert objects[key][1] == pytest.approx(0, abs=0.005)
        assert np.linalg.norm(objects[key][:3] - begun[key][:3]) < 0.15


def test_what_is_placed_in_the_middle_of_a_wall_ends_in_the_house(simulator: Simulator) -> None:
    """Crates of 50 cm in walls from 4 to 4.2 m: 15 cm to the outside are nearer than 35 cm to the inside. One is in the
    corner where two walls meet: as far as its middle it is in both."""
    builder = SceneBuilder.on_floor()
    for side in (-4.1, 4.1):
        builder.box("wall", (8.0, 2.5, 0.2), (0, 0, side))
        builder.box("wall", (0.2, 2.5, 8.4), (side, 0, 0))
    places = [(2.0, 0, 4.1), (-4.15, 0, 1.0), (-4.1, 0, -4.1)]
    crates = [builder.box("box", (0.5, 0.5, 0.5), place, movable=True, mass=5.0) for place in places]
    objects = simulator.reset(builder.scene(), Pose2D()).objects
    assert objects[crates[0]][:3] == pytest.approx((2.0, 0.0, 3.75), abs=0.01)
    assert objects[crates[1]][:3] == pytest.approx((-3.75, 0.0, 1.0), abs=0.01)
    assert objects[crates[2]][:3] == pytest.approx((-3.75, 0.0, -3.75), abs=0.05)


@pytest.mark.parametrize("overlap", [0.002, 0.02])
def test_a_row_of_books_that_overlap_stays_on_its_shelf(overlap: float, simulator: Simulator) -> None:
    """16 books of 4 cm, each so far inside the next, on a board from x = 1.55 to 2.45: they come 15 times as far apart
    in all, half of it at each end."""
    builder = SceneBuilder.on_floor()
    builder.box("shelf", (0.9, 0.03, 0.3), (2, 1.0, 2))
    places = [(2 + (0.04 - overlap) * (number - 7.5), 1.03, 2) for number in range(16)]
    books = [builder.box("book", (0.04, 0.25, 0.2), place, movable=True, mass=0.4) for place in places]
    scene = builder.scene()
    begun = simulator.reset(scene, Pose2D()).objects
    simulator.execute(rest_pose(FUTURE))
    objects = simulator.state().objects
    for book in books:
        assert begun[book][:3] == pytest.approx(scene.by_id[book].position, abs=7.5 * overlap + 0.01)
        assert objects[book][:3] == pytest.approx(begun[book][:3], abs=0.002)


def test_boxes_pressed_into_a_tray_are_not_shot_out_of_it(simulator: Simulator) -> None:
    """Three boxes of 30 cm, 15 cm from middle to middle, between the sides of a tray of 44 cm: they do not fit in. At
    0.1 m/s one would move 5 cm."""
    builder = SceneBuilder.on_floor()
    sides = [block((x, 0.03, -0.25), (x + 0.03, 0.3, 0.25)) for x in (-0.25, 0.22)]
    builder.solid("tray", [block((-0.25, 0, -0.25), (0.25, 0.03, 0.25)), *sides], (2, 0, 2), movable=True, mass=2.0)
    places = [(1.9 + 0.15 * number, 0.02, 2) for number in range(3)]
    boxes = [builder.box("box", (0.3, 0.2, 0.3), place, movable=True, mass=1.0) for place in places]
    begun = simulator.reset(builder.scene(), Pose2D()).objects
    simulator.execute(rest_pose(FUTURE))
    objects = simulator.state().objects
    for box in boxes:
        assert objects[box][:3] == pytest.approx(begun[box][:3], abs=0.05)


@pytest.mark.parametrize("points", [1, 2, 3, 4])
@pytest.mark.parametrize("movable", [False, True])
def test_a_flat_piece_collides_as_a_thin_one(points: int, movable: bool, simulator: Simulator) -> None:
    """A board of no thickness, or a corner, edge or half of it, on a block of 20 cm: it bears what rests on it."""
    board = np.array([(0, 0.3, 0), (0.5, 0.3, 0.5), (-0.5, 0.3, 0.5), (0, 0.3, -0.5)], np.float32)[:points]
    facts = {"movable": True, "mass": 5.0} if movable else {}
    builder = SceneBuilder.on_floor()
    table = builder.solid("table", [block((-0.1, 0, -0.1), (0.1, 0.2, 0.1)), board], (0, 0, 2.0), **facts)
    cup = builder.box("cup", (0.1, 0.1, 0.1), (0, 0.305, 2.1), movable=True, mass=0.2)
    scene = builder.scene()
    objects = simulator.reset(scene, Pose2D()).objects
    assert not movable or objects[table][1] == pytest.approx(0, abs=0.01)
    assert points < 3 or objects[cup][1] == pytest.approx(0.3, abs=0.01)


@pytest.mark.parametrize(("piece", "said"), [
    (np.zeros((0, 3), np.float32), "has no points"),
    (np.full((4, 3), np.nan, np.float32), "points that are no numbers"),
])  # fmt: skip
def test_a_piece_without_a_shape_is_refused(piece, said) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(SceneError, match=f"collision piece of asset 'table 1' .*{said}"):
        SceneBuilder.on_floor().solid("table", [block((0, 0, 0), (1, 1, 1)), piece], (0, 0, 2.0))


def test_a_light_thing_bears_a_heavy_one(simulator: Simulator) -> None:
    """200 kg on a cup of 50 g, 10 cm high."""
    builder = SceneBuilder.on_floor()
    builder.box("cup", (0.08, 0.1, 0.08), (2, 0, 2), movable=True, mass=0.05)
    safe = builder.box("safe", (0.5, 0.5, 0.5), (2, 0.1, 2), movable=True, mass=200.0)
    scene = builder.scene()
    simulator.reset(scene, Pose2D())
    simulator.execute(rest_pose(FUTURE))
    assert simulator.state().objects[safe][1] == pytest.approx(0.1, abs=0.002)


def test_what_has_not_come_to_rest_goes_on_falling(simulator: Simulator) -> None:
    """A box falls from 9 m for half a second without the body, and goes on while the body stands."""
    builder = SceneBuilder.on_floor()
    box = builder.box("box", (0.3, 0.3, 0.3), (2.0, 9.0, 0.0), movable=True, mass=2.0)
    scene = builder.scene()
    at_start = 9.0 - simulator.reset(scene, Pose2D()).objects[box][1]
    simulator.execute(rest_pose(FUTURE))
    later = 9.0 - simulator.state().objects[box][1]
    assert FALLS[0] < at_start < FALLS[1]
    assert later - at_start > FALLS[1] - FALLS[0]


def test_a_plank_that_still_topples_after_half_a_second_falls_over(simulator: Simulator) -> None:
    """It stands 2 degrees off the vertical, over an edge that bears it up to atan(0.03 / 1.2) = 1.4 degrees."""
    lean = np.radians(2) / 2
    builder = SceneBuilder.on_floor()
    turn = (0.0, 0.0, float(np.sin(lean)), float(np.cos(lean)))
    plank = builder.box("plank", (0.03, 1.2, 0.2), (0, 0.001, 3), rotation=turn, movable=True, mass=1.0)
    scene = builder.scene()
    tilts = [up(simulator.reset(scene, Pose2D()).objects[plank])]
    for _ in range(6):
        simulator.execute(rest_pose(FUTURE))
        tilts.append(up(simulator.state().objects[plank]))
    assert tilts[0] > np.cos(np.radians(10)), "it has hardly begun to fall"
    assert abs(tilts[-1]) < 0.05, "it lies"


def up(place: np.ndarray) -> float:
    """Return how far the upright axis of a thing at (7,) points up: 1 upright, 0 lying."""
    return float(matrix_from_quaternion(place[3:])[1, 1])
