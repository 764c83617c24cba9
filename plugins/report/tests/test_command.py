"""Tests of the commands: listing them loads nothing heavy."""

import subprocess
import sys


def test_being_listed_loads_nothing_that_a_page_needs():
    probe = "import sys, humanclaw_report.command; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True).stdout.split()
    assert not {"scipy", "skimage", "PIL", "humanclaw_report.report"} & set(loaded)
