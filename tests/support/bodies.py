"""Fixtures that are slow to make, and the rules of a unit test.

Tests share the fixtures safely because each test resets what it uses.
"""

import platform
import socket
import subprocess
from contextlib import suppress
from dataclasses import replace
from multiprocessing.process import BaseProcess

import pytest

from humanclaw import Body, Plugins

OUTSIDE = ((subprocess.Popen, "_execute_child"), (BaseProcess, "start"), (socket.socket, "listen"))
"""Methods that start a process or a server."""


@pytest.fixture(scope="session")
def _libraries_asked():
    """MuJoCo's window library and litellm start a process when they are loaded first. Nothing of ours does."""
    platform.processor()
    with suppress(ImportError):
        import mujoco  # noqa: F401


@pytest.fixture(autouse=True)
def _unit_tests_stay_in_their_process(request, monkeypatch, _libraries_asked):
    """Fail an unmarked test that starts a process or a server."""
    if any(request.node.get_closest_marker(name) for name in ("integration", "evidence")):
        return
    for owner, name in OUTSIDE:
        monkeypatch.setattr(owner, name, _refuse)


def _refuse(*args, **options):
    pytest.fail("A unit test starts no process and no server. Mark it: @pytest.mark.integration")


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
