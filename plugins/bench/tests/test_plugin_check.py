"""`humanclaw check` uses a metric once: on the record of an episode."""

import pytest

from humanclaw import Plugins
from humanclaw.testing import check_target

FILE = """
import numpy as np
from humanclaw import hookimpl

@hookimpl(optionalhook=True)
def humanclaw_metrics(register):
    register("{name}", lambda episode: {value}, "mine")
"""


def messages(tmp_path, value, name="mine"):
    path = tmp_path / "mine.py"
    path.write_text(FILE.format(value=value, name=name))
    return [fault.message for report in check_target(str(path), Plugins.discover()) for fault in report.faults]


@pytest.mark.parametrize("value", ["len(episode.steps)", "float('nan')", "np.float32(0.5)", "episode.steps[0].yaw_end"])
def test_a_metric_of_a_number_is_legal(tmp_path, value):
    assert messages(tmp_path, value) == []


@pytest.mark.parametrize(
    ("value", "fault"),
    [
        ("f'{len(episode.steps)} steps'", "it returned '1 steps' and no number"),
        ("None", "it returned None and no number"),
        ("1 / len([one for one in episode.steps if one.status == 'cancelled'])", "division by zero"),
        ("episode.nothing", "nothing"),
    ],
)
def test_a_metric_without_a_number_is_a_fault(tmp_path, value, fault):
    (message,) = messages(tmp_path, value)
    assert fault in message


@pytest.mark.parametrize("name", ["nav", "success", "collisions_legs"])
def test_a_metric_with_a_name_of_the_benchmark_is_a_fault(tmp_path, name):
    (message,) = messages(tmp_path, "1.0", name)
    assert f"metric {name!r} of plugin 'mine' has the name of one of the benchmark's own numbers." in message
