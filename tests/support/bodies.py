"""Fixtures that are slow to make. Tests share them safely because each test resets what it uses."""

from dataclasses import replace

import pytest

from humanclaw import Body, Plugins


@pytest.fixture(scope="session")
def plugins():
    return Plugins.discover()


@pytest.fixture(scope="session")
def house(plugins):
    return plugins.scene("house:0")


@pytest.fixture(scope="session")
def body(plugins, house):
    with Body(house, plugins=plugins) as made:
        yield made


@pytest.fixture
def one_process(monkeypatch):
    """Runs of the benchmark play in this process: for each, two others load what they need, litellm too, for ten
    seconds."""
    from here import Here

    from humanclaw_bench.executors import LocalExecutor

    def reports(executor, job, queue, out):
        return Here().reports(replace(job, apart={}), queue, out)

    monkeypatch.setattr(LocalExecutor, "reports", reports)
