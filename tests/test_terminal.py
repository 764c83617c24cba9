"""Tables on the terminal: every command that prints one fits 80 columns, has --json, and is plain in a pipe."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys

import click
import pytest
from click.testing import CliRunner
from made import record_episode

from humanclaw import HumanclawError, Plugins
from humanclaw.cli import LazyCommand, build, show_markdown
from humanclaw.records import RecordedEpisode, write_record

TABLES = {
    "skills": "",
    "plugins": "",
    "check": "--list",
    "physics": "free-space",
    "bench table": "{a} {b}",
    "bench compare": "{a} {b} --partial",
    "bench rescore": "{a}",
    "bench power": "--split smoke --trials 2",
    "bench counterfactual": None,
    "fidelity": "--skills walk --rollouts 2",
    "naturalness": None,
    "data build": None,
    "data chunks": None,
}
"""Commands that print a table, and how each is asked for a small one; None: it takes minutes, motion capture or models,
and tests beside its plugin hold what it prints."""
ONE = re.compile(
    r"(?<![-\d.,])\b1 (steps|episodes|records|skills|faults|calls|rooms|objects|assets|scenes|runs|bodies)\b"
)


@pytest.fixture(scope="module")
def tree():
    """Every command, by the words that lead to it."""
    commands = {}

    def walk(command, words):
        command = command.load() if isinstance(command, LazyCommand) else command
        if isinstance(command, click.Group):
            context = click.Context(command)
            for name in command.list_commands(context):
                walk(command.get_command(context, name), [*words, name])
        if not isinstance(command, click.Group) or command.invoke_without_command:
            commands[" ".join(words)] = command

    walk(build(Plugins.discover), [])
    return commands


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    """Two runs of one episode."""
    folder = tmp_path_factory.mktemp("runs")
    for run in ("a", "b"):
        record_episode(folder / run / "couch-0")
    return {name: str(folder / name) for name in ("a", "b")}


def asked(words, **environment):
    done = CliRunner(env={"COLUMNS": None, **environment}).invoke(build(Plugins.discover), words)
    assert done.exit_code == 0, f"{words}: {done.output} {done.exception!r}"
    return done.stdout


@pytest.mark.parametrize("name", TABLES)
def test_a_command_that_prints_a_table_offers_json(tree, name):
    if name not in tree:
        pytest.skip(f"{name} is not installed")
    command = tree[name]
    if command.context_settings.get("ignore_unknown_options"):  # It reads its own options.
        text = CliRunner().invoke(build(Plugins.discover), [*name.split(), "--help"]).output
    else:
        text = " ".join(option for parameter in command.params for option in parameter.opts)
    assert "--json" in text


@pytest.mark.parametrize("name", [name for name, words in TABLES.items() if words is not None])
def test_a_table_fits_80_columns_and_is_there_as_json(tree, places, name):
    if name not in tree:
        pytest.skip(f"{name} is not installed")
    words = [*name.split(), *TABLES[name].format(**places).split()]
    try:
        shown = asked(words)
    except HumanclawError as missing:
        pytest.skip(str(missing))
    assert max(map(len, shown.splitlines()), default=0) <= 80
    assert "\x1b" not in shown
    assert not ONE.findall(shown)
    json.loads(asked([*words, "--json"]))


def test_a_wide_markdown_table_comes_in_parts(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "48")
    heads = ["skill", *(f"a long head {k}" for k in range(4))]
    rows = [["walk", *(f"{k}.5 ± 0.1" for k in range(4))], ["turn", *["-"] * 4]]
    text = "\n".join("| " + " | ".join(line) + " |" for line in (heads, ["---"] * 5, *rows))
    show_markdown(f"Before.\n\n{text}\n\nAfter.")
    shown = capsys.readouterr().out
    assert max(map(len, shown.splitlines())) <= 48
    assert shown.count("| skill") == shown.count("| walk") == 2
    assert [f"{k}.5 ± 0.1" in shown for k in range(4)] == [True] * 4
    assert shown.startswith("Before.\n\n")
    assert shown.rstrip().endswith("After.")


def test_a_markdown_table_that_fits_is_printed_as_it_stands(capsys):
    text = "| a | b |\n| --- | --- |\n| 1 | [x] \\| y |"
    show_markdown(text)
    assert capsys.readouterr().out == text + "\n"


HOSTILE = "a\x1b[2K\x1b[1A\x9b31m\u202egnol\rb\x07"


def shown(cwd, *words, **environment):
    command = [sys.executable, "-m", "humanclaw", *map(str, words)]
    done = subprocess.run(command, cwd=cwd, capture_output=True, timeout=300, check=False, env=os.environ | environment)
    return (done.stdout + done.stderr).decode()


@pytest.mark.integration
@pytest.mark.parametrize(
    ("words", "environment"),
    [
        ("verify {}", {}),
        ("submit {} --who x", {}),
        ("compare {} {} --partial", {}),
        ("compare {} {} --partial", {"FORCE_COLOR": "1"}),
        ("table {} --format markdown", {"PYTHONIOENCODING": "ascii"}),
        ("table {} --json", {}),
        ("rescore {}/nothing", {"FORCE_COLOR": "1"}),
    ],
)
def test_no_name_in_a_record_controls_the_terminal(tmp_path, words, environment):
    pytest.importorskip("humanclaw_bench")
    run = tmp_path / HOSTILE
    record_episode(run / "couch-0")
    record = RecordedEpisode(run / "couch-0").record
    write_record(run / "couch-0", record.model_copy(update={"agent": HOSTILE}))
    output = shown(tmp_path, "bench", *words.replace("{}", run.name).split(" "), **environment)
    assert "\\u202egnol" in output
    assert not re.search("[\x00-\x08\x0b-\x1a\x1c-\x1f\x7f-\x9f\u202a-\u202e]|\x1b(?!\\[[0-9;]*m)", output)


@pytest.mark.integration
@pytest.mark.parametrize(
    ("words", "status"),
    [("run --agent nobody", "Loading the plugins"), ("play stop --film none", "Playing (the first")],
)
def test_a_status_is_one_line_and_prints_no_code_for_the_cursor(tmp_path, words, status):
    output = shown(tmp_path, *words.split(), FORCE_COLOR="1", TERM="xterm", COLUMNS="80")
    assert status in output
    assert "\x1b[2K\x1b[1A" not in output
    assert "\\u001b" not in output


TALKING = """
import sys
print("hello from the import\\x1b[0m", end="")
print("\\x1b[0m")
from humanclaw import hookimpl

@hookimpl
def humanclaw_skills(register):
    print("hello from a hook")

@hookimpl
def humanclaw_commands(cli):
    print("hello from the commands")
"""


@pytest.mark.integration
def test_a_plugin_that_prints_while_it_loads_stands_beside_the_answer(tmp_path):
    (tmp_path / "talking.py").write_text(TALKING)
    command = [sys.executable, "-m", "humanclaw", "tools", "--plugin", "talking.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=True)
    assert json.loads(done.stdout)
    assert [line for line in done.stderr.splitlines() if line.startswith("hello")] == [
        "hello from the import\\u001b[0m\x1b[0m", "hello from a hook"
    ]  # fmt: skip


@pytest.mark.integration
def test_who_reads_only_the_first_lines_stops_nothing():
    code = "from humanclaw.cli import Console; c = Console(); [c.print('x' * 9999) for _ in range(50)]; exit(7)"
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.stdout.close()
    assert (process.stderr.read(), process.wait()) == (b"", 7)
