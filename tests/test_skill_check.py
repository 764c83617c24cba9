"""The contract of a skill, checked where it is registered: who breaks it is named and disabled, and nobody else is
harmed."""

import importlib
import json
import os
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner
from declared import change_adapter, change_schema, folder_of
from fuzzing import bounded
from hosting import host_of, write_distribution

from humanclaw import Plugins, skill
from humanclaw.cli import build
from humanclaw.errors import PluginError
from humanclaw.skills import Measure, tool_list
from humanclaw.testing import check_skill


@pytest.fixture
def copy(plugins, tmp_path):
    """A copy of an installed skill's folder, to be spoilt: its schema by a function, its adapter's header by
    another."""

    def copied(name, schema=lambda schema: None, head=lambda head: None) -> Path:
        folder = shutil.copytree(plugins.skill(name).adapter.parent, tmp_path / name)
        change_schema(folder, schema)
        change_adapter(folder, head)
        return folder

    return copied


RETREATING = (
    lambda schema: schema["properties"]["z_cm"].update({"x-measure": "hips.retreat"}),
    lambda head: head["adapter"].update(measures=["hips.retreat"]),
)
"""A step back that commands a measure of its own, and an adapter that was trained on it."""


class Odd:
    name, description = "hips.retreat", "Has no unit."


def _disabled(folder, **more) -> str:
    """Why the host disables the skill of a folder, with a sound skill beside it that it keeps."""
    plugins = host_of("pair", skills=[folder, folder_of("stop")], **more)
    assert set(plugins.skills) == {"stop"}
    with pytest.raises(PluginError, match=f"skill '{folder.name}' is disabled"):
        plugins.skill(folder.name)
    return plugins.disabled[folder.name]


@pytest.mark.integration
def test_every_installed_skill_keeps_the_contract(plugins):
    assert plugins.disabled == {}
    for item in plugins.skills.values():
        assert check_skill(item, plugins.measures, engines=()) is item  # skills/*/tests play it on each engine


def test_other_parameters_than_the_adapters_are_named(copy):
    def rename(schema):
        schema["properties"] = {"x_cm": schema["properties"]["z_cm"]}
        schema["required"] = ["x_cm"]

    folder = copy("step_back", rename)
    reason = _disabled(folder)
    assert "the adapter of skill 'step_back' was trained on the parameters z, and its schema.json declares x." in reason
    assert "humanclaw train adapter --skill" in reason


def test_bounds_beyond_what_was_trained_are_refused_with_both_ranges(copy):
    """The header of step_back centres z on 0.24988 m, give or take 0.22263: 3 to 47 cm."""
    folder = copy("step_back", lambda s: s["properties"]["z_cm"].update(maximum=90))
    assert "may be 5 to 90, and its adapter was trained on 3 to 47." in _disabled(folder)


@pytest.mark.parametrize("key", ["centre", "scale"])
@pytest.mark.parametrize("odd", [float("nan"), float("inf"), "wide", None])
def test_a_header_whose_range_is_no_number_is_refused(copy, key, odd):
    folder = copy("step_back", head=lambda head: head["adapter"].update({key: [odd]}))
    reason = _disabled(folder)
    assert "no finite centre and positive scale of z" in reason or "is not the checkpoint of an adapter" in reason
    assert "train adapter --skill" in reason


@pytest.mark.parametrize("odd", [["a"], {"a": 1}, 7, None])
def test_a_measure_that_is_no_name_disables_that_one_skill(copy, odd):
    folder = copy("step_back", lambda s: s["properties"]["z_cm"].update({"x-measure": odd}))
    assert "'z_cm' of skill 'step_back' commands" in _disabled(folder)


def test_whatever_goes_wrong_in_the_check_is_told_as_a_reason(copy):
    """A measure of a plugin may be anything at all, and nobody but the skill that uses it is hurt."""
    folder = copy("step_back", *RETREATING)
    assert "skill 'step_back' cannot be checked: AttributeError" in _disabled(folder, measures=[Odd()])


def test_a_check_that_breaks_is_not_told_where_a_fault_is_found(copy):
    folder = copy("step_back", lambda schema: (RETREATING[0](schema), schema.update(description=" ")), RETREATING[1])
    reason = _disabled(folder, measures=[Odd()])
    assert "has the description ' '" in reason
    assert "cannot be checked" not in reason


def test_a_parameter_of_one_single_value_is_legal(copy):
    folder = copy("step_back", lambda s: s["properties"]["z_cm"].update(minimum=20, maximum=20, default=20))
    assert host_of("pair", skills=[folder, folder_of("stop")]).disabled == {}


def test_one_schema_that_cannot_be_published_hides_no_other_skill(copy):
    folder = copy("step_back", lambda schema: schema["properties"].update(z_cm=True))
    plugins = host_of("pair", skills=[folder, folder_of("stop")])
    assert "properties.z_cm: True is not of type 'object'" in plugins.disabled["step_back"]
    assert [tool["name"] for tool in tool_list(plugins.skills.values(), "mcp")] == ["stop"]


def test_a_measure_that_nobody_knows_is_refused(copy):
    folder = copy("step_back", *RETREATING)
    assert "commands 'hips.retreat'. Set its x-measure to one of: hips.left" in _disabled(folder)
    retreat = Measure("hips.retreat", "m", "Backwards.", 1, lambda root, rotations: -root[:, -1, 2])
    plugins = host_of("retreating", skills=[folder], measures=[retreat])
    assert plugins.skill("step_back").parameters[0].measure == "hips.retreat"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[check]\nid = "a"\nquestion = "Is it?"', "a check is not a table"),
        ('[[check]]\nid = "a"\nquestion = "Is it?"\nwhy = "so"', "a check is not a table"),
        ('[[check]]\nid = "a"', "a check is not a table"),
    ],
)
def test_a_checklist_in_any_other_form_is_refused_with_the_form(copy, text, said):
    folder = copy("step_back")
    (folder / "checklist.toml").write_text(text)
    reason = _disabled(folder)
    assert said in reason
    assert "[[check]], id" in reason


def test_a_named_plugin_file_raises_for_a_skill_that_is_wrong(copy, tmp_path):
    folder = copy("walk", lambda s: s["properties"]["x_cm"].update(default=31))
    file = tmp_path / "mine.py"
    file.write_text(
        f"from pathlib import Path\nfrom humanclaw import hookimpl\n@hookimpl\ndef humanclaw_skills(register):\n"
        f"    register(Path({str(folder)!r}))\n"
    )
    with pytest.raises(PluginError, match=r"mine\.py: the default of 'x_cm'"):
        Plugins.discover([file])


def test_a_text_in_place_of_the_list_of_checks_is_refused():
    with pytest.raises(PluginError, match="Give a list of questions"):
        skill(checks="Is anybody in view?")


def test_the_command_line_lists_a_disabled_skill_and_why(tmp_path, monkeypatch):
    folder = tmp_path / "hop"
    folder.mkdir()
    (folder / "schema.json").write_text(
        '{"description": "Hop.", "type": "object", "properties": {"z_cm": true}, "additionalProperties": false}'
    )
    code = "from pathlib import Path\nfrom humanclaw import hookimpl\n@hookimpl\ndef humanclaw_skills(register):\n"
    write_distribution(tmp_path, "humanclaw-hop", "hc_hop", code + "    register(Path(__file__).parent / 'hop')\n")
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    command = build(Plugins.discover)
    rows = {row["skill"]: row for row in json.loads(CliRunner().invoke(command, ["skills", "--json"]).output)}
    assert rows["hop"]["state"].startswith("disabled: the schema of skill 'hop' is not valid: properties.z_cm:")
    assert rows["walk"]["state"] == "ready (adapter)"
    tools = json.loads(CliRunner().invoke(command, ["tools"]).output)
    assert {tool["function"]["name"] for tool in tools} == set(rows) - {"hop"}


PLANTS = {
    "pipe": os.mkfifo,
    "endless": lambda path: path.symlink_to("/dev/zero"),
    "oversized": lambda path: os.truncate(os.open(path, os.O_CREAT | os.O_WRONLY), 3 << 30),
    "a link to itself": lambda path: path.symlink_to(path.name),
    "brackets": lambda path: path.write_text("a=" * path.name.startswith("check") + "[" * 200_000),
}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes")
@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("name", ["schema.json", "checklist.toml"])
def test_what_a_stranger_left_in_a_skill_folder_is_not_waited_for(copy, name, plant):
    path = copy("stop") / name
    path.unlink()
    PLANTS[plant](path)
    with bounded():
        done = CliRunner().invoke(build(Plugins.discover), ["check", str(path.parent), "--engine", "none"])
    assert (done.exit_code, "fault" in done.output) == (1, True)
