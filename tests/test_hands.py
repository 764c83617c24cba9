"""Hands: what they take, carry and let go of, on both engines; what the record and the senses say of it."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from engines import BULLET
from hosting import plugin

import humanclaw_skill_crouch
import humanclaw_skill_gaze
import humanclaw_skill_handle
import humanclaw_skill_hands
from humanclaw import (
    Backends,
    Body,
    Call,
    Decision,
    Episode,
    HumanclawError,
    Keyframes,
    Motion,
    Plugins,
    ProprioceptiveState,
    skill,
)
from humanclaw.body import JOINT_INDEX, JOINT_LIMITS, Pose2D, rest_pose
from humanclaw.body.limits import angles_from_standing
from humanclaw.checks.fakes import FAKE, Fakes
from humanclaw.records import RecordedEpisode, free_episode
from humanclaw.world import Hinge, ObjectMotion, Profile, SceneBuilder, Slide
from humanclaw.world.half_physics.push_force_limit import PushForceLimit

both = pytest.mark.parametrize("engine", ["mujoco", BULLET])
G = 9.81


@skill()
def wave_with_what_is_held(body: ProprioceptiveState) -> Keyframes:
    """Wave with the hand that holds something."""
    side = body.held[0] if body.held else "right"
    return Keyframes.cycle(f"{side}_elbow", axis="y", degrees=20, seconds=0.5)


@pytest.fixture(scope="module")
def plugins():
    packages = (humanclaw_skill_crouch, humanclaw_skill_gaze, humanclaw_skill_handle, humanclaw_skill_hands)
    host = Plugins.discover([Path(package.__file__).parent for package in packages])
    host.add(plugin(skills=[wave_with_what_is_held]), "own")
    host.add(Fakes(), FAKE)
    return host


class Room:
    """A floor, a table of 85 cm before the body, and a body."""

    def __init__(self, table=True):
        self.builder = SceneBuilder()
        self.builder.floor()
        if table:
            self.table = self.builder.box("table", (0.9, 0.85, 0.4), (0, 0, 0.7))

    def put(self, size=(0.07, 0.1, 0.07), place=(-0.15, 0.85, 0.55), mass=0.3, **facts):
        return self.builder.box("thing", size, place, movable=True, mass=mass, **facts)

    def body(self, plugins, engine, start=None, **chosen):
        return Body(
            self.builder.scene(), start, plugins=plugins, backends=Backends(engine, **{"renderer": FAKE} | chosen)
        )


def thing(body, key):
    return body.state().objects[key]


def joint(body, name):
    return body.state().body.joints()[-1, JOINT_INDEX[name]]


def path(body, key):
    """The (15, 7) places of an object in the last call."""
    still = np.repeat(thing(body, key)[None], 15, 0)
    return np.concatenate([chunk.execution.objects.get(key, still) for chunk in body.last.chunks])


def reach(body, side, *at, times=1):
    for _ in range(times):
        body.call("reach", side=side, **dict(zip(("x_cm", "y_cm", "z_cm"), at, strict=True)))


def take(body, key):
    """Take a thing on the table with the right hand, and raise it."""
    x, _, z = thing(body, key)[:3]
    width = np.ptp(body.scene.vertices(key)[:, 0])
    beside = round(100 * (x - width / 2 - 0.04))
    reach(body, "right", beside, 105, round(100 * z) - 12, times=2)
    reach(body, "right", beside, 93, round(100 * z) - 6)
    body.call("grasp", side="right")
    reach(body, "right", -22, 112, 38, times=2)
    return body.state().held == {"right": key}


# -- taking ------------------------------------------------------------------------------------------------------------
@pytest.mark.integration
@both
def test_a_hand_carries_a_cup_through_every_locomotion_skill(plugins, engine):
    """The ways are those of a body without a cup, to 5 cm in half a second."""
    room = Room()
    cup = room.put()
    calls = {name: skill for name, skill in plugins.skills.items() if skill.role == "locomotion"}
    with room.body(plugins, engine) as body:
        assert take(body, cup)
        for _ in range(4):
            body.call("step_back", z_cm=30)
        for skill in calls.values():
            bounds = {key: part["maximum"] for key, part in skill.schema["properties"].items() if "default" not in part}
            if skill.climbs:
                continue
            for _ in range(2):
                body.call(skill.name, **{key: most // 2 for key, most in bounds.items()})
                assert body.state().held == {"right": cup}, skill.name
        level = matrix_up(thing(body, cup))
        assert level > 0.99
        body.call("sit_in_place", h_cm=50)
        body.call("sit_in_place", h_cm=50)
        assert body.state().held == {"right": cup}
        assert joint(body, "pelvis")[1] < 0.6
        assert thing(body, cup)[1] > 0.5


def matrix_up(pose):
    x, _, z, _ = pose[3:]
    return 1 - 2 * (x * x + z * z)


@pytest.mark.integration
@both
def test_a_crouching_body_takes_a_thing_from_the_floor_and_rises(plugins, engine):
    room = Room(table=False)
    block = room.put((0.1, 0.12, 0.1), (-0.22, 0, 0.4))
    with room.body(plugins, engine) as body:
        body.call("crouch", h_cm=60)
        assert joint(body, "pelvis")[1] == pytest.approx(0.6, abs=0.01)
        back = -joint(body, "pelvis")[2]
        for height in (30, 11, 11):
            reach(body, "right", -31, height, round(100 * (0.36 + back)))
        body.call("grasp", side="right")
        body.call("crouch", h_cm=90)
        assert body.state().held == {"right": block}
        assert joint(body, "pelvis")[1] == pytest.approx(0.9, abs=0.02)
        assert thing(body, block)[1] > 0.4


@pytest.mark.integration
@both
def test_stairs_are_climbed_with_a_full_hand(plugins, engine):
    room = Room(table=False)
    room.builder.box("stairs", (2, 0.16, 0.28), (0, 0, 0.72))
    room.builder.box("stairs", (2, 0.32, 3.0), (0, 0, 2.36))
    room.builder.box("shelf", (0.2, 0.85, 0.2), (-0.45, 0, 0.4))
    cup = room.put(place=(-0.4, 0.85, 0.4))
    with room.body(plugins, engine) as body:
        assert take(body, cup)
        for _ in range(4):
            body.call("climb_upstairs", h_cm=16, d_cm=28)
        assert joint(body, "pelvis")[1] > 1.15
        assert body.state().held == {"right": cup}


@pytest.mark.integration
@both
def test_steps_down_do_not_shake_a_light_thing_out_of_the_hand(plugins, engine):
    """A hand brakes what it draws back to its place: it does not jointed past, farther each time."""
    room = Room(table=False)
    room.builder.descent(5, 0.18, 0.3, 0.3)
    room.builder.box("shelf", (0.2, 1.75, 0.2), (-0.45, 0, 0.4))
    clock = room.put((0.1, 0.12, 0.1), (-0.4, 1.75, 0.4), 0.1)
    with room.body(plugins, engine, Pose2D(0, 0, 0, floor=0.9)) as body:
        assert take(body, clock)
        ways = []
        for _ in range(4):
            body.call("walk_downstairs", h_cm=18, d_cm=36)
            hands = body.last.chunks[-1].execution.simulated.joints()[:, JOINT_INDEX["right_hand"]]
            ways += list(path(body, clock)[:, :3] - hands)
        assert body.state().held == {"right": clock}
        assert np.linalg.norm(np.array(ways) - ways[0], axis=1).mean() < 0.007


@both
def test_a_hand_closes_on_nothing_far_behind_its_back_or_fixed(plugins, engine):
    room = Room()
    room.put(place=(0.1, 0.85, 0.55))
    behind = room.put(place=(-0.38, 0.85, 0.55))
    with room.body(plugins, engine) as body:
        reach(body, "right", -30, 110, 40)
        reach(body, "right", -28, 93, 50)
        gap = abs(thing(body, behind)[0] + 0.035 - joint(body, "right_hand")[0])
        seen = body.call("grasp", side="right")
        assert gap < 0.08
        assert body.state().held == {}
        assert "your right hand closed on nothing" in str(seen.feedback)


@both
@pytest.mark.parametrize("wall", [True, False])
def test_a_hand_closes_on_nothing_behind_a_wall_even_a_thin_one(plugins, engine, wall):
    room = Room()
    if wall:
        room.builder.box("wall", (0.015, 0.3, 0.4), (-0.21, 0.85, 0.6))
    block = room.put((0.07, 0.2, 0.2), (-0.165, 0.85, 0.55))
    with room.body(plugins, engine) as body:
        reach(body, "right", -30, 110, 40)
        reach(body, "right", -25, 95, 50, times=2)
        body.call("grasp", side="right")
        assert body.state().held == ({} if wall else {"right": block})


@pytest.mark.integration
@both
def test_one_hand_lifts_10_kg_and_not_20_and_two_lift_20(plugins, engine):
    """150 N each; 20 kg weigh 196 N."""
    rises, held = [], []
    for mass, hands in ((10.0, "right"), (20.0, "right"), (20.0, "both")):
        room = Room(table=False)
        room.builder.box("table", (0.9, 0.6, 0.4), (0, 0, 0.7))
        box = room.put((0.3, 0.2, 0.2), (0, 0.6, 0.6), mass)
        with room.body(plugins, engine) as body:
            for side, x in (("right", -19), ("left", 19)) if hands == "both" else (("right", -19),):
                reach(body, side, x, 80, 50, times=3)
                body.call("grasp", side=side)
            stand_up = Call("rise_with_it")
            body.plugins.add(lifting(), f"lifting {mass} {hands}") if "rise_with_it" not in body.skills else None
            done = body.execute(stand_up)
            rises.append(max(places[:, 1].max() for places in paths(done, box)) - 0.6)
            held.append(len(body.state().held))
    assert rises[0] > 0.1
    assert rises[1] < 0.02
    assert rises[2] > 0.1
    assert held == [1, 0, 2]


def paths(done, key):
    return [c.execution.objects[key] for c in done.chunks if key in c.execution.objects] or [np.full((1, 7), 0.6)]


def lifting():
    @skill()
    def rise_with_it() -> Keyframes:
        """Straighten knees and trunk."""
        upright = dict.fromkeys(("pelvis", "spine1", "spine2", "spine3"), ((0.0, 0.0, 0.0),))
        return Keyframes((1.5,), upright, absolute=True, root=((0.0, 0.94, 0.0),))

    return plugin(skills=[rise_with_it])


# -- letting go --------------------------------------------------------------------------------------------------------
@pytest.mark.integration
@both
def test_what_is_let_go_of_falls_at_g(plugins, engine):
    room = Room()
    cup = room.put()
    with room.body(plugins, engine) as body:
        assert take(body, cup)
        for _ in range(3):
            body.call("step_back", z_cm=30)
        top = thing(body, cup)[1]
        body.call("release", side="right")
        fallen = top - path(body, cup)[:, 1]
        seconds = np.arange(1, 16) / 30
        free = fallen < top - 0.1
        assert fallen[free] == pytest.approx(0.5 * G * seconds[free] ** 2, abs=0.02)
        assert body.state().held == {}
        places = list(path(body, cup))
        for _ in range(2):
            body.call("step_back", z_cm=30)
            places += list(path(body, cup))
        assert min(body.scene.hulls(cup, place)[0][:, 1].min() for place in places) > -0.01  # It lands on the floor.
        assert joint(body, "right_hand")[1] < 1.0


@pytest.mark.integration
@both
def test_what_tumbles_off_a_table_does_not_enter_the_floor(plugins, engine):
    room = Room()
    plate = room.put((0.2, 0.05, 0.14), mass=0.8)
    with room.body(plugins, engine) as body:
        assert take(body, plate)
        reach(body, "right", -22, 100, 43, times=2)
        body.call("release", side="right")
        places = list(path(body, plate))
        for _ in range(2):
            body.call("step_back", z_cm=20)
            places += list(path(body, plate))
    heights = [body.scene.hulls(plate, place)[0][:, 1].min() for place in places]
    assert heights[-1] < 0.1
    assert min(heights) > -0.01


@pytest.mark.integration
@both
def test_a_wall_knocks_a_thing_out_of_the_hand(plugins, engine):
    room = Room()
    box = room.put((0.1, 0.1, 0.3), (-0.15, 0.85, 0.62), 1.0)
    wall = 1.6
    room.builder.box("wall", (6, 2.5, 0.2), (0, 0, -wall - 0.1))
    with room.body(plugins, engine) as body:
        assert take(body, box)
        body.call("step_back", z_cm=30)
        for _ in range(4):
            body.call("turn_in_place", yaw_deg=45)
        words, deepest = "", 0.0
        for _ in range(6):
            words += str(body.call("walk", z_cm=50).feedback)
            for pose in path(body, box):
                deepest = max(deepest, -wall - body.scene.vertices(box, pose)[:, 2].min())
        assert "what your right hand held slipped" in words
        assert body.state().held == {}
        assert deepest < 0.01


@pytest.mark.integration
@both
def test_a_held_thing_does_not_pass_through_a_table(plugins, engine):
    room = Room()
    cup = room.put()
    with room.body(plugins, engine) as body:
        assert take(body, cup)
        lowest = 1.0
        for _ in range(2):
            reach(body, "right", -22, 70, 55)
            lowest = min(lowest, *(body.scene.vertices(cup, pose)[:, 1].min() for pose in path(body, cup)))
        assert lowest > 0.84


@pytest.mark.integration
@both
def test_a_cup_on_a_tray_stays_on_it_while_the_body_turns_and_walks(plugins, engine):
    """One hand holds the tray at its right edge. Turns are of 20 degrees: 60 in half a second throw the cup off."""
    room = Room()
    tray = room.put((0.4, 0.02, 0.3), (-0.1, 0.85, 0.64), 0.6, friction=0.9)
    cup = room.put(place=(-0.1, 0.87, 0.64), friction=0.9)
    with room.body(plugins, engine) as body:
        reach(body, "right", -35, 105, 45, times=2)
        reach(body, "right", -34, 91, 52, times=2)
        body.call("grasp", side="right")
        reach(body, "right", -18, 108, 40, times=2)
        before = thing(body, cup)[:3] - thing(body, tray)[:3]
        for name, params in [
            *[("step_back", {"z_cm": 25})] * 2, *[("turn_in_place", {"yaw_deg": 20})] * 6,
            *[("walk", {"z_cm": 30})], *[("walk", {"z_cm": 50})] * 4,
        ]:  # fmt: skip
            body.call(name, **params)
        assert body.state().held == {"right": tray}
        after = thing(body, cup)[:3] - thing(body, tray)[:3]
        assert np.linalg.norm(before) == pytest.approx(np.linalg.norm(after), abs=0.05)
        assert after[1] == pytest.approx(0.02, abs=0.01)


# -- what opens --------------------------------------------------------------------------------------------------------
@pytest.mark.integration
@both
def test_a_door_opens_for_a_hand_that_pulls_no_faster_than_the_hand(plugins, engine):
    room = Room(table=False)
    hinge = Hinge((-0.3, 0, 0.02), -np.pi / 2, 0.0, 1.5, 2.0)
    door = room.builder.box(
        "door", (0.6, 1.7, 0.04), (0, 0.05, 0.75), rotation=(0, 1, 0, 0), movable=True, mass=12.0, joint=hinge
    )
    with room.body(plugins, engine, sensors=("touch",)) as body:
        obj = body.scene.by_id[door]
        reach(body, "right", -22, 110, 64, times=2)
        words = str(body.call("grasp", side="right").feedback)
        assert "Your right hand holds something." in words
        fastest, hand_speed = 0.0, 0.0
        for name, params in [("pull", {"side": "right", "cm": 20})] * 2 + [("step_back", {"z_cm": 20})]:
            body.call(name, **params)
            angles = [obj.state_at(pose) for pose in path(body, door)]
            hand = np.concatenate(
                [c.execution.simulated.joints()[:, JOINT_INDEX["right_hand"]] for c in body.last.chunks]
            )
            fastest = max(fastest, np.abs(np.diff(angles)).max() * 0.55 * 30)
            hand_speed = max(hand_speed, np.linalg.norm(np.diff(hand, axis=0), axis=1).max() * 30)
        assert obj.state_at(thing(body, door)) < np.radians(-35)
        assert fastest < hand_speed + 0.1
        assert hand_speed < 2.1
        before = joint(body, "right_hand")
        body.call("release", side="right")
        hand = body.last.chunks[0].execution.simulated.joints()[:, JOINT_INDEX["right_hand"]]
        assert np.linalg.norm(np.diff([before, *hand], axis=0), axis=1).max() * 30 < 2.0
        still = obj.state_at(thing(body, door))
        body.call("step_back", z_cm=20)
        assert obj.state_at(thing(body, door)) == pytest.approx(still, abs=0.2)


@both
def test_one_hand_opens_the_lid_of_an_oven_that_friction_bears(plugins, engine):
    """22 kg and 113 Nm of friction, as in generated houses: 176 N at the edge."""
    room = Room(table=False)
    hinge = Hinge((0, 0.06, 0.02), 0.0, np.pi / 2, 113.0, 4.0, axis=(1.0, 0.0, 0.0))
    lid = room.builder.box(
        "lid", (0.6, 0.7, 0.04), (0, 0.06, 0.75), rotation=(0, 1, 0, 0), movable=True, mass=22.0, joint=hinge
    )
    with room.body(plugins, engine) as body:
        reach(body, "right", -15, 71, 66, times=2)
        body.call("grasp", side="right")
        body.call("pull", side="right", cm=20)
        assert body.scene.by_id[lid].state_at(thing(body, lid)) > 0.2


@both
def test_a_drawer_follows_the_hand_stops_and_is_pushed_shut(plugins, engine):
    room = Room(table=False)
    drawer = room.builder.box(
        "drawer", (0.5, 0.2, 0.4), (0, 0.85, 0.8), rotation=(0, 1, 0, 0), movable=True, mass=4.0, joint=Slide(0.0, 0.2)
    )
    with room.body(plugins, engine) as body:
        obj = body.scene.by_id[drawer]
        reach(body, "right", -15, 97, 52, times=2)
        body.call("grasp", side="right")
        assert body.state().held == {"right": drawer}
        body.call("pull", side="right", cm=15)
        assert obj.state_at(thing(body, drawer)) == pytest.approx(0.15, abs=0.02)
        body.call("pull", side="right", cm=10)
        assert obj.state_at(thing(body, drawer)) == pytest.approx(0.2, abs=0.01)
        body.call("push", side="right", cm=30)
        assert obj.state_at(thing(body, drawer)) < 0.02


# -- strength ----------------------------------------------------------------------------------------------------------
@pytest.mark.integration
@both
def test_what_a_body_carries_weighs_on_what_it_can_push(plugins, engine):
    """8 kg in the hand leave 422 N of 500; friction holds a box of 140 kg with 343 N."""
    ways = []
    for mass in (0.3, 8.0):
        room = Room()
        load = room.put((0.1, 0.1, 0.1), mass=mass)
        box = room.put((0.6, 0.5, 0.5), (0, 0, -1.3), 140.0)
        with room.body(plugins, engine) as body:
            assert take(body, load)
            for _ in range(6):
                body.call("turn_in_place", yaw_deg=30)
            for _ in range(8):
                body.call("walk", z_cm=22)
            assert body.state().held == {"right": load}
            ways.append(-1.3 - thing(body, box)[2])
    assert 0 < ways[1] < 0.8 * ways[0]


# -- records, senses, plans --------------------------------------------------------------------------------------------
def test_a_strangers_skill_waves_with_what_is_held(plugins, tmp_path):
    room = Room()
    cup = room.put()
    side, at = {"side": "right"}, {"side": "right", "x_cm": -23, "y_cm": 93, "z_cm": 49}
    calls = [
        Call("reach", at | {"y_cm": 105}), Call("reach", at), Call("grasp", side),
        Call("reach", at | {"y_cm": 190, "z_cm": 90}), Call("wave_with_what_is_held"), Call("release", side),
    ]  # fmt: skip
    with (
        room.body(plugins, "mujoco", sensors=("touch", "body")) as body,
        Episode(body, free_episode("take the cup", body.scene), "t", folder=tmp_path / "e") as episode,
    ):
        for call in calls:
            episode.submit(Decision((call,)))
    steps = RecordedEpisode(tmp_path / "e").steps
    assert [step.held for step in steps] == [{}, {}, *[{"right": cup}] * 3, {}]
    assert steps[1].aims[0].at == pytest.approx((-0.23, 0.93, 0.49))
    assert steps[1].aims[0].error < 0.05
    assert steps[3].aims[0].error > 0.2
    assert f"your right hand stays {100 * steps[3].aims[0].error:.0f} cm short" in str(steps[3].feedback)
    assert [touch.part for touch in steps[4].tactile if touch.holds] == ["right hand"]
    assert "Your right hand holds something." in str(steps[4].feedback)
    assert not any(touch.holds for touch in steps[5].tactile)


def test_the_state_of_a_joint_is_read_off_a_pose():
    builder = SceneBuilder()
    door = builder.door(angle=0.4)
    leaf = builder.scene().by_id[door]
    for state in (-1.6, -1.0, 0.0):
        assert leaf.state_at(leaf.at(state)) == pytest.approx(state)


def test_a_reaching_hand_keeps_below_2_metres_a_second(plugins):
    with Room(table=False).body(plugins, "mujoco") as body:
        for at in ((-20, 190, 20), (-20, 40, 40), (-60, 150, 20), (10, 110, 30)):
            for _ in range(2):
                reach(body, "right", *at)
                motion = body.last.chunks[-1].commanded
                hand = motion.joints()[:, JOINT_INDEX["right_hand"]]
                assert np.linalg.norm(np.diff(hand, axis=0), axis=1).max() * 30 < 2.01
                assert hand[:, 2].min() > -0.05
                over = angles_from_standing(motion.rotations).max(0) - list(JOINT_LIMITS.values())
                assert over.max() < 0.1


def test_a_gaze_moves_what_is_seen_and_not_the_feet(plugins):
    room = Room()
    cup = room.put(place=(0.0, 0.85, 0.6))
    with room.body(plugins, "mujoco", renderer="raster") as body:
        feet = body.state().body.joints()[-1, JOINT_INDEX["left_ankle"]]
        before = (body.view().ids == cup).sum()
        body.call("gaze", yaw_deg=0, pitch_deg=35)
        assert before > 100
        assert not (body.view().ids == cup).any()
        body.call("gaze", yaw_deg=70, pitch_deg=-30)
        assert not (body.view().ids == cup).any()
        assert joint(body, "left_ankle") == pytest.approx(feet, abs=0.01)
        body.call("gaze", yaw_deg=0, pitch_deg=-30)
        assert (body.view().ids == cup).sum() > 100


@both
def test_hands_that_hold_nothing_change_nothing_bit_for_bit(plugins, engine):
    scene, ends = Room().builder.scene(), []
    for grips in (False, True):
        simulator = plugins.make("simulators", engine, profile="default")
        standing = rest_pose(15)
        simulator.reset(scene, scene.start)
        for k in range(3):
            if grips:
                simulator.grip("left", closed=k != 1)
            way = np.linspace(k / 4, (k + 1) / 4, 15)[:, None] * [0, 0, 1]
            ends.append(simulator.execute(Motion(standing.root + way, standing.rotations)))
        simulator.close()
    for plain, gripped in zip(ends[:3], ends[3:], strict=True):
        assert np.array_equal(plain.simulated.root, gripped.simulated.root)
        assert np.array_equal(plain.simulated.rotations, gripped.simulated.rotations)
        assert plain.contacts == gripped.contacts


def test_a_simulator_without_a_scene_has_no_hands(plugins):
    with pytest.raises(HumanclawError, match="reset"):
        plugins.make("simulators", "mujoco", profile="default").grip("left", True)


def test_what_a_limb_threw_off_is_as_slow_as_a_kick():
    room = Room(table=False)
    bear = room.put(mass=0.5)
    scene, motions = room.builder.scene(), []
    still = ObjectMotion(np.zeros(3), np.array([0, 0, 0, 1.0]), np.zeros(3), np.zeros(3))
    world = SimpleNamespace(motion=lambda key: motions[-1], set_motion=lambda key, motion: motions.append(motion))
    limit = PushForceLimit(world, Profile("default"), scene)
    limit.look((bear,))
    motions.append(still)
    limit.brace()
    motions.append(replace(still, velocity=np.array([0.0, 16.9, 0.0])))
    limit.bound((), 1 / 120)
    assert np.linalg.norm(motions[-1].velocity) == pytest.approx(Profile("default").max_kick)
