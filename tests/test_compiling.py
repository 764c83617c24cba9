"""Machine code is kept from process to process, and made anew when anything changed that went into it."""

import gc
import os
import subprocess
import sys

import numba
import pytest

import humanclaw.world.compiling  # noqa: F401  # It listens to numba from then on.

pytestmark = pytest.mark.integration

ELSEWHERE = """
import numpy as np
from humanclaw.world import inlined

FACTOR = {factor}
POINTS = np.array({points})

@inlined
def moved(x):
    return x + {step}
"""
KERNEL = """
from elsewhere import FACTOR, POINTS, moved
from humanclaw.world import compiled

@compiled
def answer(x):
    return FACTOR * _inner(x) + POINTS[0]

@compiled
def _inner(x):
    return moved(x)

print(answer(1.0), sum(answer.stats.cache_misses.values()))
"""


@pytest.fixture
def answer(tmp_path):
    (tmp_path / "kernel.py").write_text(KERNEL)

    def run(factor=2.0, points=(0.0, 1.0), step=1.0):
        (tmp_path / "elsewhere.py").write_text(ELSEWHERE.format(factor=factor, points=list(points), step=step))
        program = [sys.executable, "-B", str(tmp_path / "kernel.py")]
        environ = {**os.environ, "PYTHONPATH": str(tmp_path)}
        result, misses = subprocess.run(program, capture_output=True, text=True, check=True, env=environ).stdout.split()
        return float(result), int(misses)

    return run


def test_machine_code_is_compiled_once_and_kept(answer):
    assert [answer(), answer()] == [(4.0, 1), (4.0, 0)]


@pytest.mark.parametrize(
    ("changed", "new"), [({"factor": 3.0}, 6.0), ({"points": (5.0, 1.0)}, 9.0), ({"step": 2.0}, 6.0)]
)
def test_a_changed_number_array_or_inlined_function_is_taken_in(answer, changed, new):
    assert answer() == (4.0, 1)
    assert answer(**changed) == (new, 1)


def test_garbage_is_collected_as_before_once_compiled():
    before = gc.get_threshold()
    assert numba.njit(lambda x: x)(1) == 1
    assert gc.get_threshold() == before
