"""Measures of half a second of motion, and the declarations by which a skill names them."""

import numpy as np
import pytest
from declared import INFOS, declaration
from hosting import plugin

from humanclaw import Plugins
from humanclaw.body import rest_pose
from humanclaw.errors import PluginError
from humanclaw.skills import MEASURES, Measure, Regression, Skill, find_suited, outcomes, parameters_of, suited


def _chunk(left=0.0, up=0.0, forward=0.0, yaw=0.0):
    """One canonical chunk that glides from the last history frame, of index 4, to its end."""
    rest, share = rest_pose(20), np.clip(np.arange(20) - 4, 0, None) / 15
    rotations = rest.rotations.copy()
    rotations[:, 0, 1] = yaw * share
    return (rest.root + np.outer(share, [left, up, forward]))[None], rotations[None]


@pytest.mark.parametrize(
    ("name", "moved", "value"),
    [
        ("hips.left", {"left": 0.2}, 0.2),
        ("hips.forward", {"forward": 0.4}, 0.4),
        ("hips.back", {"forward": -0.3}, 0.3),
        ("heading.left", {"yaw": 0.5}, 0.5),
        ("hips.rise", {"up": 0.17}, 0.17),
        ("hips.drop", {"up": -0.17}, 0.17),
    ],
)
def test_a_measure_reads_what_the_body_did(name, moved, value):
    assert MEASURES[name](*_chunk(**moved)) == pytest.approx([value])


def test_the_height_of_the_hips_is_that_above_the_floor():
    root, rotations = _chunk(up=-0.4)
    assert MEASURES["hips.height"](root, rotations) == pytest.approx([rest_pose().root[0, 1] - 0.4])


@pytest.mark.parametrize("name", MEASURES)
def test_left_and_right_exchanged_change_signs_sideways_alone(name):
    moved = {"left": 0.2, "up": 0.1, "forward": 0.3, "yaw": 0.4}
    seen_in_the_mirror = moved | {"left": -0.2, "yaw": -0.4}
    measure = MEASURES[name]
    assert measure(*_chunk(**seen_in_the_mirror)) == pytest.approx(measure.mirror * measure(*_chunk(**moved)))


def test_parameters_are_measured_in_the_order_they_are_asked():
    schema = {"z_cm": {"x-measure": "hips.forward"}, "yaw_deg": {"x-measure": "heading.left"}}
    z, yaw = parameters_of({"properties": schema})
    chunk = _chunk(forward=0.4, yaw=0.5)
    assert outcomes((z, yaw), *chunk)[0] == pytest.approx([0.4, 0.5])
    assert outcomes((yaw, z), *chunk)[0] == pytest.approx([0.5, 0.4])


def test_a_parameter_that_commands_nothing_known_is_told_of_what_is():
    (odd,) = parameters_of({"properties": {"speed": {"x-measure": "hips.speed"}}})
    with pytest.raises(PluginError, match=r"'hips.speed', which nothing here measures.*hips\.forward"):
        outcomes((odd,), *_chunk())


def test_bounds_are_in_metres_and_radians_and_names_lose_their_unit():
    part = {"minimum": -75, "maximum": 90, "x-measure": "heading.left"}
    (yaw,) = parameters_of({"properties": {"yaw_deg": part}})
    assert (yaw.key, yaw.name, yaw.measure) == ("yaw_deg", "yaw", "heading.left")
    assert (yaw.low, yaw.high) == pytest.approx((-5 * np.pi / 12, np.pi / 2))


def test_the_first_parameter_that_a_call_requires_is_the_primary_one():
    schema = {"properties": {"x_cm": {"default": 0}, "z_cm": {}}, "required": ["z_cm"]}
    assert Skill.of_schema("stroll", schema).primary.name == "z"
    assert Skill.of_schema("wave", {"properties": {}}).primary is None


UP = Measure("root.up", "m", "How high the root is.", 1, lambda root, rotations: root[:, -1, 1])


def test_a_plugin_adds_a_measure_and_no_two_share_a_name():
    plugins = Plugins.discover()
    plugins.add(plugin(measures=[UP]), "reaching")
    assert plugins.measures["root.up"](*_chunk(up=0.1)) == pytest.approx([rest_pose().root[0, 1] + 0.1])
    assert set(MEASURES) < set(plugins.measures)
    plugins.add(plugin(measures=[UP]), "another")
    (message,) = plugins.infos[-1].duplicates
    assert message.startswith("measure 'root.up' of plugin 'another' is already registered by 'reaching'.")


def test_a_stair_is_suited_to_going_up_and_not_to_going_ahead():
    shipped = [declaration(name) for name in INFOS]
    assert suited(shipped, "hips.forward").name == "walk"
    assert suited(shipped, "hips.rise", "hips.forward").name == "climb_upstairs"
    assert suited(shipped, "hips.forward", "hips.drop").name == "walk_downstairs"
    with pytest.raises(PluginError, match=r"needs a skill of role locomotion that commands arms\.flapped"):
        find_suited(shipped, "arms.flapped")
    assert suited([skill for skill in shipped if skill.climbs], "hips.forward") is None


def test_following_is_held_against_the_median_of_the_commands():
    """The median of 0, 0, 0 and 4 is 0 and misses by 1 in the mean; their mean 1 would miss by 1.5."""
    commanded = np.array([0.0, 0.0, 0.0, 4.0])
    fit = Regression.of(commanded, commanded + 1.25)
    assert fit == Regression(slope=1.0, r2=1.0, error=1.25, constant=1.0)
    assert not fit.follows
