"""Every snippet of the documentation does what it says; the heavy ones with -m evidence."""

import json
import os
import re
import shlex
import subprocess
import sys
import tomllib
from dataclasses import replace

import click
import pytest
from click.testing import CliRunner
from packaging.requirements import Requirement
from snippets import ROOT, RUN_WHOLE, WAYS, Snippet, pages, snippets
from wheels import distributions

from humanclaw import HumanclawError, Plugins
from humanclaw.cli import LazyCommand, build
from humanclaw.testing import check_skill

ALL = list(snippets())
CODE = [block for block in ALL if block.way != "text"]
NAMES = {tomllib.loads((folder / "pyproject.toml").read_text())["project"]["name"] for folder in distributions()}
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]


@pytest.fixture(scope="session")
def command_line(plugins):
    return build(lambda: plugins)


@pytest.fixture(scope="session")
def folders(tmp_path_factory):
    """Make a folder a page, with what it says to save; what one block writes, the next one may read."""
    made = {page: tmp_path_factory.mktemp("page") for page in {block.page for block in ALL}}
    for block in ALL:
        if block.file:
            (made[block.page] / block.file).write_text(block.code)
    return made


def _words(snippet: Snippet) -> list[list[str]]:
    """The commands of a block, a list of words each; `&&` begins another."""
    lines = [shlex.split(line, comments=True) for line in snippet.code.splitlines()]
    split = [part for words in lines for part in " ".join(map(shlex.quote, words)).split(" '&&' ")]
    return [words for words in map(shlex.split, split) if words]


def _marked(snippet: Snippet):
    marks = pytest.mark.evidence if snippet.way == "slow" else ()
    return pytest.param(snippet, marks=marks, id=str(snippet))


def test_every_block_says_how_it_is_run_and_why_not_always():
    assert len(ALL) > 60
    assert {block.way for block in ALL} <= set(WAYS)
    assert [str(block) for block in ALL if block.way != "always" and len(block.reason) < 10] == []
    read = [path for path in pages() if path.relative_to(ROOT).as_posix() not in RUN_WHOLE]
    fences = sum(len(re.findall(r"^```", path.read_text("utf-8"), re.MULTILINE)) for path in read)
    assert fences == 2 * len(ALL)


@pytest.mark.parametrize("snippet", [_marked(block) for block in CODE if block.language in ("", "bash", "python")])
def test_it_runs(snippet, folders, command_line, plugins, monkeypatch):
    """In the order of the page: a block reads what the one above it has written."""
    monkeypatch.chdir(folders[snippet.page])
    if snippet.language == "python":
        _python_runs(snippet)
    else:
        _commands_exist_and_run(snippet, command_line, plugins, monkeypatch)


@pytest.mark.parametrize("snippet", [block for block in CODE if block.way == "slow"], ids=str)
def test_a_slow_block_has_commands_and_options_that_there_are(snippet, folders, command_line, plugins, monkeypatch):
    test_it_runs(replace(snippet, way="never"), folders, command_line, plugins, monkeypatch)


def _python_runs(snippet):
    code = compile(snippet.code, str(snippet), "exec")
    if snippet.way in ("elsewhere", "never"):
        return
    names = {"__name__": f"snippet_{snippet.line}"}
    exec(code, names)
    if hooks := {name: value for name, value in names.items() if name.startswith("humanclaw_")}:
        _registers(names, hooks)


def _registers(names, hooks):
    """A plugin of a snippet registers, beside the benchmark's, all that it means to."""
    import types

    plugins, plugin = Plugins(), types.ModuleType("snippet")
    plugins.add(__import__("humanclaw_bench"), "bench")
    for name, value in hooks.items():
        if hasattr(value, "humanclaw_impl"):
            setattr(plugin, name, value)
    plugins.add(plugin, "snippet")
    (info,) = (info for info in plugins.infos if info.name == "snippet")
    assert (info.error, dict(info.disabled), info.duplicates) == ("", {}, ())
    for offer in plugins.registered("skills"):
        check_skill(offer.value, plugins.measures, engines=())
    watching = {
        "humanclaw_chunk",
        "humanclaw_step",
        "humanclaw_episode_end",
        "humanclaw_run_end",
        "humanclaw_commands",
        "humanclaw_hookspecs",
    }
    assert info.provides or set(vars(plugin)) & watching


def _commands_exist_and_run(snippet, command_line, plugins, monkeypatch):
    commands = _words(snippet)
    for words in commands:
        try:
            _check(words, command_line)
        except HumanclawError as missing:  # A command of ours that is not installed here: Rerun is large.
            pytest.skip(str(missing))
    if snippet.way in ("elsewhere", "never"):
        return
    if snippet.way == "always":  # What is installed has been looked for already.
        monkeypatch.setattr(Plugins, "discover", lambda *_, **__: plugins)
    for words in commands:
        if words[0] == "humanclaw":
            done = CliRunner().invoke(build(Plugins.discover), words[1:])
            failing = (0, 1) if "run" in words else (0,)  # An episode may fail; a check of ours may not.
            assert done.exit_code in failing, f"{shlex.join(words)}: {done.output} {done.exception!r}"


def _check(words, command_line):
    """A command of ours with options that it has; a distribution that there is; a target of the Makefile."""
    program = words[0].rpartition("/")[2]
    if program == "humanclaw":
        _parse(command_line, words[1:])
    elif program == "pip" and words[1] == "install":
        ours = [Requirement(word) for word in words[2:] if word.startswith("humanclaw")]
        assert {need.name for need in ours} <= NAMES
        assert {extra for need in ours if need.name == "humanclaw" for extra in need.extras} <= set(EXTRAS)
    elif program == "torchrun":
        _check(words[words.index("--no-python") + 1 :], command_line)
    elif program == "make":
        assert re.search(rf"^{words[1]}:", (ROOT / "Makefile").read_text(), re.MULTILINE), words
    else:
        assert program in {"python", "python3", "export", ".", "cd", "pip", "docker", "mkdir", "rerun", "vf-eval"}, (
            words
        )


def _parse(command, words):
    """Parse a command line as click would, without carrying it out."""
    context = click.Context(command, info_name="humanclaw")
    while isinstance(command, click.Group) and not (command.invoke_without_command and not words):
        name, child, words = command.resolve_command(context, list(words))
        child = child.load() if isinstance(child, LazyCommand) else child
        context, command = click.Context(child, parent=context, info_name=name), child
    if not command.context_settings.get("ignore_unknown_options"):
        known = {option for param in command.get_params(context) for option in (*param.opts, *param.secondary_opts)}
        given = {word.partition("=")[0] for word in words if word.startswith("--")}
        assert given <= known, f"{command.name} has no {sorted(given - known)}"


@pytest.mark.parametrize("snippet", [block for block in CODE if block.language in ("json", "toml")], ids=str)
def test_data_can_be_read(snippet):
    assert (json.loads if snippet.language == "json" else tomllib.loads)(snippet.code)


def test_no_block_is_in_another_language():
    assert {block.language for block in CODE} <= {"", "bash", "python", "json", "toml"}


@pytest.mark.integration
def test_every_snippet_passes_mypy_strict(tmp_path):
    """By the settings of `make types`, whose cache spares half a minute. What a snippet calls my_... is untyped."""
    python = [block for block in CODE if block.language == "python" and block.way in ("always", "slow")]
    for block in python:
        (tmp_path / (re.sub(r"\W", "_", str(block)) + ".py")).write_text(block.code)
        for name in re.findall(r"^ *(?:from|import) (my_\w+)", block.code, re.MULTILINE):
            (tmp_path / f"{name}.pyi").write_text("from typing import Any\n\ndef __getattr__(name: str) -> Any: ...\n")
    paths = [
        ROOT / "core",
        tmp_path,
        *(path for part in ("plugins", "skills", "harnesses") for path in (ROOT / part).iterdir()),
    ]
    examples = sorted((ROOT / "examples/hooks").glob("*.py"))
    command = [sys.executable, "-m", "mypy", *sorted(tmp_path.glob("*.py")), *examples]
    environment = os.environ | {"MYPYPATH": os.pathsep.join(map(str, paths))}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert len(python) > 10
