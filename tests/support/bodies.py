"""Fixtures that are slow to make, and the rules of a unit test.

Tests share the fixtures safely because each test resets what it uses.

The rules hold while a test runs. They do not see what a file does while it is imported, engines and houses that are
made without `Plugins`, what a thread does after its test, a server of datagrams, and C's own `system`.
"""

import platform
import reprlib
import socket
import sys
from contextlib import suppress
from dataclasses import is_dataclass, replace
from multiprocessing.process import BaseProcess

import pytest

from humanclaw import Body, Plugins

OUTSIDE = {"os.exec", "os.fork", "os.forkpty", "os.posix_spawn", "os.spawn", "os.system", "subprocess.Popen"}
"""Python's audit events of a process that starts."""
UNTOLD = [(BaseProcess, "start"), (socket.socket, "listen")]
"""What starts a process or a server without an audit event."""
with suppress(ImportError):  # Windows has no such module.
    import _posixsubprocess

    UNTOLD.append((_posixsubprocess, "fork_exec"))


class Watch:
    """Refuse what only marked tests may do, and keep it: a test may swallow the refusal."""

    def __init__(self):
        self.on, self.breaches, self.engines = False, [], set()

    def __call__(self, event, arguments):
        if self.on and event in OUTSIDE:
            self.refuse(event)

    def refuse(self, what):
        if self.on:
            self.breaches.append(what)
            pytest.fail(f"A unit test may not do this: {what}. Mark it: @pytest.mark.integration")

    def begin(self, item):
        self.on = not any(item.get_closest_marker(name) for name in ("integration", "evidence"))
        self.breaches, self.engines = [], set()

    def end(self):
        self.on = False
        if self.breaches:
            pytest.fail(f"A unit test did this: {', '.join(self.breaches)}. Mark it: @pytest.mark.integration")

    def made(self, owner, arguments):
        """Tell two engines by the packages that register them: kinematic motion is MuJoCo's too."""
        if owner in ("humanclaw-bullet", "humanclaw-mujoco"):
            self.engines.add(owner)
            if len(self.engines) > 1:
                self.refuse("a second engine")
        if owner == "humanclaw-houses" and arguments != ("0",):
            self.refuse(f"house:{arguments[0]}")


WATCH = Watch()
MAKE = Plugins.make


class Ids(reprlib.Repr):
    """Writes a value shortly and alike in each process: no address, no date in a file, sets in order."""

    def repr_bytes(self, value, level):
        return repr(value) if len(value) <= 20 else f"{len(value)} bytes"

    def repr_int(self, value, level):  # Python writes no integer of more than 4,300 digits.
        return str(value) if abs(value) < 2**64 else f"{value.bit_length()} bits"

    def repr_instance(self, obj, level):
        if isinstance(obj, bool | float | None):
            return repr(obj)
        return self.repr_dict(vars(obj), level) if is_dataclass(obj) else getattr(obj, "__name__", type(obj).__name__)


def pytest_make_parametrize_id(val):
    """Name a case by what it holds, in at most 60 letters; pytest would number it or write it out."""
    if isinstance(val, bytes | dict | int | list | tuple) or is_dataclass(val) or (isinstance(val, str) and val[60:]):
        return Ids().repr(val)[:60].encode("ascii", "backslashreplace").decode()
    return None


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item):
    WATCH.begin(item)
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown():
    try:
        return (yield)
    finally:
        WATCH.end()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport(item, call):
    """Fail a test that is marked xfail, too."""
    report = yield
    if WATCH.breaches and hasattr(report, "wasxfail"):
        del report.wasxfail
        report.outcome, report.longrepr = "failed", f"A unit test did this: {', '.join(WATCH.breaches)}."
    return report


@pytest.fixture(scope="session", autouse=True)
def _watched():
    """Watch from here on. MuJoCo's window library and litellm start a process when they are loaded first."""
    platform.processor()
    with suppress(ImportError):
        import mujoco  # noqa: F401
    sys.addaudithook(WATCH)
    with pytest.MonkeyPatch.context() as patch:
        for owner, name in UNTOLD:
            patch.setattr(owner, name, _refusing(getattr(owner, name)))
        patch.setattr(Plugins, "make", _made)
        yield


def _refusing(method):
    def refusing(*arguments):
        WATCH.refuse(method.__qualname__)
        return method(*arguments)

    return refusing


def _made(plugins, kind, name, *arguments, **options):
    backend = MAKE(plugins, kind, name, *arguments, **options)
    WATCH.made(plugins.owner(name, kind), arguments)
    return backend


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
