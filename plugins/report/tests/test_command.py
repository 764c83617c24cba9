"""Tests of the commands: listing them loads nothing heavy."""

import subprocess
import sys

import pytest
from click.testing import CliRunner

from humanclaw import Plugins
from humanclaw.cli import build


@pytest.mark.integration
def test_being_listed_loads_nothing_that_a_page_needs():
    probe = "import sys, humanclaw_report.command; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True).stdout.split()
    assert not {"scipy", "skimage", "PIL", "humanclaw_report.report"} & set(loaded)


def test_a_folder_of_runs_is_told_with_the_last_of_them(tmp_path):
    for run in "ab":
        (tmp_path / run / "couch-0").mkdir(parents=True)
        (tmp_path / run / "couch-0" / "episode.json").touch()
    done = CliRunner().invoke(build(Plugins.discover), ["watch", str(tmp_path)])
    assert (done.exit_code, f"Name one, such as {tmp_path / 'b'}." in done.output) == (2, True)


def test_a_run_that_is_not_there_is_told_with_what_to_do():
    done = CliRunner().invoke(build(Plugins.discover), ["watch", "nowhere"])
    assert done.exit_code == 2
    assert "expected the folder of a run; nowhere is no folder." in done.output
    assert "humanclaw run --out FOLDER" in done.output
