"""A third engine is held to what Bullet and MuJoCo are held to: it inherits the suite, and what it gets wrong fails by
name."""

import inspect
import mmap
from dataclasses import replace

import numpy as np
import pytest

from humanclaw.body import Motion
from humanclaw.checks.fakes import FakeWorld
from humanclaw.testing import SimulatorConformance
from humanclaw_mujoco.world import mujoco

SLOW = {"test_resetting_keeps_no_memory", "test_the_law_holds", "test_the_papers_constants_keep_bodies_whole_too"}


class Kinematic(SimulatorConformance):
    """A body that is where it is told to be: no gravity, no contact, no objects."""

    simulator = staticmethod(lambda profile="default": FakeWorld())


def cases(name):
    """The arguments that a test of the suite is to be called with, as its marks have it."""
    marks = getattr(getattr(SimulatorConformance, name), "pytestmark", [])
    if not marks:
        return [{}]
    names, values = marks[0].args
    return [{names: value} if isinstance(names, str) else dict(zip(names, value, strict=True)) for value in values]


def passes(suite, name, arguments):
    try:
        getattr(suite, name)(**arguments)
    except (AssertionError, KeyError, ValueError, pytest.fail.Exception):
        return False
    return True


def test_a_world_without_dynamics_passes_what_needs_none():
    names = [name for name, _ in inspect.getmembers(SimulatorConformance, inspect.isfunction) if name[:5] == "test_"]
    passed = {name: [passes(Kinematic(), name, case) for case in cases(name)] for name in names if name not in SLOW}
    assert len(passed) > 30
    assert {name for name, each in passed.items() if any(each)} == {
        "test_a_start_may_lie_on_an_upper_floor_and_face_anywhere",
        "test_a_wall_does_not_turn_the_body",
        "test_stairs_carry_the_body_up",
        "test_legs_straightened_at_once_lift_the_body_and_do_not_launch_it",
        "test_the_same_commands_have_the_same_outcome_bit_for_bit",
        "test_who_sat_on_a_high_seat_stands_up_on_straight_legs",
    }


@pytest.mark.parametrize(("law", "holds"), [("free-space", True), ("ledge", False), ("wild", False)])
def test_it_is_held_to_the_laws_that_are_printed_as_a_table_too(law, holds):
    assert passes(Kinematic(), "test_the_law_holds", {"check": law}) is holds


class Faulty:
    """MuJoCo, but for what a fault does to each execution."""

    def __init__(self, fault, profile="default"):
        self._world, self._fault = mujoco(profile), fault
        self.reset, self.state, self.close = self._world.reset, self._world.state, self._world.close

    def execute(self, motion):
        return self._fault(self._world.execute(motion))


def _moved(execution, metres):
    return replace(execution, simulated=Motion(execution.simulated.root + metres, execution.simulated.rotations))


FAULTS = {
    "nothing": (lambda done: done, "test_a_push_that_is_handed_on_is_reported"),
    "contacts that are kept to itself": (
        lambda done: replace(done, contacts=()),
        "test_contacts_say_who_touched_what_when_and_where",
    ),
    "pushes that are not handed on": (
        lambda done: replace(done, touches=()),
        "test_a_push_that_is_handed_on_is_reported",
    ),
    "a path for what stands still": (
        lambda done: replace(done, objects={2: np.zeros((15, 7)), 3: np.zeros((15, 7)), **done.objects}),
        "test_only_objects_that_moved_have_a_path",
    ),
    "chance": (
        lambda done: _moved(done, np.random.default_rng().normal(0, 1e-9, 3)),
        "test_the_same_commands_have_the_same_outcome_bit_for_bit",
    ),
    "feet that sink": (
        lambda done: _moved(done, [0, -0.06, 0]),
        "test_walking_on_a_floor_tracks_the_command_and_does_not_sink",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_an_engine_with_one_fault_fails_the_test_that_is_about_it(fault):
    does, name = FAULTS[fault]

    class Third(SimulatorConformance):
        simulator = staticmethod(lambda profile="default": Faulty(does, profile))

    assert passes(Third(), name, {}) is (fault == "nothing")


def test_an_engine_that_keeps_a_megabyte_at_each_reset_leaks():
    kept = []

    def leak():  # Fresh pages: an array may lie where a larger process once held something else.
        kept.append(mmap.mmap(-1, 2**20))
        kept[-1].write(b"x" * 2**20)

    class Leaking(Faulty):
        def __init__(self, profile="default"):
            super().__init__(lambda done: done, profile)
            reset = self.reset
            self.reset = lambda *where: (leak(), reset(*where))[1]

    class Third(SimulatorConformance):
        simulator = staticmethod(Leaking)

    assert not passes(Third(), "test_resetting_keeps_no_memory", {})
