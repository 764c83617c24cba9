"""The poses that a motion continues: the model's own, or the simulated body's."""

import numpy as np
import pytest

from humanclaw import Backends, Body, Call, HumanclawError, Plugins, hookimpl
from humanclaw.body import HISTORY, heading
from humanclaw.motion import DiTGenerator, lay_hands
from humanclaw.testing import SceneBuilder, fake_scene
from humanclaw.testing.fakes import FAKE, FakeGenerator, Fakes


@pytest.fixture
def walked():
    """Return a function that walks three calls into a wall and gives the body and its last chunk."""
    builder = SceneBuilder()
    builder.floor()
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


def test_the_generated_history_keeps_the_models_poses_and_stands_where_the_body_is(walked):
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

    digest = DiTGenerator.shipped().digest

    def generate(self, history, adapter, values, key):
        return super().generate(history, adapter, values | {"yaw": values["yaw"] + np.radians(2)}, key)


@pytest.mark.parametrize(("profile", "asked"), [("default", [30, 28, 28]), ("paper", [30, 30, 30])])
def test_the_papers_profile_alone_leaves_heading_errors_as_they_are(profile, asked):
    generator, plugins = Veering(), Plugins.discover()

    class Mine:
        @hookimpl
        def humanclaw_motion_generators(self, register):
            register("veering", lambda profile="default": generator)

    plugins.add(Fakes(), FAKE)
    plugins.add(Mine(), "mine")
    with Body(fake_scene(), plugins=plugins, backends=Backends(FAKE, FAKE, "veering", profile)) as body:
        for _ in asked:
            body.call("turn_in_place", yaw_deg=30)
    assert [np.degrees(values["yaw"]) - 2 for _, values in generator.asked] == pytest.approx(asked)


def seated(source):
    """Return the history and the simulated pose of a body that sat down."""
    plugins = Plugins.discover()
    plugins.add(Fakes(), FAKE)
    backends = Backends(FAKE, FAKE, motion_history=source)
    with Body(fake_scene(), plugins=plugins, backends=backends) as body:
        body.execute(Call("sit_in_place", {"h_cm": 54}))
        return body.history, body.state().body


def moves(pose):
    """How far laying the hands flat moves a joint of a pose, metres."""
    return np.abs(lay_hands(pose[-1:]).joints() - pose[-1:].joints()).max()


def test_hands_of_a_seated_body_lie_flat_and_the_model_goes_on_from_its_own():
    history, body = seated("generated")
    assert moves(history) > 0.05
    assert moves(body) < 0.005
    # A model that continues the body's own poses gets no hands that it has never seen.
    history, body = seated("simulated")
    assert moves(history) == pytest.approx(moves(body), abs=1e-6)
    assert moves(body) > 0.05
