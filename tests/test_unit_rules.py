"""Unit tests start no process and no server and load one engine and no house but house:0 (tests/support/bodies.py)."""

from pathlib import Path

import pytest

pytest_plugins = "pytester"
pytestmark = pytest.mark.integration

BREACHES = [
    ("os.system('true')", "os.system"),
    ("os.fork() or os._exit(0)", "os.fork"),
    ("pty.fork()[0] or os._exit(0)", "os.forkpty"),
    ("os.posix_spawn('/bin/true', ['true'], os.environ)", "os.posix_spawn"),
    ("os.spawnl(os.P_WAIT, '/bin/true', 'true')", "os.fork"),
    ("subprocess.run(['true'])", "subprocess.Popen"),
    ("multiprocessing.get_context('spawn').Process(target=print).start()", "BaseProcess.start"),
    ("multiprocessing.util.spawnv_passfds(b'/bin/true', [b'true'], [])", "fork_exec"),
    ("socket.create_server(('localhost', 0))", "socket.listen"),
    ("Plugins.discover().scene('house:1')", "house:1"),
    ("[Plugins.discover().make('simulators', name) for name in ('mujoco', 'bullet')]", "a second engine"),
]
FILE = """
import multiprocessing.util, os, pty, socket, subprocess
import pytest
from humanclaw import Plugins

@pytest.mark.parametrize("code", {codes})
def test_a_unit(code):
    try:
        exec(code)
    except BaseException:
        pass

@pytest.mark.integration
def test_an_integration():
    subprocess.run(["true"])
    [Plugins.discover().make("simulators", name) for name in ("mujoco", "mujoco")]
"""


def test_a_unit_test_that_swallows_the_refusal_fails_at_its_end(pytester):
    pytest.importorskip("pybullet", reason="PyBullet has no wheel for this Python")
    pytester.makepyfile(FILE.format(codes=[code for code, _ in BREACHES]))
    done = pytester.runpytest_subprocess("-o", f"pythonpath={Path(__file__).with_name('support')}", "-p", "bodies")
    done.assert_outcomes(passed=len(BREACHES) + 1, errors=len(BREACHES))
    done.stdout.fnmatch_lines([f"*A unit test did this: {what}.*" for _, what in BREACHES])


def test_a_mark_of_failure_hides_no_breach(pytester):
    pytester.makepyfile("import os, pytest\n@pytest.mark.xfail\ndef test_a_unit():\n    os.system('true')")
    done = pytester.runpytest_subprocess("-o", f"pythonpath={Path(__file__).with_name('support')}", "-p", "bodies")
    assert done.ret == 1
    done.stdout.fnmatch_lines(["*A unit test did this: os.system.*"])
