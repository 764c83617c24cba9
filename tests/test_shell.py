"""`humanclaw doctor`, and the completion of names in a shell."""

import importlib.metadata
import json
import os
import shutil
import sys
from pathlib import Path

import pytest
from click.shell_completion import ShellComplete
from click.testing import CliRunner

from humanclaw import Plugins
from humanclaw.cli import build

EXAMPLES = Path(__file__).parents[1] / "examples"
YARDS = """
from humanclaw import hookimpl

class Source:
    def __init__(self, *names):
        self.names = lambda: [str(name.lower()) for name in names]

@hookimpl
def humanclaw_scenes(register):
    register("yard", Source("old", "new"))
    register("field", Source("north", None))
"""


@pytest.fixture
def yards(tmp_path):
    """A file of two scene sources: one tells the names of its scenes, the other fails to."""
    file = tmp_path / "yards.py"
    file.write_text(YARDS)
    return str(file)


@pytest.fixture
def completed():
    def completed(*words, begun):
        completion = ShellComplete(build(Plugins.discover), {}, "humanclaw", "_HUMANCLAW_COMPLETE")
        return {item.value for item in completion.get_completions(list(words), begun)}

    return completed


@pytest.mark.parametrize(
    ("words", "begun", "found"),
    [
        (["run", "--agent"], "see", {"seeing"}),
        (["run", "--skills"], "stop,tu", {"stop,turn_in_place"}),
        (["run", "--scene"], "hou", {"house:"}),
        (["run", "--scene"], "house:4", {"house:4", "house:40"}),
        (["run", "--scene"], "house:t", {"house:train-"}),
        (["run", "--scene"], "nowhere:", set()),
        (["bench", "run", "--split"], "val", {"val", "val-400"}),
        (["run", "--plugin", str(EXAMPLES / "nod.py"), "--skills"], "no", {"nod"}),
        (["run", "--plugin", "broken.py", "--skills"], "no", set()),
    ],
)
def test_a_shell_completes_names_of_what_is_installed(completed, words, begun, found):
    assert completed(*words, begun=begun) == found


@pytest.mark.parametrize(("begun", "found"), [("yard:", {"yard:old", "yard:new"}), ("field:", set())])
def test_a_source_of_scenes_tells_the_names_that_a_shell_completes(completed, yards, begun, found):
    assert completed("run", "--plugin", yards, "--scene", begun=begun) == found


@pytest.mark.skipif(os.name == "nt" or not shutil.which("bash"), reason="needs bash and a terminal")
@pytest.mark.parametrize(
    ("typed", "line"),
    [
        ("run --instruction 'é x' --age", "run --instruction 'é x' --agent "),
        ("play no", "play nod.py "),
        ("play side", "play side_step "),
    ],
)
def test_bash_completes_the_word_that_was_begun(typed, line, tmp_path):
    (tmp_path / "nod.py").touch()
    pexpect = pytest.importorskip("pexpect")
    folder = str(Path(sys.executable).parent)
    environment = os.environ | {"PATH": f"{folder}:{os.environ['PATH']}", "PS1": "$ ", "TERM": "dumb", "COLUMNS": "200"}
    shell = pexpect.spawn(
        "bash --norc -i", env=environment, encoding="utf-8", dimensions=(24, 200), timeout=60, cwd=tmp_path
    )
    shell.sendline('eval "$(_HUMANCLAW_COMPLETE=bash_source humanclaw)"; echo rea""dy')
    shell.expect("ready")
    shell.send(f"humanclaw {typed}\t")
    shell.expect_exact(f"humanclaw {line}")
    shell.send("|")
    assert shell.expect_exact(["|", " "]) == 0, "what follows the word is the end of the line"
    shell.close()


def test_play_completes_files_too():
    completion = ShellComplete(build(Plugins.discover), {}, "humanclaw", "_HUMANCLAW_COMPLETE")
    found = {(item.type, item.value) for item in completion.get_completions(["play"], "step")}
    assert found == {("plain", "step_back"), ("file", "step")}


def test_the_doctor_names_what_is_missing_and_the_command_that_installs_it(monkeypatch):
    def version(name, there=importlib.metadata.version):
        if name == "humanclaw-bench":
            raise importlib.metadata.PackageNotFoundError(name)
        return there(name)

    monkeypatch.setattr(importlib.metadata, "version", version)
    done = CliRunner().invoke(build(Plugins.discover), ["doctor", "--json"])
    assert done.exit_code == 0
    rows = {row["what"]: row for row in json.loads(done.output)["rows"]}
    assert "command bench" in rows["humanclaw-bench"]["found"]
    assert rows["humanclaw-bench"]["remedy"].endswith("-e ./plugins/bench")
    assert rows["humanclaw-report"]["remedy"] == ""


def test_the_doctor_fails_where_no_episode_can_be_played(monkeypatch):
    installed = Plugins.discover()
    monkeypatch.setattr(Plugins, "discover", Plugins)
    done = CliRunner().invoke(build(lambda: installed), ["doctor"])
    assert done.exit_code == 1
    assert "scene 'house', renderer 'raster', agent 'oracle' and simulator 'mujoco' are not installed." in done.output
