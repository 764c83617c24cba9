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
def one_process(monkeypatch, plugins):
    """Runs of the benchmark play in this process: for each, two others load what they need, litellm too, for ten
    seconds."""
    from humanclaw_bench.executors import LocalExecutor
    from humanclaw_bench.worker import Worker

    def reports(executor, job, queue, out):
        with Worker(replace(job, apart={}), out, lambda: bool(executor._stopping.value), plugins=plugins) as worker:
            while not executor._stopping.value and (spec := queue.take()):
                yield worker.play(spec)

    monkeypatch.setattr(LocalExecutor, "reports", reports)
