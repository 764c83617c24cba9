"""`humanclaw doctor`, and the completion of names in a shell."""

import importlib.metadata
import json
from pathlib import Path

import pytest
from click.shell_completion import ShellComplete
from click.testing import CliRunner

from humanclaw import Plugins
from humanclaw.cli import build

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.fixture
def completed():
    def completed(*words, begun):
        completion = ShellComplete(build(Plugins.discover), {}, "humanclaw", "_HUMANCLAW_COMPLETE")
        return {item.value for item in completion.get_completions(list(words), begun)}

    return completed


@pytest.mark.parametrize(
    ("words", "begun", "found"),
    [
        (["run", "--agent"], "see", {"seeing", "seeing-colour"}),
        (["run", "--skills"], "stop,tu", {"stop,turn_in_place"}),
        (["run", "--scene"], "hou", {"house:"}),
        (["play"], "step", {"step_back"}),
        (["bench", "run", "--split"], "val", {"val", "val-400"}),
        (["run", "--plugin", str(EXAMPLES / "nod.py"), "--skills"], "no", {"nod"}),
        (["run", "--plugin", "broken.py", "--skills"], "no", set()),
    ],
)
def test_a_shell_completes_names_of_what_is_installed(completed, words, begun, found):
    assert completed(*words, begun=begun) == found


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
