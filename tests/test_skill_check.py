"""The contract of a skill, checked where it is registered: who breaks it is named and disabled, and nobody else is harmed."""

import importlib
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from safetensors.numpy import load_file, save

from humanclaw import Plugins, hookimpl, skill
from humanclaw.cli import build
from humanclaw.errors import PluginError
from humanclaw.measures import Measure
from humanclaw.testing import check_skill
from humanclaw.tools import publish


class Folders:
    """A plugin that registers some folders, and measures."""

    def __init__(self, *folders, measures=()):
        self.folders, self.measures = folders, measures

    @hookimpl
    def humanclaw_skills(self, register):
        for folder in self.folders:
            register(folder)

    @hookimpl
    def humanclaw_measures(self, register):
        for measure in self.measures:
            register(measure)


@pytest.fixture
def copy(plugins, tmp_path):
    """A copy of an installed skill's folder, to be spoilt: its schema by a function, its adapter's header by another."""

    def copied(name, schema=lambda schema: None, head=lambda head: None) -> Path:
        folder = shutil.copytree(plugins.skill(name).adapter.parent, tmp_path / name)
        _rewrite(folder / "schema.json", schema)
        _rewrite_header(folder / "adapter.safetensors", head)
        return folder

    return copied


def _rewrite(path, change):
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))


def _rewrite_header(path, change):
    raw = path.read_bytes()
    length = int.from_bytes(raw[:8], "little")
    content = json.loads(raw[8 : 8 + length])
    head = json.loads(content["__metadata__"]["humanclaw"])
    change(head)
    content["__metadata__"]["humanclaw"] = json.dumps(head)
    text = json.dumps(content).encode()
    path.write_bytes(len(text).to_bytes(8, "little") + text + raw[8 + length :])


def _disabled(folder, **more) -> str:
    """Why the host disables the skill of a folder, with a sound skill beside it that it keeps."""
    plugins = Plugins()
    sound = Plugins.discover().skill("stop").adapter.parent
    plugins.add(Folders(folder, sound, **more), "pair")
    assert set(plugins.skills) == {"stop"}
    with pytest.raises(PluginError, match=f"skill '{folder.name}' is disabled"):
        plugins.skill(folder.name)
    return plugins.disabled[folder.name]


def test_every_installed_skill_keeps_the_contract(plugins):
    assert plugins.disabled == {}
    for one in plugins.skills.values():
        assert check_skill(one, plugins.measures) is one


def test_other_parameters_than_the_adapter_was_trained_on_are_named_with_the_remedy(copy):
    def rename(schema):
        schema["properties"] = {"x_cm": schema["properties"]["z_cm"]}
        schema["required"] = ["x_cm"]

    folder = copy("step_back", rename)
    reason = _disabled(folder)
    assert "the adapter of skill 'step_back' was trained on the parameters z, and its schema.json declares x." in reason
    assert "humanclaw train adapter step_back" in reason


def test_bounds_beyond_what_was_trained_are_refused_with_both_ranges(copy):
    """The header of step_back centres z on 0.24988 m, give or take 0.22263: 3 to 47 cm."""
    folder = copy("step_back", lambda s: s["properties"]["z_cm"].update(maximum=90))
    assert "may be 5 to 90, and its adapter was trained on 3 to 47." in _disabled(folder)


def test_an_adapter_of_another_base_is_refused_with_both_digests(copy):
    folder = copy("stop", head=lambda h: h.update(base="0123456789abcdef"))
    plugins = Plugins()
    plugins.add(Folders(folder), "other-base")
    assert "against base 0123456789abcdef, and this base is 624a8194043e9730." in plugins.disabled["stop"]


def test_an_adapter_of_another_skill_is_refused(copy):
    folder = copy("step_back", head=lambda h: h["adapter"].update(skill="moonwalk"))
    assert "is the adapter of 'moonwalk', not of 'step_back'" in _disabled(folder)


def test_an_adapter_that_was_cut_off_is_refused(copy):
    folder = copy("step_back")
    file = folder / "adapter.safetensors"
    file.write_bytes(file.read_bytes()[:-1000])
    assert "cannot be read as a checkpoint" in _disabled(folder)


def test_a_text_in_place_of_an_adapter_is_refused(copy):
    folder = copy("step_back")
    (folder / "adapter.safetensors").write_text("version https://git-lfs.github.com/spec/v1")
    assert "cannot be read as a checkpoint" in _disabled(folder)


def test_weights_that_are_no_numbers_are_found_by_the_check_and_not_where_a_skill_is_registered(copy):
    folder = copy("step_back")
    file = folder / "adapter.safetensors"
    raw = file.read_bytes()
    metadata = json.loads(raw[8 : 8 + int.from_bytes(raw[:8], "little")])["__metadata__"]
    tensors = load_file(file)
    name = sorted(tensors)[0]
    tensors[name] = np.full_like(tensors[name], np.nan)
    file.write_bytes(save(tensors, metadata))
    plugins = Plugins()
    plugins.add(Folders(folder), "broken-numbers")
    assert set(plugins.skills) == {"step_back"}
    with pytest.raises(AssertionError, match=f"holds NaN or infinity in {name}.*train adapter step_back"):
        check_skill(folder)


def test_a_default_outside_its_bounds_is_refused(copy):
    folder = copy("walk", lambda s: s["properties"]["x_cm"].update(default=31))
    assert "the default of 'x_cm' of skill 'walk' is refused by its own schema: 31 is greater" in _disabled(folder)


def test_a_parameter_that_may_be_left_out_needs_a_default(copy):
    folder = copy("walk", lambda s: s["properties"]["x_cm"].pop("default"))
    assert "'x_cm' of skill 'walk' may be left out and has no default" in _disabled(folder)


def test_a_required_parameter_has_to_be_declared(copy):
    folder = copy("step_back", lambda s: s["required"].append("speed"))
    assert "requires 'speed', which its properties do not declare" in _disabled(folder)


@pytest.mark.parametrize(
    ("odd", "said"),
    [
        (True, "'z_cm' of skill 'step_back' is True"),
        ({"anyOf": [{"type": "integer"}, {"type": "string"}]}, "several types"),
        ({"$ref": "#/$defs/gone"}, "not among its"),
        ({"type": "array", "items": {"type": "object", "properties": {"a": False}}}, "not a type"),
    ],
)
def test_one_schema_that_cannot_be_published_takes_no_other_skill_out_of_the_tools(copy, odd, said):
    folder = copy("step_back", lambda s: s["properties"].update(z_cm=odd))
    plugins = Plugins()
    plugins.add(Folders(folder, Plugins.discover().skill("stop").adapter.parent), "pair")
    assert said in plugins.disabled["step_back"]
    assert [tool["name"] for tool in publish(plugins.skills.values(), "mcp")] == ["stop"]


def test_a_measure_that_nobody_knows_is_refused_and_one_of_the_same_plugin_is_known(copy):
    folder = copy("step_back", lambda s: s["properties"]["z_cm"].update({"x-measure": "hips.retreat"}))
    assert "commands 'hips.retreat'. Set its x-measure to one of: hips.left" in _disabled(folder)
    retreat = Measure("hips.retreat", "m", "Backwards.", 1, lambda root, rotations: -root[:, -1, 2])
    plugins = Plugins()
    plugins.add(Folders(folder, measures=[retreat]), "retreating")
    assert plugins.skill("step_back").parameters[0].measure == "hips.retreat"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[[checks]]\nid = "a"\nquestion = "Is it?"', "it has 'checks'"),
        ('check = ["Is it?"]', "a check is not a table"),
        ('[check]\nid = "a"\nquestion = "Is it?"', "a check is not a table"),
        ('[[check]]\nid = "a"\nquestion = "Is it?"\nwhy = "so"', "a check is not a table"),
        ('[[check]]\nid = "a"', "a check is not a table"),
        ("[[check]", "Expected"),
    ],
)
def test_a_checklist_in_any_other_form_is_refused_with_the_form(copy, text, said):
    folder = copy("step_back")
    (folder / "checklist.toml").write_text(text)
    reason = _disabled(folder)
    assert said in reason
    assert "[[check]], id" in reason


def test_a_skill_whose_schema_is_none_leaves_its_neighbours_alone(copy):
    folder = copy("step_back", lambda s: s.update(type="array"))
    assert "must have type 'object'" in _disabled(folder)


def test_a_plugin_file_asked_for_by_name_raises_for_a_skill_that_breaks_the_contract(copy, tmp_path):
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


def test_the_command_line_lists_a_disabled_skill_and_why_and_offers_the_others(tmp_path, monkeypatch):
    """As an installed distribution: pip leaves a module, and metadata that names it as an entry point."""
    folder = tmp_path / "hop"
    folder.mkdir()
    (folder / "schema.json").write_text('{"type": "object", "properties": {"z_cm": true}}')
    code = "from pathlib import Path\nfrom humanclaw import hookimpl\n@hookimpl\ndef humanclaw_skills(register):\n"
    (tmp_path / "hc_hop.py").write_text(code + "    register(Path(__file__).parent / 'hop')\n")
    info = tmp_path / "humanclaw_hop-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: humanclaw-hop\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[humanclaw]\nhc_hop = hc_hop\n")
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    command = build(Plugins.discover)
    rows = {row["skill"]: row for row in json.loads(CliRunner().invoke(command, ["skills", "--json"]).output)}
    assert rows["hop"]["state"].startswith("disabled: parameter 'z_cm' of skill 'hop' is True")
    assert rows["walk"]["state"] == "ready (adapter)"
    tools = json.loads(CliRunner().invoke(command, ["tools"]).output)
    assert {tool["function"]["name"] for tool in tools} == set(rows) - {"hop"}
