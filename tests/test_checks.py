"""Every named check of a skill: a legal skill of each kind passes them all, and for each there is one that fails it."""

import json
import re
import runpy
import shutil
import threading
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Literal

import numpy as np
import pytest
from click.testing import CliRunner
from declared import change_adapter, change_schema, folder_of
from pydantic import Field

from humanclaw import Call, Control, EpisodeSpec, Gaze, Keyframes, Motion, Plugins, Reach, hookimpl, skill
from humanclaw.body import Pose2D
from humanclaw.checks.fakes import Fakes
from humanclaw.cli import build
from humanclaw.errors import CallError
from humanclaw.skills import MotionError, Skill
from humanclaw.skills.checks import CHECKS
from humanclaw.testing import FakeWorld, check_skill, check_target, examine, fake_body

NOD = Keyframes.cycle("head", axis="x", degrees=20, seconds=0.5)
WALK = folder_of("walk") / "adapter.safetensors"


def names(target, **options) -> set[str]:
    return {fault.check for fault in examine(target, engines=(), **options).faults}


@pytest.fixture
def folder(tmp_path):
    """A copy of a legal skill."""
    return shutil.copytree(folder_of("step_back"), tmp_path / "step_back")


# -- legal skills ------------------------------------------------------------------------------------------------------
@skill(checks=["Is anybody in view?"])
def choosing(side: Literal["left", "right"] = "left", twice: bool = False) -> Keyframes:
    """Wave a hand."""
    return Keyframes.cycle(f"{side}_elbow", axis="z", degrees=40, seconds=0.5, times=1 + twice)


@skill()
def listing(
    turns: Annotated[list[Annotated[int, Field(ge=-30, le=30)]], Field(min_length=1, max_length=4)],
) -> Keyframes:
    """Turn the head so many degrees, one after another."""
    keys = tuple((0.0, float(np.radians(turn)), 0.0) for turn in (0, *turns, 0))
    return Keyframes(tuple(0.5 * k for k in range(len(keys))), {"head": keys})


@skill()
def gradual(degrees: Annotated[float, Field(ge=0, le=25.5)] = 10.0) -> Keyframes:
    """Bow by so many degrees."""
    return Keyframes.cycle("spine1", axis="x", degrees=degrees, seconds=1)


@skill(role="locomotion")
def amble(pace: Literal["slow", "brisk"], strides: Annotated[int, Field(ge=1, le=6)] = 2) -> list[Control]:
    """Walk a few strides straight ahead, with the adapter of another skill."""
    return [Control(WALK, {"x": 0.0, "z": 0.3 if pace == "slow" else 0.5, "yaw": 0.0})] * strides


@pytest.mark.parametrize("made", [choosing, listing, gradual, amble], ids=lambda made: made.name)
def test_a_legal_skill_passes_every_check(made):
    report = examine(made, engines=())
    assert (report.faults, report.notes) == ((), ())
    assert report.calls >= 3


def test_an_adapter_that_is_no_better_than_a_constant_is_a_fault(folder):
    def deaf(tensors):
        """Take the command away: what is left of the adapter moves the body by one distance."""
        for name in tensors:
            if ".encode." in name:
                tensors[name] = np.zeros_like(tensors[name])

    weights(deaf)(folder)
    (fault,) = examine(folder, engines=()).faults
    assert fault.check == "follows"
    assert "a constant misses it by" in fault.message


@pytest.mark.integration
def test_an_adapter_may_be_reused_by_who_says_whose_it_is(tmp_path):
    folder = shutil.copytree(folder_of("walk"), tmp_path / "saunter")
    change_schema(folder, lambda schema: schema["properties"]["z_cm"].update(minimum=20, maximum=40))
    assert names(folder) == {"adapter-skill"}
    change_schema(folder, lambda schema: schema.update({"x-adapter": "walk"}))
    assert names(folder) == set()


def test_a_skill_still_to_be_trained_keeps_the_contract(tmp_path):
    folder = shutil.copytree(folder_of("walk"), tmp_path / "walk")
    (folder / "adapter.safetensors").unlink()
    assert names(folder) == {"adapter-there"}
    assert check_skill(folder, engines=()).trained is False
    with pytest.raises(AssertionError, match=r"humanclaw train adapter --skill .*walk"):
        check_skill(folder, engines=(), trained=True)


# -- broken skills -----------------------------------------------------------------------------------------------------
def schema(change):
    return lambda folder: change_schema(folder, change)


def parameter(**words):
    return schema(lambda content: content["properties"]["z_cm"].update(words))


def header(**words):
    return lambda folder: change_adapter(folder, lambda head: head["adapter"].update(words))


def weights(change):
    return lambda folder: change_adapter(folder, weights=change)


def narrow(tensors):
    name = "model.blocks.0.up.weight"
    tensors[name] = tensors[name][:, :-8].copy()


def spoil(tensors):
    tensors["model.blocks.0.up.weight"].flat[3] = np.nan


def text(name, content):
    return lambda folder: (folder / name).write_text(content)


def renamed(name):
    return lambda folder: folder.rename(folder.with_name(name))


TIMES = {"type": "integer", "default": 1}
CHECK = '[[check]]\nid = "{}"\nquestion = "{}"\n'
FOLDERS = {
    "name": renamed("step back"),
    "name-reserved": renamed("reset"),
    "schema-file": text("schema.json", "{"),
    "schema": schema(lambda content: content.update(type="array")),
    "role": schema(lambda content: content.update({"x-role": "dance"})),
    "reasoning-names": schema(lambda content: content["properties"].update(progress={"type": "integer"})),
    "described": schema(lambda content: content.update(description=" ")),
    "parameters-described": schema(lambda content: content["properties"]["z_cm"].pop("description")),
    "bounds-order": parameter(minimum=40, maximum=10),
    "choices": parameter(enum=["a"]),
    "required-declared": schema(lambda content: content["required"].append("speed")),
    "defaults-given": schema(lambda content: content.update(required=[])),
    "defaults-legal": parameter(default=400),
    "checklist-file": text("checklist.toml", "[[check]"),
    "checklist-words": text("checklist.toml", '[[checks]]\nid = "a"\nquestion = "Is it?"\n'),
    "checklist-tables": text("checklist.toml", 'check = ["Is it?"]'),
    "checks-unique": text("checklist.toml", 2 * CHECK.format("a", "Is it?")),
    "checks-named": text("checklist.toml", CHECK.format("", "Is it?")),
    "checks-questions": text("checklist.toml", CHECK.format("a", "maybe")),
    "units": schema(lambda content: content["properties"].update(z=content["properties"].pop("z_cm"))),
    "integers": parameter(type="number"),
    "bounded": schema(lambda content: content["properties"]["z_cm"].pop("maximum")),
    "names-unique": schema(lambda c: c["properties"].update(z_deg={**c["properties"]["z_cm"], "default": 9})),
    "measures-known": parameter(**{"x-measure": "hips.retreat"}),
    "measures-units": parameter(**{"x-measure": "heading.left"}),
    "adapter-there": lambda folder: (folder / "adapter.safetensors").unlink(),
    "adapter-readable": text("adapter.safetensors", "version https://git-lfs.github.com/spec/v1"),
    "adapter-weights": weights(narrow),
    "adapter-header": header(scale=[0]),
    "adapter-skill": header(skill="moonwalk"),
    "adapter-base": lambda folder: change_adapter(folder, lambda head: head.update(base="0123456789abcdef")),
    "adapter-parameters": header(params=["x"]),
    "adapter-measures": header(measures=["hips.forward"]),
    "adapter-bounds": parameter(maximum=90),
}


@pytest.mark.parametrize("check", FOLDERS)
def test_a_folder_that_fails_a_check_is_told_its_name_and_a_remedy(check, tmp_path):
    folder = shutil.copytree(folder_of("step_back"), tmp_path / "step_back")
    FOLDERS[check](folder)
    (folder,) = tmp_path.iterdir()
    report = examine(folder, engines=())
    assert check in {fault.check for fault in report.faults}
    assert all(fault.remedy for fault in report.faults)


MALFORMED = {
    "an unknown type": parameter(type="whole"),
    "several types": parameter(type=["integer", "string"]),
    "no type": parameter(type=None),
    "a reference": parameter(**{"$ref": "other.json"}),
    "alternatives": parameter(anyOf=[{"type": "integer"}]),
    "an object": parameter(type="object", properties={}),
    "a list of lists": parameter(type="array", items={"type": "array", "items": {"type": "integer"}}),
    "a list of anything": parameter(type="array"),
    "a parameter that is no schema": schema(lambda content: content["properties"].update(z_cm=True)),
    "a name that Anthropic refuses": schema(lambda content: content["properties"].update({"wie weit": TIMES})),
    "an empty description": parameter(description=" "),
    "a bound that is not whole": parameter(maximum=40.5),
    "a bound that nobody could write": parameter(maximum=10**400),
    "a number too large for JSON": parameter(minimum=-1e308),
    "a text that nobody could write": parameter(type="string", minLength=10**10),
    "no choice": parameter(enum=[]),
    "a choice that is offered twice": parameter(enum=[10, 20, 10]),
    "other parameters": schema(lambda content: content.pop("additionalProperties")),
    "any parameters": schema(lambda content: content.update(additionalProperties=True)),
    "alternatives for all": schema(lambda content: content.update(oneOf=[{"required": ["z_cm"]}])),
    "a rule that no model is told": schema(lambda content: content.update(minProperties=1)),
    "thousands of parameters": schema(lambda content: content.update(properties={f"p{k}": TIMES for k in range(65)})),
}


@pytest.mark.parametrize("spoil", MALFORMED.values(), ids=MALFORMED)
def test_a_schema_of_another_form_is_a_fault(folder, spoil):
    spoil(folder)
    assert "schema" in names(folder)


def test_a_description_that_is_no_text_is_a_fault(folder):
    change_schema(folder, lambda content: content.update(description=5))
    assert "described" in names(folder)


def test_what_a_strangers_checklist_can_ask_is_bounded(folder):
    (folder / "checklist.toml").write_text("a" + ".a" * 50_000 + " = 1")
    assert "checklist-file" in names(folder)


def planned(plan, properties=None, **more):
    """A skill that plans by a function."""
    content = {"type": "object", "properties": properties or {}, "additionalProperties": False}
    return Skill("made", "Is made.", content | more, plan)


BENT = {"left_knee": ((0.0, 0.0, 0.0), (-0.6, 0.0, 0.0))}
PLANS = {
    "plan-runs": planned(lambda params: params["w"]),
    "plan-kind": planned(lambda params: "walk"),
    "plan-repeats": planned(lambda params, seen=[]: seen.append(1) or Keyframes.cycle("head", "x", len(seen), 1)),
    "duration": planned(lambda params: Keyframes.cycle("head", "x", 5, 0.5, max(1, params["times"])), {"times": TIMES}),
    "control-adapter": planned(lambda params: Control(Path("nowhere.safetensors"), {})),
    "control-values": planned(lambda params: Control(WALK, {"z": 0.4})),
    "control-finite": planned(lambda params: Control(WALK, {"x": 0.0, "z": float("nan"), "yaw": 0.0})),
    "control-range": planned(lambda params: Control(WALK, {"x": 0.0, "z": 40.0, "yaw": 0.0})),
    "keyframes-joints": planned(lambda params: Keyframes.cycle("tail", "x", 5, 1)),
    "keyframes-times": planned(lambda params: Keyframes((0.0, 1.0, 0.5), {"head": ((0.0, 0.0, 0.0),) * 3})),
    "keyframes-finite": planned(lambda params: Keyframes((0.0, 1.0), {"head": ((float("nan"), 0.0, 0.0),) * 2})),
    "joint-limits": planned(lambda params: Keyframes.cycle("neck", "y", 170, 2)),
    "joint-speed": planned(lambda params: Keyframes.cycle("right_shoulder", "x", 170, 0.2)),
    "root-speed": planned(lambda params: Keyframes((0.0, 0.1), {}, root=((0, 0, 0), (0, 0, 5.0)))),
    "upright": planned(lambda params: Keyframes((0.0, 2.0), {"pelvis": ((0, 0, 0), (3.0, 0, 0))})),
    "self-contact": planned(lambda params: Keyframes.cycle("right_shoulder", "z", 60, 1)),
    "parameters-used": planned(
        lambda params: NOD, {"times": {"type": "integer", "minimum": 1, "maximum": 3, "default": 1}}
    ),
    "default-moves": planned(
        lambda params: Keyframes.cycle("head", "x", params["deg"], 1),
        {"deg": {"type": "integer", "minimum": 0, "maximum": 30, "default": 0}},
    ),
    "aim-hand": planned(lambda params: Reach("both", (0.0, 1.0, 0.4))),
    "aim-finite": planned(lambda params: Gaze((0.0, float("nan"), 1.0))),
    "motion-finite": planned(lambda params: Motion(np.zeros((0, 3)), np.zeros((0, 24, 3)))),
    "accepts-bounds": planned(lambda params: NOD, {"word": {"type": "string", "pattern": "^q"}}, required=["word"]),
}


@pytest.mark.parametrize("check", PLANS)
def test_a_plan_that_fails_a_check_is_told_its_name_and_a_remedy(check):
    faults = [fault for fault in examine(PLANS[check], engines=()).faults if fault.check == check]
    assert faults
    assert all(fault.remedy for fault in faults)


class UnspeakableError(Exception):
    """An error that cannot even be told."""

    def __str__(self):
        raise RuntimeError("no words")


def raising(error):
    def plan(params):
        raise error

    return planned(plan)


@pytest.mark.parametrize(
    "error", [SystemExit(0), UnspeakableError(), RecursionError("deep")], ids=lambda e: type(e).__name__
)
def test_a_plan_that_exits_or_raises_anything_is_a_fault(error):
    (fault,) = examine(raising(error), engines=()).faults
    assert fault.check == "plan-runs"
    assert type(error).__name__ in fault.message


def test_a_plan_that_never_returns_is_a_fault_after_a_while():
    free = threading.Event()
    (fault,) = examine(planned(lambda params: free.wait()), engines=(), patience=0.2).faults
    assert (fault.check, "did not return within 0.2 s" in fault.message) == ("plan-runs", True)
    free.set()


class Slow(Keyframes):
    """Keyframes that take for ever to be played."""

    def over(self, pose):
        if threading.current_thread() is not threading.main_thread():
            threading.Event().wait()
        return super().over(pose)


def test_a_motion_that_never_ends_is_a_fault_after_a_while():
    slow = Slow.cycle("head", "x", 5, 0.5)
    (fault, *_) = examine(planned(lambda params: slow), engines=(), playing=0.3).faults
    assert (fault.check, "did not return within 0.3 s" in fault.message) == ("body-plays", True)


def test_a_file_that_never_ends_its_import_is_a_fault_after_a_while(tmp_path):
    (tmp_path / "slow.py").write_text("import threading\nthreading.Event().wait()\n")
    ((fault,),) = (report.faults for report in check_target(str(tmp_path / "slow.py"), Plugins(), loading=0.2))
    assert (fault.check, "did not return within 0.2 s" in fault.message) == ("loads", True)


def whole(tensors):
    tensors["model.blocks.0.up.weight"] = tensors["model.blocks.0.up.weight"].astype(np.uint8)


@pytest.mark.parametrize("change", [spoil, whole])
def test_weights_that_are_no_finite_floats_are_a_fault(folder, change):
    weights(change)(folder)
    assert names(folder) == {"adapter-weights"}


VALUES = {"x": 0.0, "z": 0.4, "yaw": 0.0}


@pytest.mark.parametrize(
    ("adapter", "values", "check"),
    [
        (None, VALUES, "control-adapter"),
        ("walk", VALUES, "control-adapter"),
        (WALK, [0.0, 0.4, 0.0], "control-values"),
        (WALK, VALUES | {"z": "far"}, "control-finite"),
        (WALK, VALUES | {"z": None}, "control-finite"),
        (WALK, VALUES | {"z": 1j}, "control-finite"),
    ],
)
def test_a_control_of_anything_but_a_path_and_numbers_is_a_fault(adapter, values, check):
    report = examine(planned(lambda params: Control(adapter, values)), engines=())
    assert [(fault.check, bool(fault.remedy)) for fault in report.faults] == [(check, True)]


def test_a_control_takes_the_numbers_of_numpy():
    assert names(planned(lambda params: Control(WALK, {k: np.float32(v) for k, v in VALUES.items()}))) == set()


def test_a_schema_that_is_too_deep_to_be_read_is_a_fault_of_its_file(tmp_path):
    folder = shutil.copytree(folder_of("stop"), tmp_path / "stop")
    (folder / "schema.json").write_text('{"a":' * 100_000 + "1" + "}" * 100_000)
    assert names(folder) == {"schema-file"}


REPEATED = {
    "the head is turned further with each call": Keyframes((0.0, 0.5), {"head": ((0, 0, 0), (0, 0.7, 0))}),
    "a spine jumps in a frame": Keyframes((0.0, 0.5, 0.53), {"spine1": ((0, 0, 0), (0, 0, 0), (0, 0.83, 0))}),
}


@pytest.mark.parametrize(
    ("made", "check"), [*zip(REPEATED.values(), ("joint-limits", "joint-speed"), strict=True)], ids=REPEATED
)
def test_a_skill_is_held_to_the_body_over_time_and_the_second_time(made, check):
    assert check in names(planned(lambda params: made))


def test_a_skill_that_raises_its_own_arm_is_not_refused():
    up = Keyframes.cycle("right_shoulder", "z", -60, 1)
    aside = Keyframes((0.5,), {"head": ((0, 0.7, 0),)}, absolute=True)
    assert names(planned(lambda params: [up, aside])) == set()


def test_a_plan_that_fails_only_from_a_walk_is_a_fault():
    def plan(params, body):
        return NOD if body.pose.root[0, 1] > 0.95 else None

    assert names(planned(plan)) == {"body-plays"}


def test_a_knee_does_not_bend_forward():
    assert names(planned(lambda params: Keyframes((0.0, 1.0), BENT))) == {"joint-limits"}


ELSEWHERE = {
    "follows": "test_an_adapter_that_is_no_better_than_a_constant_is_a_fault",
    "loads": "test_a_file_that_raises_is_a_fault_of_the_file",
    "name-free": "test_a_skill_that_no_model_gets_is_a_fault",
    "refuses-unknown": "a schema that is closed refuses it; `schema` finds the others",
    "refuses-types": "JSON Schema refuses it for everybody",
    "refuses-nan": "Skill.check refuses it for everybody: test_no_number_of_a_call_may_be_nan",
    "refuses-beyond": "JSON Schema refuses it for everybody",
    "body-plays": "test_what_only_playing_finds",
    "body-repeats": "test_what_only_playing_finds",
    "engine-plays": "test_what_only_an_engine_finds",
    "engine-finite": "test_what_only_an_engine_finds",
}


def test_every_named_check_has_a_skill_that_fails_it():
    assert FOLDERS.keys() | PLANS.keys() | ELSEWHERE.keys() == CHECKS.keys()
    assert len(CHECKS) >= 40


def test_all_problems_are_told_at_once(tmp_path):
    folder = shutil.copytree(folder_of("step_back"), tmp_path / "reset")
    change_schema(folder, lambda content: content["properties"]["z_cm"].update(maximum=90))
    change_schema(folder, lambda content: content["properties"]["z_cm"].pop("description"))
    text("checklist.toml", '[[checks]]\nid = "a"\n' + CHECK.format("a", "maybe"))(folder)
    change_adapter(folder, lambda head: head.update(base="0123"))
    assert names(folder) == {
        "name-reserved", "parameters-described", "checklist-words", "checks-questions", "adapter-base",
        "adapter-bounds", "adapter-skill",
    }  # fmt: skip
    with pytest.raises(AssertionError, match=r"(?s)checklist-words: .*name-reserved: .*adapter-bounds: "):
        check_skill(folder, engines=())


@pytest.mark.parametrize("odd", [float("nan"), float("inf")])
def test_no_number_of_a_call_may_be_nan(odd):
    with pytest.raises(CallError, match="gradual was not executed: degrees"):
        gradual.check({"degrees": odd})


class Moody:
    """Plans otherwise once it has been planned often: what only playing finds."""

    def __init__(self, often, then):
        self.count, self.often, self.then = 0, often, then

    def __call__(self, params):
        self.count += 1
        return self.then() if self.count > self.often else NOD


def test_what_only_playing_finds():
    assert "body-repeats" in names(planned(Moody(3, lambda: Keyframes.cycle("head", "x", 10, 0.5))))
    assert "body-plays" in names(planned(Moody(3, lambda: 1 / 0)))


class Engine:
    """A simulator that loses the body, or breaks."""

    def __init__(self, fault):
        self.fault = fault

    @hookimpl
    def humanclaw_simulators(self, register):
        fault = self.fault

        class Loses(FakeWorld):
            played = 0

            def execute(self, motion):
                self.played += 1
                if fault == "breaks" or (fault == "tires" and self.played > 3):
                    raise RuntimeError("out of memory")
                if fault == "loses":
                    motion.root[:] = 1e3
                return super().execute(motion)

        register("odd", lambda profile="default": Loses())


@pytest.mark.integration
@pytest.mark.parametrize(
    ("fault", "check"), [("breaks", "engine-plays"), ("tires", "engine-plays"), ("loses", "engine-finite")]
)
def test_what_only_an_engine_finds(fault, check):
    plugins = Plugins()
    plugins.add(Engine(fault), "odd")
    report = examine(choosing, engines=["odd"], plugins=plugins)
    assert [fault.check for fault in report.faults] == [check] * len(report.faults)
    assert report.faults


# -- the doors to the check --------------------------------------------------------------------------------------------
FILE = '''
from humanclaw import Keyframes, hookimpl, skill

@skill()
def nod({arguments}) -> Keyframes:
    """Nod."""
    return Keyframes.cycle("head", axis="x", degrees=20, seconds=0.5, times={times})

@hookimpl
def humanclaw_skills(register):
    register(nod)
'''


@pytest.mark.integration
def test_the_command_line_checks_a_file_a_folder_and_a_name(tmp_path, plugins):
    good, bad = tmp_path / "good.py", tmp_path / "bad.py"
    good.write_text(FILE.format(arguments="", times=1))
    bad.write_text(FILE.format(arguments="times: int = 1", times="times"))
    command = build(lambda: plugins)

    def run(*arguments):
        done = CliRunner().invoke(command, ["check", "--engine", "none", *map(str, arguments)])
        return done.exit_code, done.output

    assert run(good) == (
        0,
        f"ok    nod: 1 call played on a fake body\n1 skill, no fault; {len(CHECKS)} named checks.\n",
    )
    code, output = run(bad, folder_of("stop"), "turn_in_place")
    assert code == 1
    assert "duration: nod(times=1000)" in output
    assert "ok    stop" in output
    assert "ok    turn_in_place" in output
    listed = run("--list")[1].splitlines()
    assert [line.split()[0] for line in listed if not line.startswith(" ")] == list(CHECKS)
    code, output = run(bad, "--json")
    (row,) = json.loads(output)
    assert {fault["check"] for fault in row["faults"]} == {"duration", "keyframes-times"}


@pytest.mark.parametrize(
    ("code", "check"),
    [
        ("1 / 0", "loads"),
        ("import humanclaw", "loads"),
        (FILE.format(arguments="", times=1).replace("nod", "look"), "name-reserved"),
        ("raise SystemExit(0)", "loads"),
        (FILE.format(arguments="", times=1) + "    raise SystemExit(0)", "loads"),
        ('HUMANCLAW_API = "9.0"' + FILE.format(arguments="", times=1), "loads"),
        (FILE.format(arguments="", times=1).replace("@skill()", "@skill"), "loads"),
        (FILE.format(arguments="*times: int", times=1), "loads"),
        (FILE.format(arguments="**times: int", times=1), "loads"),
        (
            FILE.format(arguments="times: Literal[1, 2], /", times=1).replace(
                "\n", "\nfrom typing import Literal\n", 1
            ),
            "loads",
        ),
    ],
)
def test_a_file_that_raises_is_a_fault_of_the_file(tmp_path, plugins, code, check):
    (tmp_path / "odd.py").write_text(code)
    (report,) = check_target(str(tmp_path / "odd.py"), plugins, engines=())
    assert [(fault.check, bool(fault.remedy)) for fault in report.faults] == [(check, True)]


@pytest.mark.parametrize(
    ("old", "new", "check", "message"),
    [
        ("@hookimpl\n", "", "loads", "has humanclaw_skills without @hookimpl"),
        ("    register(nod)", "    pass", "loads", "calls register(...) in no hook"),
        ("nod", "walk", "name-free", "'walk' is already a skill of plugin 'humanclaw-skill-walk'"),
    ],
)
def test_a_skill_that_no_model_gets_is_a_fault(tmp_path, plugins, old, new, check, message):
    (tmp_path / "mine.py").write_text(FILE.format(arguments="", times=1).replace(old, new))
    (report,) = check_target(str(tmp_path / "mine.py"), plugins, engines=())
    assert [(fault.check, message in fault.message) for fault in report.faults] == [(check, True)]


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (((0, 0, 0), (0, -1.4)), r"key 2 of head is \(0, -1\.4\); expected three finite numbers, got 2"),
        ((0.5, 0), "key 1 of head is 0.5; expected three finite numbers, got 1"),
        (0.5, "key 1 of head is 0.5; expected three finite numbers, got 1"),
        (((0, 0, 0), (0, None, 0)), r"key 2 of head is \(0, None, 0\); .*, got 2"),
        (((0, 0, 0), (0, 0, 0, 0)), r"key 2 of head .*, got 4"),
    ],
)
def test_a_key_without_three_numbers_is_told_with_its_place(keys, message):
    with pytest.raises(MotionError, match=message):
        Keyframes((0.0, 0.5), {"head": keys})


@pytest.mark.parametrize("times", [0.5, "0 1", ("0", "1"), None])
def test_times_that_are_no_numbers_in_a_row_are_refused(times):
    with pytest.raises(MotionError, match=rf"times are seconds in a row, .* got {re.escape(repr(times))}"):
        Keyframes(times, {"head": ((0, 0, 0), (0, 0.5, 0))})


def test_times_may_be_an_array():
    assert Keyframes(np.array([0.0, 0.5]), {"head": np.zeros((2, 3))}).seconds == 0.5


def test_degrees_in_place_of_radians_are_suspected():
    with pytest.raises(MotionError, match="head has a key of 20; keys are radians, not degrees"):
        Keyframes((0.0, 2.0, 4.0), {"head": ((0, 0, 0), (0, -20, 0), (0, 0, 0))})
    with pytest.raises(MotionError, match=r"a key of 6\.28; keys are radians, at most 3\.14 but for pelvis"):
        Keyframes((0.0, 2.0, 4.0), {"left_wrist": ((0, 0, 0), (0, -6.28, 0), (0, 0, 0))})
    Keyframes((0.0, 5.0), {"pelvis": ((0, 0, 0), (0, 6.28, 0))})
    with pytest.raises(MotionError, match="head turns by at most 180 degrees; got 200"):
        Keyframes.cycle("head", "x", 200, 1)
    with pytest.raises(ValueError, match="yaw is radians, not degrees; got 90"):
        EpisodeSpec(id="mine", instruction="find it", scene="house:0", start=Pose2D(yaw=90))


def test_a_fault_of_a_parameter_without_bounds_says_which_are_missing():
    deg = {"deg": {"type": "integer", "minimum": 0}}
    bow = planned(lambda params: Keyframes.cycle("spine1", "x", params["deg"], 2), deg, required=["deg"])
    remedies = {fault.remedy for fault in examine(bow, engines=()).faults}
    assert remedies == {"Give bounds: 'deg' has no maximum (le= in Field)."}


def test_a_disabled_skill_can_be_checked_by_its_name(tmp_path):
    folder = shutil.copytree(folder_of("step_back"), tmp_path / "step_back")
    change_schema(folder, lambda content: content["properties"]["z_cm"].update(maximum=90))
    plugins = Plugins()
    plugins.add(Fakes([folder]), "mine")
    for name in ("step_back", "mine:step_back"):
        (report,) = check_target(name, plugins, engines=())
        assert {fault.check for fault in report.faults} == {"adapter-bounds"}


# -- the fakes ---------------------------------------------------------------------------------------------------------
def test_a_fake_generator_goes_where_it_is_told(plugins):
    with fake_body(plugins.skill("walk")) as body:
        body.execute(Call("walk", {"x_cm": 0, "z_cm": 40, "yaw_deg": 90}))
        body.execute(Call("walk", {"x_cm": 10, "z_cm": 0, "yaw_deg": 0}))
        x, _, z = body.state().body.root[-1]
    assert (x, z) == pytest.approx((0.0, 0.3), abs=1e-6)


def test_the_page_of_checks_names_every_one():
    docs = Path(__file__).parents[1] / "docs"
    page = SimpleNamespace(file=SimpleNamespace(src_path="check.md"))
    site = runpy.run_path(str(docs / "_site.py"))
    rendered = site["on_page_markdown"]((docs / "check.md").read_text("utf-8"), page, None, None)
    assert [line for line in rendered.splitlines() if line.startswith("| `")] == [
        f"| `{name}` | {says} |" for name, says in CHECKS.items()
    ]


def test_a_body_calls_either_of_two_skills_of_one_name():
    with fake_body(gradual) as body:
        body.plugins.add(Fakes([replace(choosing, name="gradual")]), "other")
        body.call("gradual", degrees=5.0)
        body.call("other:gradual", side="right", twice=True)
        assert len(body.last.chunks) == 2
        with pytest.raises(CallError):
            body.call("gradual", side="right")
