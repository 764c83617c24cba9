"""`humanclaw check` uses an item of every kind once: deliberate faults are named, legal plugins are not refused."""

from pathlib import Path

import pytest

from humanclaw import Plugins
from humanclaw.testing import check_target

ROOT = Path(__file__).parents[1]

HEAD = """
import click
import numpy as np
from dataclasses import replace
from types import SimpleNamespace
from humanclaw import Call, Decision, Scene, Verdict, hookimpl
from humanclaw.body import Motion, Pose2D
from humanclaw.skills import Measure
from humanclaw.world import View
from humanclaw.testing import FakeGenerator, FakeRenderer, FakeWorld, fake_scene

class Begins:
    def begin(self, context):
        pass

"""


def item(kind, value, body=""):
    return f"{body}\n@hookimpl\ndef humanclaw_{kind}(register):\n    register('mine', {value})\n"


def made(kind, factory, base, method, *lines):
    body = "\n".join(f"        {line}" for line in lines)
    return item(kind, factory, f"class It{base}:\n    name, privileged = 'it', False\n    def {method}:\n{body}\n")


def agent(*decide):
    return made("agents", "lambda o: It()", "(Begins)", "decide(self, seen, history)", *decide)


def judge(*verify):
    return made("verifiers", "lambda o: It()", "(Begins)", "verify(self, seen, call, skill, goal)", *verify)


def world(result):
    done = "done = super().execute(motion)", f"return {result}"
    return made("simulators", "lambda profile: It()", "(FakeWorld)", "execute(self, motion)", *done)


def eyes(result):
    seen = "seen = super().render(state, camera)", f"return {result}"
    return made("renderers", "It", "(FakeRenderer)", "render(self, state, camera)", *seen)


def prior(result):
    moved = "it = super().generate(*args)", f"return {result}"
    return made("motion_generators", "lambda profile: It()", "(FakeGenerator)", "generate(self, *args)", *moved)


def report(files):
    return made("reports", "lambda film, renderer: It()", "", "write(self, run, episode, plugins)", f"return {files}")


def measure(function, unit="m", mirror=1):
    registered = f"register(Measure('m', '{unit}', 'x', {mirror}, lambda p, r: {function}))"
    return f"@hookimpl\ndef humanclaw_measures(register):\n    {registered}\n"


def hook(signature, line="pass"):
    return f"@hookimpl\ndef humanclaw_{signature}:\n    {line}\n"


FAULTS = {
    "an agent that returns a call": agent("return Call('nod')"),
    "an agent that raises": agent("return 1 / 0"),
    "an agent that decides nothing": agent("pass"),
    "an agent whose calls are no tuple": agent("return Decision(Call('nod'))"),
    "an agent without a name": item("agents", "lambda o: SimpleNamespace(privileged=False)"),
    "an agent of None": item("agents", "lambda o: None"),
    "an agent that calls an unknown skill": agent("return Decision((Call('fly'),))"),
    "an agent that calls with an unknown parameter": agent("return Decision((Call('nod', {'x': 1}),))"),
    "an agent that calls twice": agent("return Decision((Call('nod'), Call('nod')))"),
    "an agent whose reasoning is no text": agent("return Decision((Call('nod'),), reasoning=3)"),
    "an agent that paints over the picture": agent("seen.rgb[:] = 0"),
    "an agent that looks at the scene unasked": agent("return self.scene")
    .replace("(Begins)", "")
    .replace("    def decide", "    def begin(self, context):\n        context.scene.objects\n\n    def decide"),
    "a factory that takes no options": item("agents", "lambda: None"),
    "a verifier that neither accepts nor replaces": judge("return Verdict(False)"),
    "a verifier that returns True": judge("return True"),
    "a verifier whose call is unknown": judge("return Verdict(False, Call('fly'))"),
    "a verifier whose call is out of bounds": judge("return Verdict(False, Call('walk', {'z_cm': 9999}))"),
    "a verifier that raises": judge("raise KeyError('x')"),
    "a scene of None": item("scenes", "lambda argument: None"),
    "a scene without an object": item("scenes", "lambda argument: Scene('x', {}, (), (), Pose2D())"),
    "a scene that begins off its floor": item("scenes", "lambda a: replace(fake_scene(), start=Pose2D(500.0, 0.0))"),
    "a scene that differs": item("scenes", "lambda a: replace(fake_scene(), start=Pose2D(np.random.rand(), 0.0))"),
    "a scene that raises": item("scenes", "lambda argument: 1 / 0"),
    "an engine of 14 frames": world("replace(done, simulated=done.simulated[:14])"),
    "an engine that jumps 5 m": world("replace(done, simulated=Motion(motion.root + [5, 0, 0], motion.rotations))"),
    "an engine of NaN": world("replace(done, simulated=Motion(motion.root * np.nan, motion.rotations))"),
    "an engine of None": world("None"),
    "a renderer of None": eyes("None"),
    "a picture of 10 rows": eyes("View(seen.rgb[:10], seen.depth, seen.ids)"),
    "a depth of float64": eyes("View(seen.rgb, seen.depth.astype(float), seen.ids)"),
    "a depth of NaN": eyes("View(seen.rgb, seen.depth * np.nan, seen.ids)"),
    "a depth below 0": eyes("View(seen.rgb, -seen.depth, seen.ids)"),
    "an object that is not there": eyes("View(seen.rgb, seen.depth, np.full_like(seen.ids, 777))"),
    "a generator of 14 frames": prior("it[:14]"),
    "a generator that jumps": prior("Motion(it.root + [0, 0, 5], it.rotations)"),
    "a generator of NaN": prior("Motion(it.root, it.rotations * np.nan)"),
    "a generator without a seed": prior("Motion(it.root, it.rotations + np.random.rand() / 100)"),
    "a reporter of None": report("None"),
    "a reporter of a file that is not there": report("{'page': run / 'none.html'}"),
    "a framework of None": item("frameworks", "lambda tools: None"),
    "a framework of nothing": item("frameworks", "lambda tools: []"),
    "a framework that raises": item("frameworks", "lambda tools: tools.nothing"),
    "a generator whose pelvis has no seed": prior("Motion(it.root + np.random.rand() / 100, it.rotations)"),
    "a scene whose faces are no integers": item(
        "scenes",
        "lambda argument: yard()",
        "def yard():\n    scene = fake_scene()\n"
        "    asset = next(iter(scene.assets.values()))\n"
        "    mesh = replace(asset.mesh, faces=asset.mesh.faces.astype(float))\n"
        "    return replace(scene, assets={**scene.assets, asset.name: replace(asset, mesh=mesh)})\n",
    ),
    "a measure of one number": measure("p[0, 0, 0]"),
    "a measure with the wrong sign in the mirror": measure("p[:, -1, 0]"),
    "a measure of one arm with a sign": measure("r[:, -1, 16, 2]", mirror=-1),
    "a measure in feet": measure("p[:, 0, 0]", "ft"),
    "a measure of NaN": measure("p[:, 0, 0] * np.nan"),
    "an observer that raises": hook("step(episode, step)", "step.nothing"),
    "an observer of chunks that raises": hook("chunk(chunk)", "1 / 0"),
    "an observer with an unknown argument": hook("step(episode, stride)"),
    "a misspelt hook": hook("agent(register)"),
    "commands that raise": hook("commands(cli)", "1 / 0"),
    "no command": hook("commands(cli)"),
    "a command without help": hook("commands(cli)", "cli.add_command(click.Command('x', callback=print))"),
    "an option without help": hook(
        "commands(cli)", "cli.add_command(click.Command('x', help='X.', params=[click.Option(['--y'])]))"
    ),
    "a command that is there already": hook("commands(cli)", "cli.add_command(click.Command('play', help='X.'))"),
    "a command named as the one of the core that no hook adds": hook(
        "commands(cli)", "cli.add_command(click.Command('run', help='X.'))"
    ),
    "a command that is a function": hook("commands(cli)", "cli.add_command(print)"),
}


LEGAL_MEASURES = {"sideways": measure("p[:, -1, 0]", mirror=-1), "one arm": measure("r[:, -1, 16, 2]", mirror=None)}


def faults(tmp_path, text, name="mine"):
    (tmp_path / f"{name}.py").write_text(HEAD + text)
    reports = check_target(str(tmp_path / f"{name}.py"), Plugins.discover())
    return [fault for report in reports for fault in report.faults]


@pytest.mark.integration
@pytest.mark.parametrize("text", FAULTS.values(), ids=FAULTS)
def test_a_deliberate_fault_is_named(tmp_path, text):
    problems = faults(tmp_path, text)
    assert problems
    assert all(fault.message and fault.remedy for fault in problems)


def test_an_unknown_argument_is_answered_with_the_known_ones(tmp_path):
    (fault,) = faults(tmp_path, hook("step(episode, stride)"))
    assert fault.remedy == "It takes episode, step, view."


def test_a_renderer_that_never_returns_is_a_fault(tmp_path, monkeypatch):
    monkeypatch.setattr("humanclaw.checks.plugins.PATIENCE", 0.5)
    waits = "__import__('threading').Event().wait()"
    assert "did not return within 0.5 s" in faults(tmp_path, eyes(waits))[0].message
    assert faults(tmp_path, agent(waits), "waiting") == []


@pytest.mark.parametrize("text", LEGAL_MEASURES.values(), ids=LEGAL_MEASURES)
def test_a_measure_that_says_how_it_mirrors_is_legal(tmp_path, text):
    assert faults(tmp_path, text) == []


@pytest.mark.parametrize("file", sorted((ROOT / "examples/hooks").glob("*.py")), ids=lambda file: file.stem)
def test_no_example_of_a_hook_is_refused(tmp_path, file):
    assert faults(tmp_path, file.read_text("utf-8"), f"example_{file.stem}") == []


@pytest.mark.parametrize("name", ["humanclaw-scripted", "humanclaw-raster", "humanclaw-frameworks", "humanclaw-houses"])
def test_an_installed_plugin_is_checked_by_its_name(name, monkeypatch):
    monkeypatch.setattr("humanclaw.checks.plugins.PATIENCE", 900)  # A loaded machine may compile for minutes.
    reports = check_target(name, Plugins.discover())
    assert reports
    assert [fault for report in reports for fault in report.faults] == []
