"""Bodies that share a world: they block one another, and nobody is thrown, pushed through a wall or made to fall."""

from dataclasses import dataclass

import numpy as np
import pytest
from engines import BULLET

from humanclaw import Chunk, HumanclawError, Plugins, SceneError
from humanclaw.body import FPS, FUTURE, Motion, Pose2D, matrix_from_vector, rest_pose
from humanclaw.body.skeleton import STANDING_HEIGHT
from humanclaw.checks.motions import gait, glide
from humanclaw.laws.played import Played, play
from humanclaw.world import HalfPhysics, Scene, SceneBuilder, person_id, shared

FACING = Pose2D(0.0, 0.0, 0.0), Pose2D(0.0, 1.2, np.pi)
"""Two who look at each other."""
AWAY = 0.9
"""Each starts so far from where the ways cross, metres."""
RISE, RUN = 0.17, 0.28
"""Of the stairs, metres."""


@pytest.fixture(scope="module")
def plugins():
    return Plugins.discover()


@pytest.fixture(params=["mujoco", BULLET])
def simulator(request, plugins):
    made = shared(plugins.make("simulators", request.param, profile="default"))
    yield made
    made.close()


def play_together(simulator, scene, starts, motions, begun=lambda: None):
    """Drive bodies through motions, each in the frame of its start, from where each is; return what each Played."""
    states = simulator.reset_all(scene, starts)
    begun()
    placed = [start.to_world(motion) for start, motion in zip(starts, motions, strict=True)]
    here = before = np.stack([state.body.root[-1] for state in states])
    chunks = [[] for _ in starts]
    for first in range(0, len(motions[0]), FUTURE):
        pieces = [motion[first : first + FUTURE] for motion in placed]
        gaps = (here - before) * [1, 0, 1]
        commanded = [Motion(piece.root + gap, piece.rotations) for piece, gap in zip(pieces, gaps, strict=True)]
        executions = simulator.execute_all(commanded)
        here = np.stack([execution.simulated.root[-1] for execution in executions])
        before = np.stack([piece.root[-1] for piece in pieces])
        for own, *chunk in zip(chunks, commanded, executions, strict=True):
            own.append(Chunk(*chunk))
    return tuple(Played(state, tuple(own)) for state, own in zip(states, chunks, strict=True))


def on_floor():
    return SceneBuilder.on_floor().scene()


def deepest(contacts):
    return max((contact.depth for contact in contacts), default=0.0)


# -- two ---------------------------------------------------------------------------------------------------------------
@pytest.mark.integration
def test_two_who_walk_into_each_other_stop_each_other_halfway(simulator):
    walk = gait(3, 0.4)
    left, right = play_together(simulator, on_floor(), FACING, (walk, walk))
    ends = left.simulated.root[-1, 2], right.simulated.root[-1, 2]
    assert ends[0] + ends[1] == pytest.approx(1.2, abs=0.05)
    assert ends[1] - ends[0] > 0.2
    assert deepest(left.contacts) < 0.02


def test_both_feel_the_other_as_a_person_and_know_where_it_is(simulator):
    walk = gait(2, 0.4)
    meeting = play_together(simulator, on_floor(), FACING, (walk, walk))
    for number, played in enumerate(meeting):
        assert {contact.object_id for contact in played.contacts if contact.person} == {person_id(1 - number)}
        assert not any(contact.movable for contact in played.contacts)
    first, second = simulator.states()
    assert np.array_equal(first.people[person_id(1)].root, second.body.root)
    last = meeting[1].chunks[-1].execution
    assert np.array_equal(last.people[person_id(0)].root[-1], first.body.root[0])


@pytest.mark.integration
@pytest.mark.parametrize("speed", [1.0, 5.0])
def test_who_stands_is_not_carried_off_by_who_runs_into_them(simulator, speed):
    _, standing = play_together(simulator, on_floor(), FACING, (glide(0.0, speed, 30), rest_pose(30)))
    assert np.abs(standing.simulated.root[-1] - standing.began.body.root[-1]).max() < 0.1


@pytest.mark.integration
@pytest.mark.parametrize("speed", [1.0, 2.0, 5.0])
def test_nobody_is_pushed_into_a_wall(simulator, speed):
    """Who is pushed steps back to the wall meanwhile, and would be undone into it."""
    builder = SceneBuilder.on_floor()
    wall = builder.box("wall", (6, 2.5, 0.05), (0, 0, 1.5))
    _, pushed = play_together(simulator, builder.scene(), FACING, (glide(0.0, speed, 45), glide(0.0, -0.5, 45)))
    assert deepest(pushed.touched(wall)) < 0.02
    assert pushed.simulated.joints()[..., 2].max() < 1.5


@pytest.mark.integration
def test_the_same_meeting_has_the_same_outcome_bit_for_bit(simulator):
    walk, meetings = gait(2, 0.4), []
    for _ in range(2):
        meetings.append(play_together(simulator, on_floor(), FACING, (walk, walk)))
    for before, after in zip(*meetings, strict=True):
        assert np.array_equal(before.simulated.root, after.simulated.root)
        assert before.contacts == after.contacts


@pytest.mark.integration
def test_a_body_that_meets_nobody_moves_as_if_it_were_alone(simulator):
    walk, scene = gait(2, 0.3), on_floor()
    alone = play(simulator, scene, walk)
    walking, _ = play_together(simulator, scene, (scene.start, Pose2D(5.0, 5.0, 0.0)), (walk, walk))
    assert np.abs(walking.simulated.root - alone.simulated.root).max() < 1e-3


@pytest.mark.integration
def test_four_bodies_walk_in_one_world(simulator):
    starts = [Pose2D(-AWAY * np.sin(turn), -AWAY * np.cos(turn), turn) for turn in np.arange(4) * np.pi / 2]
    for played in play_together(simulator, on_floor(), starts, [gait(3, 0.4)] * 4):
        assert len(played.began.people) == 3
        assert deepest(played.contacts) < 0.03
        assert played.simulated.root[:, 1].max() < STANDING_HEIGHT + 0.2


@pytest.mark.integration
def test_a_thing_goes_from_one_hand_to_that_of_another(simulator):
    """Two stand side by side, face opposite ways, and each has the thing on a post before the right palm."""
    builder = SceneBuilder.on_floor()
    builder.box("post", (0.06, 0.74, 0.06), (-0.33, 0, 0.03))
    thing = builder.box("thing", (0.05, 0.07, 0.05), (-0.33, 0.74, 0.03), movable=True, mass=0.5)
    starts, back = (Pose2D(0.0, 0.0, 0.0), Pose2D(-0.66, 0.06, np.pi)), glide(0.0, -0.6, 45)

    def pass_on():
        simulator.grip("right", True, body=0)
        simulator.grip("right", True, body=1)
        simulator.grip("right", False, body=0)

    giver, taker = play_together(simulator, builder.scene(), starts, (rest_pose(45), back), pass_on)
    assert giver.chunks[-1].execution.held == {}
    assert taker.chunks[-1].execution.held == {"right": thing}
    assert taker.paths[thing][-1, 2] == pytest.approx(0.03 + 0.9, abs=0.05)


# -- what is refused ---------------------------------------------------------------------------------------------------
def test_a_start_inside_another_body_is_refused_with_a_remedy(simulator):
    with pytest.raises(SceneError, match=r"does not fit .* inside another body") as raised:
        simulator.reset_all(on_floor(), [Pose2D(0.0, 0.0, 0.0), Pose2D(0.1, 0.0, 1.0)])
    assert raised.value.remedy


def test_each_body_needs_a_motion_and_all_last_as_long(simulator):
    simulator.reset_all(on_floor(), FACING)
    for motions in ([rest_pose(15)], [rest_pose(15), rest_pose(14)]):
        with pytest.raises(HumanclawError, match="holds 2 bodies"):
            simulator.execute_all(motions)


def test_a_simulator_of_one_body_says_so():
    with pytest.raises(HumanclawError, match="hold one body"):
        shared(HalfPhysics(lambda scene, profile, pose: None))


# -- forty collisions --------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Meeting:
    """Two on their way to one another. grips: the first takes what is at its right hand before it goes."""

    scene: Scene
    starts: tuple[Pose2D, Pose2D]
    motions: tuple[Motion, Motion]
    grips: bool = False

    def played(self, simulator):
        begun = (lambda: simulator.grip("right", True, body=0)) if self.grips else (lambda: None)
        return play_together(simulator, self.scene, self.starts, self.motions, begun)


def towards(turn):
    """Return a start from which a body that looks along `turn` walks over a point 0.9 m ahead of the origin."""
    return Pose2D(-AWAY * np.sin(turn), AWAY - AWAY * np.cos(turn), turn)


def both_walk(turn, builder=None, grips=False):
    # Nearer than 60 degrees the starts would overlap.
    turn, walk = np.pi + (turn - np.pi) * 2 / 3, gait(4, 0.4)
    return Meeting((builder or SceneBuilder.on_floor()).scene(), (towards(0.0), towards(turn)), (walk, walk), grips)


def one_stands(turn):
    walk = gait(4, 0.4)
    return Meeting(on_floor(), (towards(0.0), Pose2D(0.0, AWAY, turn)), (walk, rest_pose(len(walk))))


def in_a_doorway(turn):
    """Both come through 90 cm from two sides, a little beside each other."""
    builder, walk = SceneBuilder.on_floor(), gait(4, 0.4)
    for side in (-1, 1):
        builder.box("wall", (2, 2.2, 0.2), (side * 1.45, 0, AWAY))
    return Meeting(builder.scene(), (towards(0.0), Pose2D(0.1 * np.sin(turn), 2 * AWAY, np.pi)), (walk, walk))


def on_stairs(turn):
    """One climbs to another that stands at the top."""
    builder, climb = SceneBuilder.on_floor(), gait(5, RUN, rise=RISE)
    builder.steps(5, RISE, RUN, 0.29)
    top = Pose2D(0.0, 0.29 + 4.8 * RUN, turn, floor=5 * RISE)
    return Meeting(builder.scene(), (towards(0.0), top), (climb, rest_pose(len(climb))))


def one_carries(turn):
    """Both walk; the thing was on a post."""
    builder = SceneBuilder.on_floor()
    builder.box("post", (0.06, 0.74, 0.06), (-0.33, 0, 0.0))
    builder.box("thing", (0.05, 0.07, 0.05), (-0.33, 0.74, 0.0), movable=True, mass=0.5)
    return both_walk(turn, builder, grips=True)


MEETINGS = both_walk, one_stands, in_a_doorway, on_stairs, one_carries


def check_collision(simulator, number):
    """Play one of forty collisions: five kinds, and angles that the golden ratio spreads."""
    meeting = MEETINGS[number % len(MEETINGS)](2 * np.pi * (0.618 * number % 1.0))
    sides = meeting.played(simulator)
    contacts = [contact for played in sides for contact in played.contacts]
    assert any(contact.person for contact in contacts)
    assert deepest(contacts) < 0.02
    for played, motion in zip(sides, meeting.motions, strict=True):
        root, began = played.simulated.root, played.began.body.root[-1]
        assert np.isfinite(root).all()
        assert np.linalg.norm(np.diff(root, axis=0), axis=1).max() * FPS < 2.5
        assert matrix_from_vector(played.simulated.rotations[-1, 0])[1, 1] > 0.99
        # One may step onto the other's shoes, and no higher.
        assert (root - np.concatenate([chunk.commanded.root for chunk in played.chunks]))[:, 1].max() < 0.2
        if np.ptp(motion.root[:, 2]) == 0.0:
            assert np.linalg.norm((root - began)[:, [0, 2]], axis=1).max() < 0.12


@pytest.mark.integration
@pytest.mark.parametrize("number", range(5))
def test_bodies_that_collide_obey_the_laws(simulator, number):
    check_collision(simulator, number)


@pytest.mark.evidence
@pytest.mark.parametrize("number", range(5, 40))
def test_bodies_that_collide_at_any_angle_obey_the_laws(simulator, number):
    check_collision(simulator, number)
