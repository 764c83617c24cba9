"""Fixtures: a server with real skills and a real house, and official clients."""

from __future__ import annotations

import pytest

from humanclaw_mcp.session import Bodies, Settings


@pytest.fixture(scope="module")
def anyio_backend():
    return "asyncio"


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    return tmp_path_factory.mktemp("records")


@pytest.fixture(scope="module")
def bodies(records):
    return Bodies(Settings(max_steps=5, out=records))
