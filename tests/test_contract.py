"""The skill contract: what a skill is, what it refuses, and what it says."""

import json
import math
import shutil
import subprocess
import sys
from importlib.util import find_spec

import numpy as np
import pytest

from humanclaw import Control, Keyframes, Plugins, Skill, skill
from humanclaw.body import FUTURE, rest_pose
from humanclaw.checks.fakes import Fakes
from humanclaw.errors import CallError, PluginError


def nod(times: int = 1) -> Keyframes:
    """Nod the head to agree."""
    return Keyframes.cycle("head", axis="x", degrees=20, seconds=0.5, times=times)


@pytest.mark.integration
def test_importing_humanclaw_loads_no_torch_pybullet_or_litellm():
    probe = "import sys, humanclaw; from humanclaw import Plugins; Plugins.discover(); print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True).stdout.split()
    assert not {"torch", "pybullet", "mujoco", "litellm", "trimesh"} & set(loaded)


@pytest.mark.integration
def test_the_protocols_of_plugins_load_no_heavy_library():
    core = "plugins.agents plugins.hookspecs motion.protocol world.simulator world.view world.half_physics.world"
    others = [f"{package}.hookspecs" for package in ("humanclaw_bench", "humanclaw_report") if find_spec(package)]
    modules = [f"humanclaw.{name}" for name in core.split()] + others
    probe = f"import sys, {', '.join(modules)}; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True).stdout.split()
    heavy = {"PIL", "pydantic", "safetensors", "numba", "torch", "trimesh", "scipy", "mujoco", "pybullet"}
    assert not heavy & set(loaded)


def test_parameters_become_metres_and_radians_without_the_unit(plugins):
    walk = plugins.skill("walk")
    plan = walk.plan(walk.check({"yaw_deg": 30, "z_cm": 40, "x_cm": -5}))
    assert isinstance(plan, Control)
    assert plan.values == pytest.approx({"x": -0.05, "z": 0.4, "yaw": math.pi / 6})


@pytest.mark.parametrize(
    ("params", "hint"),
    [
        ({"z_cm": 81}, "81 is greater than the maximum of 80"),
        ({"z_cm": "40"}, "'40' is not of type 'integer'"),
        ({"z_cm": 40.5}, "40.5 is not of type 'integer'"),
        ({"z_cm": float("nan")}, "nan is not of type 'integer'"),
        ({"z_cm": True}, "True is not of type 'integer'"),
        ({"z_cm": 40, "speed": 3}, "'speed' was unexpected"),
        ({}, "'z_cm' is a required property"),
    ],
)
def test_what_the_schema_refuses_is_explained_to_the_model(plugins, params, hint):
    with pytest.raises(CallError) as fault:
        plugins.skill("walk").check(params)
    assert hint in str(fault.value)
    assert "z_cm: integer 0..80" in str(fault.value)


@pytest.mark.parametrize(("written", "meant"), [(2, 2), (2.0, 2), (-0.0, 0)])
def test_an_integer_is_one_however_a_model_writes_it(written, meant):
    @skill()
    def nod(times: int, sides: list[int]) -> Keyframes:
        """Nod."""
        return Keyframes.cycle("head", "x", 20, 0.5, times)

    checked = nod.check({"times": written, "sides": [written]})
    assert checked == {"times": meant, "sides": [meant]}
    assert [type(value) for value in (checked["times"], *checked["sides"])] == [int, int]


def test_a_function_becomes_a_skill_by_its_signature():
    made = skill(checks=["Is anybody in view?"])(nod)
    assert isinstance(made, Skill)
    assert (made.name, made.description) == ("nod", "Nod the head to agree.")
    assert made.schema["properties"]["times"] == {"type": "integer", "default": 1}
    assert made.checks[0].question == "Is anybody in view?"
    assert made.trained


def test_keyframes_turn_the_joint_and_bring_it_back():
    motion = nod(times=1).over(rest_pose())
    head = motion.rotations[:, 15]
    assert len(motion) == FUTURE
    # Half-way through 0.5 s lies between frames 7 and 8; eased keys are within 0.6 degrees of the peak there.
    assert np.degrees(np.abs(head).max()) == pytest.approx(20, abs=0.6)
    assert head[-1] == pytest.approx(np.zeros(3), abs=1e-9)


def test_keyframes_of_an_unknown_joint_name_the_joints():
    with pytest.raises(ValueError, match=r"unknown joint 'tail' \(the joints are pelvis"):
        Keyframes.cycle("tail", axis="x", degrees=20, seconds=0.5)


def test_an_argument_without_a_type_is_refused():
    with pytest.raises(PluginError, match="has no type"):
        skill()(lambda times: nod(times))


def test_swapping_two_properties_of_a_schema_changes_no_motion(plugins, tmp_path):
    shipped = plugins.skill("walk")
    folder = tmp_path / "walk"
    shutil.copytree(shipped.adapter.parent, folder)
    schema = json.loads((folder / "schema.json").read_text())
    schema["properties"] = {key: schema["properties"][key] for key in ("z_cm", "yaw_deg", "x_cm")}
    (folder / "schema.json").write_text(json.dumps(schema))
    generator = plugins.make("motion_generators", "dit")
    moved = []
    for version in (shipped, Skill.from_folder(folder)):
        plan = version.plan(version.check({"z_cm": 40}))
        moved.append(generator.generate(generator.start(), plan.adapter, plan.values, (0, 0)))
    assert list(Skill.from_folder(folder).check({"z_cm": 40})) == ["z_cm", "yaw_deg", "x_cm"]
    assert moved[0].root[-1, 2] == pytest.approx(0.4, abs=0.05)
    np.testing.assert_array_equal(moved[0].root, moved[1].root)


def test_the_eight_skills_say_what_their_parameters_command(plugins):
    facts = {name: (item.role, {p.name: p.measure for p in item.parameters}) for name, item in plugins.skills.items()}
    assert facts == {
        "walk": ("locomotion", {"x": "hips.left", "z": "hips.forward", "yaw": "heading.left"}),
        "side_step": ("locomotion", {"x": "hips.left"}),
        "step_back": ("locomotion", {"z": "hips.back"}),
        "turn_in_place": ("locomotion", {"yaw": "heading.left"}),
        "climb_upstairs": ("locomotion", {"h": "hips.rise", "d": "hips.forward"}),
        "walk_downstairs": ("locomotion", {"h": "hips.drop", "d": "hips.forward"}),
        "sit_in_place": ("sit", {"h": "hips.height"}),
        "stop": ("stop", {}),
    }


def test_a_skill_made_of_a_function_is_a_gesture():
    assert skill()(nod).role == "gesture"
    assert skill(role="posture")(nod).role == "posture"


@pytest.mark.parametrize(
    ("name", "why"), [("wal k", "does not match"), ("2_steps", "does not match"), ("look", "is taken")]
)
def test_a_name_that_a_provider_or_a_harness_does_not_take_is_refused(name, why):
    plugins = Plugins()
    closed = {"type": "object", "properties": {}, "additionalProperties": False}
    plugins.add(Fakes([Skill(name, "Nod.", closed, lambda params: None)]), "odd")
    assert why in plugins.disabled[name]


@pytest.mark.parametrize("seconds", [1e9, 10.5, float("inf"), float("nan"), -1.0])
def test_keyframes_are_bounded_in_time(seconds):
    with pytest.raises(ValueError, match=r"at most 10 s|must start at 0 and increase"):
        Keyframes((0.0, seconds), {"head": ((0.0, 0.0, 0.0),) * 2})
    with pytest.raises(ValueError, match=r"at most 10 s|more than 0 s|key times"):
        Keyframes.cycle("head", "x", 10, seconds)
    with pytest.raises(ValueError, match=r"at most 10 s|more than 0 s|key times"):
        Keyframes.cycle("head", "x", 10, 0.5, times=10**12)
