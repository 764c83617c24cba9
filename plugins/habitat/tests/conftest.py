"""Where the tests' dataset lies, and a cache of their own."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from toy_dataset import write_dataset


@pytest.fixture(scope="session", autouse=True)
def _cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """No test reads what an earlier version of the code has kept."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HUMANCLAW_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="session")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """For tests that only read it."""
    return write_dataset(tmp_path_factory.mktemp("toy"))


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    """For tests that break it."""
    return write_dataset(tmp_path / "toy")
