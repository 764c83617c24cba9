"""The documentation is whole: it tells of every hook, command, option and field of a record."""

import ast
import posixpath
import re
import runpy
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner

import humanclaw_bench.hookspecs
from humanclaw import Plugins
from humanclaw.body import JOINT_INDEX, rest_pose
from humanclaw.cli import LazyCommand, build
from humanclaw.plugins import hookspecs
from humanclaw.plugins.host import PREFIX, load_file
from humanclaw.records import instruction, read_episodes
from humanclaw.world import find_profile
from humanclaw_bench.splits import DATA

ROOT = Path(__file__).parents[1]
HOOKS = {
    name: module
    for module in (hookspecs, humanclaw_bench.hookspecs)
    for name, value in vars(module).items()
    if name.startswith(PREFIX) and callable(value)
}
PAGE = (ROOT / "docs" / "hooks.md").read_text("utf-8")
EXAMPLES = {
    hook: ROOT / path
    for hooks, path in re.findall(r"^\* ((?:`humanclaw_\w+`(?:, )?)+): `(.*)`$", PAGE, re.MULTILINE)
    for hook in re.findall(r"\w+", hooks)
}
"""The file that the page of hooks names for each hook."""


def test_the_page_of_hooks_has_those_that_there_are():
    assert set(EXAMPLES) == set(HOOKS)


@pytest.mark.parametrize("hook", HOOKS)
def test_a_hook_has_a_text_and_an_example_that_implements_it(hook):
    assert len(vars(HOOKS[hook])[hook].__doc__.split()) >= 4
    assert f"def {hook}(" in EXAMPLES[hook].read_text("utf-8")


def _commands(command, words):
    if not isinstance(command, click.Group):
        yield words, command
        return
    if command.invoke_without_command:
        yield words, command
    context = click.Context(command, info_name=words)
    for name in command.list_commands(context):
        child = command.get_command(context, name)
        yield from _commands(child.load() if isinstance(child, LazyCommand) else child, f"{words} {name}")


def test_the_page_of_commands_lists_those_that_the_help_lists():
    text = CliRunner(env={"COLUMNS": "110"}).invoke(build(Plugins.discover), ["--help"]).output
    page = (ROOT / "docs" / "commands.md").read_text("utf-8")
    assert f"```text\n{text[text.index('Commands:') :].rstrip()}\n```" in page


def test_a_command_that_is_listed_unloaded_is_told_in_its_own_words(plugins):
    commands = build(lambda: plugins)
    context = click.Context(commands)
    listed = [commands.get_command(context, name) for name in commands.list_commands(context)]
    lazy = [entry for entry in listed if isinstance(entry, LazyCommand)]
    assert len(lazy) > 10
    for entry in lazy:
        command = entry.load()
        assert command.name == entry.name
        assert " ".join(command.help.split()).startswith(entry.help.rstrip("."))


def test_every_command_and_every_option_says_what_it_is_for(plugins):
    commands = list(_commands(build(lambda: plugins), "humanclaw"))
    assert len(commands) > 20
    silent = [words for words, command in commands if not command.help]
    silent += [
        f"{words} {option.opts[0]}"
        for words, command in commands
        for option in command.params
        if isinstance(option, click.Option) and not option.help and not isinstance(option.type, click.Choice)
    ]
    assert silent == []


RECORDS = (
    "records/specification.py", "records/decisions.py", "records/feedback.py", "records/steps.py", "skills/call.py",
    "world/simulator.py",
)  # fmt: skip
KEPT = {
    "Answer", "Attempt", "Call", "Contact", "Decision", "Difficulty", "Displacement", "EpisodeRecord", "EpisodeSpec",
    "Proprioception", "Refusal", "SkillInfo", "StepRecord", "Touch", "Usage", "Verdict",
}  # fmt: skip


def _fields():
    """(record, field, whether the code says beside it what it is) of every field of every record."""
    for name in RECORDS:
        for node in ast.walk(ast.parse((ROOT / "core" / "humanclaw" / name).read_text("utf-8"))):
            if isinstance(node, ast.ClassDef) and node.name in KEPT:
                for part, after in zip(node.body, [*node.body[1:], None], strict=True):
                    if isinstance(part, ast.AnnAssign) and not part.target.id.startswith("_"):
                        yield node.name, part.target.id, isinstance(after, ast.Expr)


def test_every_field_of_a_record_is_told_of():
    page = (ROOT / "docs" / "records.md").read_text("utf-8")
    rows = " ".join(re.findall(r"^\* (`.*?): ", page, re.MULTILINE))
    fields = list(_fields())
    assert {record for record, _, _ in fields} == KEPT
    assert [f"{record}.{name}" for record, name, about in fields if not about and f"`{name}`" not in rows] == []


def test_the_site_has_a_page_for_every_link_into_the_repository():
    site = runpy.run_path(str(ROOT / "docs" / "_site.py"))
    written = [path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")]
    for name in written:
        text = site["documented"]((ROOT / "docs" / name).read_text("utf-8"))
        linked = site["relinked"](text, f"docs/{name}", name)
        assert linked.count("](") == text.count("]("), name
        for target in re.findall(r"(?<!!)\[[^\]]+\]\((?!https?://|#)([^)#\s]+)", linked):
            page = posixpath.normpath(posixpath.join(posixpath.dirname(name), target))
            assert page in {*written, *site["pages"]().values(), "packages.md"}, f"{name}: {target}"


def test_a_name_that_the_site_explains_is_defined_in_the_linked_file():
    text = "".join(path.read_text("utf-8") for path in (ROOT / "docs").glob("*.md"))
    links = re.findall(r"^\* \[(humanclaw[\w.]+)\]\(\.\./(\S+)\.py\)$", text, re.MULTILINE)
    assert len(links) > 50
    for name, path in links:
        module = re.search(r"humanclaw.*", path).group().replace("/", ".")
        code, thing = (ROOT / f"{path}.py").read_text("utf-8"), name.removeprefix(module)[1:]
        assert not thing or re.search(rf"^(?:class|def) {thing}\b", code, re.MULTILINE), name


def test_the_arm_that_points_ahead_on_the_page_of_skills_does_so():
    page = (ROOT / "docs" / "howto" / "skills.md").read_text("utf-8")
    names = {}
    exec(re.search(r"```python\n(.*?)```", page, re.DOTALL).group(1), names)
    joints = names["point"].plan({}).over(rest_pose(1)).joints()
    reach = joints[20, JOINT_INDEX["left_hand"]] - joints[20, JOINT_INDEX["left_shoulder"]]
    assert reach[2] > 0.5
    assert np.abs(reach[:2]).max() < 0.2


def test_the_examples_of_hooks_are_found_together():
    plugins = Plugins.discover(sorted((ROOT / "examples/hooks").glob("*.py")))
    lines = []
    plugins.tell("humanclaw_run_end", run=Path("runs/x"), episodes=(), plugins=plugins, tell=lines.append)
    assert "0 records in runs/x" in lines
    kinds = {"verifiers": "careful", "faults": "sleeper", "reports": "lines", "scenes": "yard", "rewards": "haste"}
    for kind, name in (kinds | {"tasks": "corridor", "splits": "turned_round"}).items():
        assert name in [offer.name for offer in plugins.registered(kind)]
    assert plugins.scene("yard:x").name == "yard:x"
    assert "hello" in build(lambda: plugins).list_commands(click.Context(click.Command("humanclaw")))
    assert load_file(ROOT / "examples/hooks/verifiers.py").Careful.name == "careful"


def test_the_picture_of_the_architecture_is_that_of_the_code():
    script = ROOT / "docs" / "_architecture.py"
    drawn = runpy.run_path(str(script))["picture"]()
    assert drawn == (ROOT / "docs" / "images" / "architecture.svg").read_text("utf-8"), "Run `make architecture`."


PAPER = (ROOT / "docs" / "paper.md").read_text("utf-8")
ITEMS = (ROOT / "docs" / "paper-items.md").read_text("utf-8")
SWITCHES = re.findall(r"`(humanclaw [^`]+)`", f"{PAPER}\n{ITEMS}")


def test_the_differences_from_the_paper_are_those_of_the_code(plugins):
    """Limits of the body in motion, the task of the navigation subset, seats of mini, and the checks of stairs."""
    body, mini = find_profile("paper"), read_episodes(DATA / "mini.jsonl")
    limits = (body.push_force, body.max_speed, body.max_lift, body.max_fall, body.max_link_speed)
    assert "{:g} N; at most {:g} m/s over the floor, {:g} up, {:g} down, limbs {:g}".format(*limits) in PAPER
    assert f"{np.degrees(body.max_turn):.0f} degrees a frame" in PAPER
    assert f"`{instruction('chair')}`" in PAPER
    assert f"{sum(spec.interact for spec in mini)} of the 100 episodes of `mini`" in PAPER
    stairs = [plugins.skills[name].checks[0].question for name in ("climb_upstairs", "walk_downstairs")]
    assert all("in front of the feet" in words for words in (*stairs, PAPER))


@pytest.mark.parametrize("switch", sorted(set(SWITCHES)))
def test_a_switch_that_brings_the_papers_way_exists(plugins, switch):
    """Its command is there, and its help knows the option and, of a choice, the value."""
    words = switch.split()[1:]
    place = next((k for k, word in enumerate(words) if word.startswith("--")), len(words))
    done = CliRunner(env={"COLUMNS": "200"}).invoke(build(lambda: plugins), [*words[:place], "--help"])
    shown = re.sub(r"\s+", " ", done.output)
    assert done.exit_code == 0
    for word in words[place:]:
        if word.startswith("--") or not word.isupper():
            assert word in shown
