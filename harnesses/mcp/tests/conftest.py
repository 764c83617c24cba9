"""Fixtures: a server with real skills and a real house, and official clients."""

from __future__ import annotations

import sys

import pytest

from humanclaw_mcp.bodies import Bodies
from humanclaw_mcp.session import Settings


@pytest.fixture(scope="module")
def anyio_backend():
    return "asyncio"


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    return tmp_path_factory.mktemp("records")


@pytest.fixture(scope="module")
def bodies(records):
    return Bodies(Settings(max_steps=5, out=records))


FAKES = """
print("stray words")
from humanclaw.checks.fakes import Fakes

_fakes = Fakes()
humanclaw_scenes, humanclaw_simulators = _fakes.humanclaw_scenes, _fakes.humanclaw_simulators
humanclaw_motion_generators = _fakes.humanclaw_motion_generators
"""


@pytest.fixture
def fake(tmp_path):
    """The command of a server without physics that keeps records in `tmp_path / "out"`."""
    (tmp_path / "fakes.py").write_text(FAKES)
    options = ["--plugin", tmp_path / "fakes.py", "--scene", "fake:floor", "--simulator", "fake", "--generator", "fake"]
    return [sys.executable, "-m", "humanclaw", "mcp", *map(str, options), "--out", str(tmp_path / "out")]
