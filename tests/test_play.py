"""`humanclaw play`: one skill, at once, without an agent."""

import json

import pytest
from click.testing import CliRunner

from humanclaw import Plugins
from humanclaw.cli import build
from humanclaw.records import RecordedEpisode

NOD = '''
from humanclaw import Keyframes, hookimpl, skill

@skill()
def nod(times: int = 1, degrees: int = 20) -> Keyframes:
    """Nod."""
    return Keyframes.cycle("head", axis="x", degrees=degrees, seconds=0.5, times=times)

@skill()
def bow() -> Keyframes:
    """Bow."""
    return Keyframes.cycle("spine1", axis="x", degrees=20, seconds=0.5)

@hookimpl
def humanclaw_skills(register):
    register(nod)
'''


@pytest.fixture
def play(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "nod.py").write_text(NOD)
    (tmp_path / "both.py").write_text(NOD + "    register(bow)\n")
    for name, schema in {"skip": {}, "hop": {"required": [], "additionalProperties": False}}.items():
        (tmp_path / name).mkdir()
        schema = {"type": "object", "description": "Hop once.", "properties": {}} | schema
        (tmp_path / name / "schema.json").write_text(json.dumps(schema))

    def play(*words):
        words = ["play", *words, "--film", "none", "--out", "run"]
        return CliRunner().invoke(build(Plugins.discover), words)

    return play


def steps(tmp_path, name):
    return RecordedEpisode(tmp_path / "run" / f"{name}-0").steps


def test_a_file_is_played_with_its_parameters_and_reported(play, tmp_path):
    done = play("nod.py", "times=2", "degrees=-15", "--calls", "2")
    assert done.exit_code == 0, done.output
    assert [str(step.call) for step in steps(tmp_path, "nod")] == ["nod(times=2, degrees=-15)"] * 2
    page = (tmp_path / "run/report.html").read_text()
    assert '"camera": [0.52' in page, "the replay shows the face, as the film does"
    assert "The walked path" not in page, "an empty floor has no map"
    assert "Executed nod(times=2, degrees=-15)." in done.output


def test_a_file_is_played_where_a_plugin_has_a_skill_of_that_name(play, tmp_path):
    done = play("nod.py", "--plugin", "both.py")
    assert done.exit_code == 0, done.output
    assert RecordedEpisode(tmp_path / "run/nod-0").record.skills["nod"].origin == "nod.py"


@pytest.mark.parametrize(("beginning", "first"), [("walking", ["walk", "walk"]), ("sitting", ["sit_in_place"])])
def test_a_skill_is_played_from_a_walk_or_a_seat(play, tmp_path, beginning, first):
    assert play("turn_in_place", "yaw_deg=20", "--from", beginning).exit_code == 0
    assert [step.call.skill for step in steps(tmp_path, "turn_in_place")] == [*first, "turn_in_place"]


def test_of_several_skills_one_is_named(play, tmp_path):
    assert "Name --skill NAME: nod, bow." in play("both.py").output
    assert play("both.py", "--skill", "bow").exit_code == 0
    assert len(steps(tmp_path, "bow")) == 1


@pytest.mark.parametrize(
    ("words", "scene"),
    [
        (["sit_in_place", "h_cm=50"], "floor:sit=0.5"),
        (["climb_upstairs", "h_cm=18", "d_cm=28", "--calls", "2"], "floor:up=0.18,0.28,2"),
        (["step_back", "z_cm=30", "--calls", "2"], "floor:wall=1.1"),
        (["side_step", "x_cm=20"], "floor"),
        (["side_step", "x_cm=20", "--scene", "floor:side=9"], "floor:side=9"),
    ],
)
def test_the_floor_has_what_the_call_needs(play, tmp_path, words, scene):
    done = play(*words)
    assert done.exit_code == 0, done.output
    record = RecordedEpisode(tmp_path / "run" / f"{words[0]}-0").record
    assert record.spec.scene == scene
    assert Plugins.discover().scene(scene).digest == record.scene_digest


def test_what_is_sat_on_and_climbed_carries_the_body(play):
    assert "touched your hips" in play("sit_in_place", "h_cm=50").output
    assert "17 cm up" in play("climb_upstairs", "h_cm=17", "d_cm=28").output.partition("Actual")[2]


def test_twenty_of_the_longest_strides_stay_on_the_floor(play, tmp_path):
    play("walk", "x_cm=0", "z_cm=80", "yaw_deg=0", "--calls", "20")
    root = RecordedEpisode(tmp_path / "run/walk-0").motion().root
    assert root[-1, 2] > 15
    assert root[:, 1].min() > 0.8


def test_a_command_that_is_repeated_gets_the_next_number(play, tmp_path):
    for _ in range(2):
        assert play("nod.py").exit_code == 0
    assert sorted(path.name for path in (tmp_path / "run").glob("nod*")) == ["nod-0", "nod-0-2"]


@pytest.mark.parametrize("argument", ["ups=1", "up=0.18,0.28", "sit=high", "wall=-1", "up=0.1,0.3,1e9", "side=nan"])
def test_a_floor_with_something_unknown_is_refused(play, argument):
    done = play("nod.py", "--scene", f"floor:{argument}")
    assert done.exit_code == 2
    assert "sit=HIPS" in done.output


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nod.py", "degree=3"], "Did you mean degrees?"),
        (["nod.py", "--force"], "`humanclaw play --help` lists the options."),
        (["nod.py", "3"], "expected PARAMETER=VALUE"),
        (["nod.py", "--times", "2"], "Write times=VALUE."),
        (["nod.py", "degrees=far"], "'far' is not of type 'integer'"),
        (["quark"], "there is no skill 'quark'"),
        (["nodd"], "Did you mean nod.py?"),
        (["nod.txt"], "there is no plugin file nod.txt"),
        (["nod.py", "--skills", "walk"], "--skills leaves out nod"),
        (["hop"], "Train it with `humanclaw train adapter --skill hop`."),
        (["skip"], "the schema of skill 'skip' is not valid: 'additionalProperties' is a required property"),
    ],
)
def test_what_cannot_be_played_is_told_before_anything_moves(play, tmp_path, words, message):
    done = play(*words)
    assert done.exit_code == 2
    assert message in done.output
    assert not (tmp_path / "run").exists()
