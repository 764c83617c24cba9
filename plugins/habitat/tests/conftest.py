"""Write the tests' dataset, and give the tests a cache of their own."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from toy_dataset import write_dataset


@pytest.fixture(scope="session", autouse=True)
def _cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep the tests from reading results that an earlier version of the code cached."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HUMANCLAW_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="session")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset that all tests share and only read."""
    return write_dataset(tmp_path_factory.mktemp("toy"))


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    """A dataset of its own for a test that changes it."""
    return write_dataset(tmp_path / "toy")
