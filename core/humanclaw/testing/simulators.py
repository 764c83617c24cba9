"""The conformance suite of simulators: a test class for the tests of an engine's plugin to inherit.

from humanclaw.testing import SimulatorConformance

class TestMyEngine(SimulatorConformance):
    simulator = staticmethod(my_factory)
"""

from __future__ import annotations

import numpy as np
import pytest

from humanclaw.body.pose import Pose2D, rest_pose
from humanclaw.body.skeleton import BODY_GROUPS, STANDING_HEIGHT
from humanclaw.checks.motions import gait, glide
from humanclaw.errors import HumanclawError, SceneError
from humanclaw.laws.body import CHECKS
from humanclaw.laws.fixture import Fixture
from humanclaw.testing.object_conformance import ObjectConformance
from humanclaw.testing.speed import reset_times
from humanclaw.world.half_physics.profile import find_profile
from humanclaw.world.scene_builder import SceneBuilder


class SimulatorConformance(ObjectConformance):
    """Tests of a simulator: effects of the world on body and objects, and inputs that it must refuse."""

    def test_the_same_commands_have_the_same_outcome_bit_for_bit(self) -> None:
        builder = SceneBuilder.on_floor()
        builder.box("box", (0.4, 0.4, 0.4), (0, 0, 0.7), movable=True, mass=5.0)
        first, second = (self.play(builder.scene(), gait(3, 0.3)) for _ in range(2))
        assert np.array_equal(first.simulated.root, second.simulated.root)
        assert np.array_equal(first.simulated.rotations, second.simulated.rotations)
        assert first.contacts == second.contacts

    def test_contacts_say_who_touched_what_when_and_where(self) -> None:
        builder = SceneBuilder.on_floor()
        wall = builder.box("wall", (6, 2.5, 0.2), (0, 0, 0.4))
        simulator = self.reset(builder)
        contacts = simulator.execute(glide(0.0, 1.0)).contacts
        assert {frame for contact in contacts for frame in contact.frames} <= set(range(15))
        assert {contact.group for contact in contacts} <= set(BODY_GROUPS)
        feet = [contact for contact in contacts if contact.object_id == 1]
        assert {contact.joint for contact in feet} == {"left_ankle", "right_ankle", "left_foot", "right_foot"}
        assert all(abs(contact.height) < 0.01 for contact in feet)
        assert min(contact.frames[0] for contact in contacts if contact.object_id == wall) == pytest.approx(3, abs=3)

    def test_a_start_inside_something_is_refused_with_a_remedy(self) -> None:
        builder = SceneBuilder.on_floor()
        builder.box("table", (1, 0.8, 1), (2, 0, 0))
        with pytest.raises(SceneError, match=r"does not fit .* inside table 2") as raised:
            self.simulator().reset(builder.scene(), Pose2D(2.0, 0.0, 0.0))
        assert raised.value.remedy

    def test_a_start_without_a_floor_is_refused_with_a_remedy(self) -> None:
        with pytest.raises(SceneError, match="does not stay on its start") as raised:
            self.simulator().reset(SceneBuilder.on_floor().scene(), Pose2D(0.0, 0.0, 0.0, floor=1.0))
        assert raised.value.remedy

    def test_a_start_that_is_no_place_is_refused_and_leaves_no_scene(self) -> None:
        builder, simulator = SceneBuilder.on_floor(), self.simulator()
        with pytest.raises(SceneError, match="does not stay on its start"):
            simulator.reset(builder.scene(), Pose2D(float("nan"), 0.0, 0.0))
        with pytest.raises(HumanclawError, match="holds no scene"):
            simulator.state()
        assert np.isfinite(simulator.reset(builder.scene(), Pose2D(0.0, 0.0, 0.0)).body.root).all()

    def test_a_start_may_lie_on_an_upper_floor_and_face_anywhere(self) -> None:
        builder = SceneBuilder()
        builder.floor(y=2.9)
        state = self.simulator().reset(builder.scene(), Pose2D(1.0, -2.0, 1.5, floor=2.9))
        assert state.body.root[0] == pytest.approx([1.0, 2.9 + STANDING_HEIGHT, -2.0], abs=0.005)
        assert state.body.yaw()[0] == pytest.approx(1.5, abs=0.001)

    def test_numbers_that_are_not_finite_are_refused_and_change_nothing(self) -> None:
        simulator = self.reset(SceneBuilder.on_floor())
        before = simulator.state().body.root
        broken = rest_pose(15)
        broken.root[3, 1] = np.nan
        with pytest.raises(HumanclawError, match="finite"):
            simulator.execute(broken)
        assert np.array_equal(simulator.state().body.root, before)

    def test_an_unknown_profile_is_refused_with_the_known_ones(self) -> None:
        with pytest.raises(HumanclawError, match="default, paper, reference"):
            self.simulator("papper")

    def test_a_simulator_without_a_scene_says_so(self) -> None:
        with pytest.raises(HumanclawError, match="reset"):
            self.simulator().execute(rest_pose(15))

    def test_resetting_keeps_no_memory(self) -> None:
        """Neither boxes nor a hundred other shapes, which an engine may get in another way, leak memory."""
        builder, random = SceneBuilder(), np.random.default_rng(0)
        builder.room()
        for number in range(100):
            hull = random.uniform(0, 0.1, (12, 3)).astype(np.float32)
            builder.solid(f"rock {number}", [hull], (random.uniform(-1.5, 1.5), 3, 1))
        _, memory = reset_times(self.simulator(), builder.scene(), 50)
        # A leak grows at every reset. What else a long process holds grows once: pages made huge, a thread's buffers.
        assert np.diff(memory[9::10]).min() < 0.7

    @pytest.mark.parametrize("check", sorted(CHECKS))
    def test_the_law_holds(self, check: str) -> None:
        """The laws of `humanclaw physics`, on few samples: same code, same bounds."""
        fixture = Fixture(self.simulator, find_profile("default"), samples=2, chunks=60)
        findings = list(CHECKS[check](fixture))
        assert findings
        assert [finding for finding in findings if not finding.holds] == []

    @pytest.mark.parametrize("profile", ["paper", "reference"])
    def test_the_papers_constants_keep_bodies_whole_too(self, profile: str) -> None:
        fixture = Fixture(self.simulator, find_profile(profile), samples=2, chunks=30)
        for check in ("free-space", "walls", "ledge", "wild"):
            assert [finding for finding in CHECKS[check](fixture) if not finding.holds] == []
