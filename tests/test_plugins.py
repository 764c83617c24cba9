"""The plugin host: what is broken is named and disabled, what is ambiguous is refused, what is misspelt is guessed."""

import importlib.metadata
import json
import os
import subprocess
import sys
import types
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from hosting import host_of, plugin, raising, write_distribution

from humanclaw import Choice, Keyframes, Plugins, skill
from humanclaw.cli import LazyCommand, build
from humanclaw.episodes.recorder import skill_infos
from humanclaw.errors import PluginError, SceneError
from humanclaw.plugins import API_VERSION
from humanclaw.plugins.host import Modules


@skill()
def wave(times: int = 1) -> Keyframes:
    """Wave the right hand."""
    return Keyframes.cycle("right_elbow", axis="z", degrees=40, seconds=0.5, times=times)


def waving(**settings):
    return plugin(skills=[wave], **settings)


@pytest.fixture
def site(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    return tmp_path


def test_a_plugin_that_fails_to_import_is_named_and_disabled(site):
    write_distribution(site, "humanclaw-broken", "hc_broken_import", "import a_module_that_nobody_has")
    info = next(info for info in Plugins.discover().infos if info.name == "humanclaw-broken")
    assert "No module named 'a_module_that_nobody_has'" in info.error
    assert (info.origin, info.version) == ("humanclaw-broken", "1.0")


@pytest.mark.parametrize(
    "code", ["raise SystemExit(0)", "class Out(BaseException): ...\nraise Out()", "raise GeneratorExit", "1 / 0"]
)
def test_no_import_ends_the_program(site, code):
    write_distribution(site, "humanclaw-quits", f"hc_quits_{len(code)}", code)
    plugins = Plugins.discover()
    assert "walk" in plugins.skills
    assert next(info for info in plugins.infos if info.origin == "humanclaw-quits").error


@pytest.mark.parametrize("kind", [SystemExit, GeneratorExit, BaseException, RuntimeError])
def test_no_hook_ends_the_program_and_every_observer_hears(kind, caplog):
    heard = []

    def raises(episode, step):
        raise kind("enough")

    plugins = Plugins()
    with pytest.raises(PluginError, match="plugin 'quits' cannot be used"):
        plugins.add(plugin(skills=raising(kind("enough"))), "quits")
    for name in ("first", "bad", "last"):
        plugins.add(plugin(step=raises if name == "bad" else lambda episode, step: heard.append(step)), name)
    plugins.tell("humanclaw_step", episode=None, step=7, view=None)
    assert heard == [7, 7]
    assert "plugin 'bad' failed at humanclaw_step" in caplog.text


def test_the_user_can_still_interrupt_a_plugin():
    with pytest.raises(KeyboardInterrupt):
        host_of("slow", skills=raising(KeyboardInterrupt))


UNSPEAKABLE = "class Odd(Exception):\n    def __str__(self):\n        raise SystemExit(1)\n\n\nraise Odd()"


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("\n1 / 0", ", line 2 failed to load: ZeroDivisionError"),
        ("raise SystemExit(3)", ", line 1 failed to load: SystemExit: 3"),
        (UNSPEAKABLE, r", line 6 failed to load: Odd\."),
        ("1 +", r" failed to load: SyntaxError: .*line 1"),
        ("import humanclaw as h\nh.Choice(1)\nh.skill([])(print)", r", line 3: argument 'args' of skill 'print' is"),
        (
            "from humanclaw import EpisodeSpec\nEpisodeSpec(id='a', instructions='b', scene='c')",
            r", line 2 failed to load: EpisodeSpec: instructions: there is no such field \(Did you mean instruction",
        ),
        (
            "from humanclaw import EpisodeSpec\nEpisodeSpec(max_step=2, id='a', instruction='b', scene='c')",
            r", line 2 failed to load: EpisodeSpec: max_step: there is no such field \(Did you mean max_steps\?\)\.",
        ),
    ],
)
def test_a_plugin_file_that_fails_names_itself_and_takes_nobody_along(tmp_path, code, message):
    (tmp_path / "bad.py").write_text(code)
    with pytest.raises(PluginError, match=rf"plugin file .*bad\.py{message}"):
        Plugins.discover([tmp_path / "bad.py"])


@pytest.mark.parametrize(
    ("factory", "message"),
    [(7, "is of type int; expected a factory"), (lambda options: sys.exit(4), "gave up: SystemExit: 4")],
)
def test_a_factory_that_is_none_or_exits_is_named(factory, message):
    plugins = host_of("odd", agents=[("seven", factory)])
    with pytest.raises(PluginError, match=f"agent 'seven' of plugin 'odd' {message}"):
        plugins.make("agents", "seven", {})


@pytest.mark.parametrize("name", ["house\n", "", "a/b", "../x", "x" * 65, 7])
def test_a_name_that_could_be_taken_for_another_or_a_path_is_refused(name):
    with pytest.raises(PluginError, match="is not a valid name for a scene"):
        host_of("names", scenes=[(name, lambda argument: None)])


def test_a_run_that_needs_a_broken_plugin_is_told_why(site):
    write_distribution(site, "humanclaw-moon", "hc_moon", "raise RuntimeError('no moon tonight')")
    with pytest.raises(PluginError, match="no moon tonight"):
        Plugins.discover().scene("moon:0")


def test_a_plugin_made_for_another_version_is_disabled(site):
    write_distribution(site, "humanclaw-old", "hc_old", "", requires="humanclaw<0.0.5")
    info = next(info for info in Plugins.discover().infos if info.name == "humanclaw-old")
    assert "needs humanclaw<0.0.5" in info.error


@skill()
def shrug(times: int = 1) -> Keyframes:
    """Shrug the shoulders."""
    return Keyframes.cycle("right_elbow", axis="z", degrees=10, seconds=0.5, times=times)


def rival(own, heard=None, **hooks):
    """A plugin with a skill and an agent of its own beside one of each that another plugin may have."""
    agents = [(name, lambda options: own) for name in ("quiet", own)]
    hooks |= {} if heard is None else {"step": lambda episode, step: heard.append(step)}
    return plugin(skills=[wave, shrug], agents=agents, **hooks)


def test_a_skill_taken_twice_names_both_owners_and_harms_neither():
    plugins = Plugins()
    plugins.add(waving(), "first")
    plugins.add(rival("second"), "second")
    assert {name: plugins.owner(name) for name in plugins.skills} == {"wave": "first", "shrug": "second"}
    assert plugins.skill("wave") is wave
    reason = plugins.infos[-1].duplicates[0]
    assert "skill 'wave' of plugin 'second' is already registered by 'first'. Call it second:wave." in reason
    assert (plugins.disabled, plugins.overridden("wave")) == ({}, ("second",))
    assert plugins.skill("second:wave") is not None


def test_a_factory_taken_twice_names_both_owners_and_harms_neither():
    plugins = Plugins()
    for name in ("first", "second"):
        plugins.add(rival(name), name)
    assert [plugins.make("agents", name, {}) for name in ("quiet", "second", "second:quiet")] == [
        "first", "second", "second",
    ]  # fmt: skip
    assert any(
        "agent 'quiet' of plugin 'second' is already registered by 'first'" in message
        for message in plugins.infos[-1].duplicates
    )


def test_no_name_of_a_distribution_puts_it_before_our_own_skills(site):
    """By the alphabet a walk of aa-stroll went first, wherever it was installed, and the oracle walked no more."""
    code = """
        from humanclaw import Keyframes, hookimpl, skill

        @skill(name="walk")
        def amble() -> Keyframes:
            'Nod.'
            return Keyframes.cycle("head", axis="x", degrees=20, seconds=0.5)

        @hookimpl
        def humanclaw_skills(register):
            register(amble)

        @hookimpl
        def humanclaw_measures(register): ...
    """
    write_distribution(site, "aa-stroll", "hc_aa_stroll", code)
    plugins = Plugins.discover()
    assert plugins.owner("walk") == "humanclaw-skill-walk"
    assert plugins.offered("skills", "aa-stroll:walk").description == "Nod."
    assert Plugins.discover(choice=Choice(skills=("aa-stroll:walk",))).owner("walk") == "aa-stroll"


def test_a_plugin_may_register_one_skill_twice_but_not_two_of_a_name():
    assert host_of("again", skills=[wave, wave]).skill("wave") is wave
    with pytest.raises(PluginError, match=r"'twice' registers two skills named 'wave'\. Rename one of them\."):
        host_of("twice", skills=[wave, replace(shrug, name="wave")])


def test_what_is_registered_without_a_name_is_refused():
    with pytest.raises(
        PluginError, match=r"humanclaw_agents registers <function .* without a name\. Call register\(name"
    ):
        host_of("nameless", agents=[lambda options: None])


def test_two_functions_of_one_name_in_a_plugin_are_named_with_lines():
    def first(episode): ...
    def other(episode): ...  # fmt: skip

    line = first.__code__.co_firstlineno
    with pytest.raises(PluginError) as refused:
        host_of("twice", agents=[("quiet", first), ("quiet", other)])
    assert "two agents named 'quiet'" in str(refused.value)
    for name, number in (("first", line), ("other", line + 1)):
        assert f"{name} ({__file__}, line {number})" in str(refused.value)


def test_an_observer_of_a_plugin_that_fails_hears_nothing():
    plugins, heard = Plugins(), []
    with pytest.raises(PluginError, match="unhashable"):
        plugins.add(rival("fails", heard, scenes=raising(TypeError("unhashable"))), "fails")
    plugins.tell("humanclaw_step", episode=None, step=7, view=None)
    assert (heard, plugins.skills, plugins.infos) == ([], {}, ())


# -- naming and choice -------------------------------------------------------------------------------------------------
BOW = """
from humanclaw import Keyframes, hookimpl, skill


@skill()
def bow() -> Keyframes:
    "{says}"
    return Keyframes.cycle("spine1", axis="x", degrees=30, seconds=1)


@hookimpl
def humanclaw_skills(register):
    register(bow)
"""


def test_a_package_whose_entry_point_is_humanclaw_leaves_the_cli(site):
    write_distribution(site, "zz-bow", "zz_bow", BOW.format(says="Bow."))
    (site / "zz_bow-1.0.dist-info" / "entry_points.txt").write_text("[humanclaw]\nhumanclaw = zz_bow\n")
    plugins = Plugins.discover()
    assert (plugins.owner("bow"), plugins.owner("walk")) == ("zz-bow", "humanclaw-skill-walk")
    assert [info.name for info in plugins.infos if info.error] == []
    done = CliRunner().invoke(build(lambda: plugins), ["skills", "--help"])
    assert done.exit_code == 0, done.output


def test_a_command_of_a_name_that_is_taken_leaves_the_first_there(caplog):
    def commands(cli):
        cli.add_command(click.Command("skills", callback=lambda: click.echo("mine")))
        cli.add_command(click.Command("hats", callback=lambda: click.echo("hats")))

    plugins = Plugins.discover()
    plugins.add(plugin(commands=commands), "runs")
    command = build(lambda: plugins)
    assert CliRunner().invoke(command, ["skills"]).output != "mine\n"
    assert CliRunner().invoke(command, ["hats"]).output == "hats\n"
    assert "command 'skills'" in caplog.text


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("no_such_module:hats", "command 'hats' cannot be loaded from no_such_module:hats: ModuleNotFoundError"),
        ("math:pi", "math:pi is of type float; expected a click command."),
    ],
)
def test_a_command_that_cannot_be_loaded_is_one_sentence(target, message):
    plugins = host_of("hats", commands=lambda cli: cli.add_command(LazyCommand("hats", target, "Wear hats.")))
    command = build(lambda: plugins)
    assert "Wear hats." in CliRunner().invoke(command, ["--help"]).output
    done = CliRunner().invoke(command, ["hats"])
    assert done.exit_code == 2
    assert done.output.startswith(f"error: {message}")


@pytest.fixture
def bows(site):
    """Two distributions with a skill of one name, and a file with a third."""
    for name in ("aa", "bb"):
        write_distribution(site, f"{name}-bow", f"{name}_bow", BOW.format(says=f"Bow as {name}."))
    (site / "mine.py").write_text(BOW.format(says="Bow as I do."))
    return site / "mine.py"


def said(plugins, name="bow"):
    return plugins.skill(name).description


def test_of_equal_names_the_first_is_meant_and_its_owner_names_either(bows):
    plugins = Plugins.discover()
    assert [said(plugins, name) for name in ("bow", "aa-bow:bow", "bb-bow:bow")] == [
        "Bow as aa.", "Bow as aa.", "Bow as bb.",
    ]  # fmt: skip


@pytest.mark.parametrize("left", ["aa-bow", "aa-bow:bow"])
def test_what_is_left_out_gives_way(bows, left):
    assert said(Plugins.discover(choice=Choice(without=(left,)))) == "Bow as bb."


def test_a_plugin_file_can_be_left_out_by_its_name(bows):
    plugins = Plugins.discover([bows], Choice(without=("mine",)))
    assert said(plugins) == "Bow as aa."
    assert plugins.info("mine").error == "left out by --without"


def test_a_skill_left_out_by_name_is_nobodys(bows):
    assert "bow" not in Plugins.discover(choice=Choice(without=("bow",))).skills


def test_only_the_skills_that_are_named_can_be_called_in_their_order(bows):
    plugins = Plugins.discover(choice=Choice(skills=("walk", "bb-bow:bow")))
    assert list(plugins.skills) == ["walk", "bow"]
    assert said(plugins) == "Bow as bb."


def test_a_file_with_a_name_that_is_taken_asks_which_one_is_meant(bows):
    with pytest.raises(PluginError, match="--without aa-bow:bow or --without mine:bow"):
        Plugins.discover([bows])
    assert said(Plugins.discover([bows], Choice(without=("aa-bow", "bb-bow:bow")))) == "Bow as I do."
    assert said(Plugins.discover([bows], Choice(without=("mine:bow",)))) == "Bow as aa."


@pytest.mark.parametrize(
    ("choice", "remedy"),
    [(Choice(without=("nobody",)), "See `humanclaw plugins`"), (Choice(skills=("wlak",)), "Did you mean walk"),
     (Choice(without=("sit",)), "Did you mean sit_in_place"),
     (Choice(without=("oracle",)), "Did you mean humanclaw-scripted:oracle"),
     (Choice(without=("humanclaw-scripted:oracle", "oracle")), "got 'oracle'. See `humanclaw plugins`"),
     (Choice(without=("humanclaw:hips.left",)), "takes the name of a skill")],
)  # fmt: skip
def test_a_choice_that_leaves_out_nothing_is_refused(choice, remedy):
    with pytest.raises(PluginError, match=remedy):
        Plugins.discover(choice=choice)


def test_a_record_says_where_each_skill_is_from_and_what_gave_way(bows):
    choice = Choice(skills=("mine:bow", "walk"))
    plugins = Plugins.discover([bows], choice)
    info = skill_infos(plugins, plugins.skills)["bow"]
    assert (info.owner, info.origin, info.overrides) == ("mine", str(bows), ("aa-bow", "bb-bow"))
    walk = skill_infos(plugins, plugins.skills)["walk"]
    assert (walk.origin, walk.version) == ("humanclaw-skill-walk", importlib.metadata.version("humanclaw"))
    before = info.digest
    bows.write_text(bows.read_text().replace("degrees=30", "degrees=31"))
    other = Plugins.discover([bows], choice)
    again = skill_infos(other, other.skills)["bow"]
    assert again.digest != before


# -- the plugin API ----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("made_for", "said"),
    [("2.0", "Upgrade humanclaw"), ("1.9", "Upgrade humanclaw"), ("0.9", "Upgrade old"),
     ("soon", "expected major.minor")],
)  # fmt: skip
def test_a_plugin_for_another_api_is_refused_with_what_to_upgrade(made_for, said):
    with pytest.raises(PluginError, match=said):
        Plugins().add(waving(HUMANCLAW_API=made_for), "old")


def test_a_plugin_made_for_this_api_is_used():
    plugins = Plugins()
    plugins.add(waving(HUMANCLAW_API=API_VERSION), "waving")
    assert set(plugins.skills) == {"wave"}


def test_a_hook_on_its_way_out_is_told_of_and_still_works():
    specs = types.ModuleType("specs")
    code = (
        "import pluggy\n@pluggy.HookspecMarker('humanclaw')(warn_on_impl=DeprecationWarning('use humanclaw_caps'))\n"
        "def humanclaw_hats(register): ..."
    )
    exec(code, vars(specs))

    plugins = host_of("hats", hookspecs=[specs])
    plugins.add(plugin(hats=[("top", 1)]), "hatter")
    assert plugins.infos[-1].notes == ("use humanclaw_caps",)
    assert [offer.name for offer in plugins.registered("hats")] == ["top"]


def test_a_file_says_how_to_train_its_skill(tmp_path, caplog):
    (tmp_path / "hop").mkdir()
    schema = {"type": "object", "description": "Hop.", "properties": {}, "required": [], "additionalProperties": False}
    (tmp_path / "hop/schema.json").write_text(json.dumps(schema))
    registers = "import pathlib\nfrom humanclaw import hookimpl\n@hookimpl\ndef humanclaw_skills(register):\n"
    (tmp_path / "mine.py").write_text(registers + '    register(pathlib.Path(__file__).parent / "hop")\n')
    Plugins.discover([tmp_path / "mine.py"])
    assert "no model gets this one: skill 'hop' has no trained adapter" in caplog.text
    assert f"Train it with `humanclaw train adapter --skill {tmp_path / 'hop'}`." in caplog.text


def test_a_file_without_a_hook_is_told(tmp_path, caplog):
    (tmp_path / "mine.py").write_text("def wave(): ...")
    Plugins.discover([tmp_path / "mine.py"])
    assert f"plugin file {tmp_path / 'mine.py'} has no hook, so it registers nothing." in caplog.text


def test_a_scene_that_does_not_say_which_is_told_so():
    with pytest.raises(SceneError, match=r"scene 'house' says not which house\. Use house:0 to"):
        Plugins.discover().scene("house")


def test_a_second_plugin_of_one_name_is_refused():
    plugins, heard = Plugins(), []
    plugins.add(rival("first", heard), "same")
    with pytest.raises(PluginError, match="plugin 'same' is already in use"):
        plugins.add(rival("second", heard), "same")
    plugins.tell("humanclaw_step", episode=None, step=7, view=None)
    assert heard == [7]


def test_a_plugin_that_fails_half_way_leaves_nothing_behind():
    def half(register):
        register(wave)
        raise RuntimeError("half-way")

    plugins = Plugins()
    with pytest.raises(PluginError, match="half-way"):
        plugins.add(plugin(skills=half), "half")
    assert plugins.skills == {}


def test_an_unknown_name_suggests_the_nearest(plugins):
    with pytest.raises(PluginError, match=r"there is no skill 'wlak'. Did you mean walk"):
        plugins.skill("wlak")


def test_what_is_registered_must_be_a_skill():
    with pytest.raises(PluginError, match="takes a Skill or a folder; got str"):
        host_of("text", skills=["a text"])


def test_all_packages_of_the_repository_share_one_version():
    names = [dist.name for dist in importlib.metadata.distributions() if (dist.name or "").startswith("humanclaw")]
    versions = {name: importlib.metadata.version(name) for name in names if name not in ("humanclaw-broken",)}
    assert len(versions) >= 9
    assert len(set(versions.values())) == 1, versions


@pytest.mark.parametrize("reader", ["importlib.metadata", "importlib_metadata"])
def test_a_distribution_without_metadata_takes_no_other_down(site, reader):
    """The second one, which litellm brings, takes the place of the first as soon as it is imported."""
    pytest.importorskip(reader)
    write_distribution(site, "humanclaw-half", "hc_half", "from humanclaw import hookimpl")
    (site / "humanclaw_half-1.0.dist-info" / "METADATA").unlink()
    plugins = Plugins.discover()
    assert "walk" in plugins.skills
    assert "cannot be read" in plugins.info("humanclaw-half").error


@pytest.mark.parametrize(
    ("file", "content"),
    [
        ("entry_points.txt", "[humanclaw]\nhc_odd = hc_odd\n".encode("utf-16")),
        ("entry_points.txt", "[humanclaw]\nhc_odd = hc_odd\n".encode("utf-8-sig")),
        ("entry_points.txt", b"[console_scripts]\nno equals sign\n"),
        ("entry_points.txt", b"[humanclaw\nhc_odd = hc_odd\n"),
        ("entry_points.txt", b"# plugins\nhc_odd = hc_odd\n"),
        ("entry_points.txt", b"\0\0\0\0"),
        ("entry_points.txt", b"[HumanCLAW]\nhc_odd = hc_odd\n"),
        ("METADATA", "Metadata-Version: 2.1\nName: acme-odd\nVersion: 1.0\nAuthor: Jäger\n".encode("latin-1")),
    ],
    ids=[
        "entry points in UTF-16",
        "entry points after a mark",
        "malformed entry points",
        "no end of the group",
        "no group",
        "zeros",
        "group in capitals",
        "metadata in Latin-1",
    ],
)
def test_a_distribution_with_unreadable_metadata_is_named(site, file, content, caplog):
    write_distribution(site, "acme-odd", "hc_odd", "")
    (site / "acme_odd-1.0.dist-info" / file).write_bytes(content)
    plugins = Plugins.discover()
    assert "walk" in plugins.skills
    assert "acme_odd-1.0.dist-info cannot be read: " in plugins.info("acme-odd").error
    assert CliRunner().invoke(build(Modules), ["--help"]).exit_code == 0
    assert "plugin 'acme-odd' is left out: " in caplog.text


@pytest.mark.integration
def test_pydantic_does_not_end_a_command_at_entry_points_in_utf16(site):
    write_distribution(site, "acme-odd", "hc_odd", "")
    (site / "acme_odd-1.0.dist-info" / "entry_points.txt").write_text("[humanclaw]\nhc_odd = hc_odd\n", "utf-16")
    path = os.pathsep.join([str(site), *sys.path])
    asked = [sys.executable, "-m", "humanclaw", "play", "--help"]
    result = subprocess.run(asked, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, check=False)
    assert (result.returncode, "plugin 'acme-odd' is left out" in result.stderr) == (0, True)


@pytest.mark.parametrize("value", ["", "hc/odd"])
def test_an_entry_point_that_names_no_module_is_told(site, value):
    write_distribution(site, "acme-odd", "hc_odd", "")
    (site / "acme_odd-1.0.dist-info" / "entry_points.txt").write_text(f"[humanclaw]\nhc_odd = {value}\n")
    assert repr(value) in Plugins.discover().info("acme-odd").error


def test_a_module_that_raises_for_missing_names_is_disabled_by_name(site):
    lazy = "def __getattr__(name):\n    raise RuntimeError(f'lazy {name}')\n"
    write_distribution(site, "humanclaw-lazy", "hc_lazy", lazy)
    plugins = Plugins.discover()
    assert "walk" in plugins.skills
    assert "RuntimeError: lazy" in next(info.error for info in plugins.infos if info.name == "humanclaw-lazy")


def test_a_package_that_is_named_and_installed_is_one_plugin():
    installed = Plugins.discover()
    spec = find_spec("humanclaw_skill_sit")
    named = Plugins.discover([Path(path) for path in spec.submodule_search_locations])
    assert named.infos == installed.infos
