"""The poses that a motion continues: the model's own, or the simulated body's."""

import numpy as np
import pytest
from hosting import plugin

from humanclaw import Backends, Body, Call, Gaze, HumanclawError, Plugins, skill
from humanclaw.body import HISTORY, JOINT_INDEX, forward_kinematics, heading
from humanclaw.checks.fakes import FAKE, FakeGenerator, Fakes
from humanclaw.motion import PROFILES, DiTGenerator
from humanclaw.testing import fake_scene
from humanclaw.world import SceneBuilder


@pytest.fixture
def walked():
    """Return a function that walks three calls into a wall and gives the body and its last chunk."""
    builder = SceneBuilder.on_floor()
    builder.box("wall", (3.0, 2.0, 0.2), (0.0, 0.0, 0.9))
    scene = builder.scene()

    def play(source):
        with Body(scene, plugins=Plugins.discover(), backends=Backends(motion_history=source)) as body:
            for _ in range(3):
                body.call("walk", z_cm=50)
            return body, body.last.chunks[-1]

    return play


def test_the_simulated_history_is_what_the_body_did(walked):
    body, chunk = walked("simulated")
    played = chunk.execution.simulated[-HISTORY:]
    assert np.array_equal(body.history.root, played.root)
    assert np.array_equal(body.history.rotations, played.rotations)


def test_the_generated_history_stands_where_the_body_is(walked):
    body, chunk = walked("generated")
    simulated = chunk.execution.simulated
    assert body.history.root[-1, [0, 2]] == pytest.approx(simulated.root[-1, [0, 2]], abs=1e-6)
    assert heading(body.history.rotations[-1, 0]) == pytest.approx(heading(simulated.rotations[-1, 0]), abs=1e-6)
    # The wall bends the limbs of the body, not those of the history.
    assert np.allclose(body.history.rotations[-1, 1:], chunk.commanded.rotations[-1, 1:])
    assert not np.allclose(body.history.rotations[-1, 1:], simulated.rotations[-1, 1:], atol=0.01)


def test_an_unknown_source_is_refused_with_the_known_ones():
    with pytest.raises(HumanclawError, match=r"no motion history 'mine'\. Choose from: generated, simulated"):
        Body(backends=Backends(motion_history="mine"))


class Veering(FakeGenerator):
    """Turns two degrees too far in every call."""

    digest = DiTGenerator.load().digest

    def generate(self, history, adapter, values, key):
        return super().generate(history, adapter, values | {"yaw": values["yaw"] + np.radians(2)}, key)


@pytest.mark.parametrize(("profile", "asked"), [("default", [30, 28, 28]), ("paper", [30, 30, 30])])
def test_the_papers_profile_alone_leaves_heading_errors_as_they_are(profile, asked):
    generator, plugins = Veering(), Plugins.discover()
    plugins.add(Fakes(), FAKE)
    plugins.add(plugin(motion_generators=[("veering", lambda profile="default": generator)]), "mine")
    with Body(fake_scene(), plugins=plugins, backends=Backends(FAKE, FAKE, "veering", profile)) as body:
        for _ in asked:
            body.call("turn_in_place", yaw_deg=30)
    assert [np.degrees(values["yaw"]) - 2 for _, values in generator.asked] == pytest.approx(asked)


def least_distance(motion):
    """Return how near the wrists and finger tips of a motion come to the axes of the thighs, metres."""
    joints, turns = forward_kinematics(motion.root, motion.rotations)
    distances = []
    for side, sign in (("left", 1), ("right", -1)):
        hand = JOINT_INDEX[f"{side}_hand"]
        for point in (joints[:, JOINT_INDEX[f"{side}_wrist"]], joints[:, hand] + turns[:, hand] @ [sign * 0.085, 0, 0]):
            for thigh in ("left", "right"):
                start, end = (joints[:, JOINT_INDEX[f"{thigh}_{part}"]] for part in ("hip", "knee"))
                along = np.clip(np.sum((point - start) * (end - start), -1) / np.sum((end - start) ** 2, -1), 0, 1)
                distances.append(np.linalg.norm(point - start - along[:, None] * (end - start), axis=-1))
    return np.min(distances)


@pytest.mark.parametrize("seat", [0.35, 0.45, 0.64])
def test_hands_stay_clear_of_thighs_that_a_seat_lifts(seat):
    builder = SceneBuilder.on_floor()
    builder.box("couch", (1.2, seat, 1.0), (0.0, 0.0, -0.63))
    with Body(builder.scene(), plugins=Plugins.discover()) as body:
        parts = [
            chunk.execution.simulated
            for _ in range(2)
            for chunk in body.execute(Call("sit_in_place", {"h_cm": round(100 * seat + 10)})).chunks
        ]
        history = body.history
    # A thigh is a cylinder of 7 cm; the model alone has its fingers 2 cm from the axis.
    assert min(least_distance(part) for part in parts) > 0.068
    assert least_distance(history) < 0.05


@pytest.mark.parametrize("seed", [0, 1])
def test_feet_do_not_push_a_body_off_a_seat_whose_back_has_lifted_it(seed):
    builder = SceneBuilder.on_floor()
    builder.box("toilet", (0.4, 0.41, 0.5), (0.0, 0.0, -0.75))
    builder.box("cistern", (0.4, 0.85, 0.2), (0.0, 0.0, -0.95))
    with Body(builder.scene(), plugins=Plugins.discover(), seed=seed) as body:
        body.call("step_back", z_cm=30)
        *_, last = body.execute(Call("sit_in_place", {"h_cm": 52})).chunks
    # Hips that rest on the seat are at 0.41 + 0.14 m; feet that reached for the floor meanwhile left them at 0.559.
    assert last.execution.simulated.root[-1, 1] == pytest.approx(0.55, abs=0.003)


def test_the_papers_profile_switches_every_correction_off():
    on = [name for name, value in vars(PROFILES["paper"]).items() if value]
    assert on == ["solver"]


@skill()
def nod() -> Gaze:
    """Look down."""
    return Gaze.towards(0, -40, seconds=0.5)


@pytest.mark.parametrize(("profile", "times"), [("default", 0), ("paper", 1)])
def test_the_papers_profile_names_the_skills_beyond_the_papers(caplog, profile, times):
    plugins = Plugins.discover()
    plugins.add(Fakes([nod]), FAKE)
    with Body(fake_scene(), plugins=plugins, backends=Backends(FAKE, FAKE, FAKE, profile)):
        assert caplog.text.count("nod") == times
