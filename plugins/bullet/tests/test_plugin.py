"""How the plugin is found."""

import subprocess
import sys

import humanclaw_bullet
from humanclaw_bullet.simulator import HalfPhysics


def offered(hook):
    found = {}
    hook(lambda name, factory, description="": found.update({name: factory}))
    return found


def test_the_simulator_is_offered_as_bullet():
    simulators = offered(humanclaw_bullet.humanclaw_simulators)
    assert isinstance(simulators["bullet"](profile="paper"), HalfPhysics)


def test_importing_the_plugin_does_not_load_the_engine():
    code = "import sys, humanclaw_bullet; sys.exit('pybullet' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_nothing_is_printed_so_that_protocols_may_use_stdout():
    code = "import humanclaw_bullet.engine as engine; engine.Client().close()"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("", "")
