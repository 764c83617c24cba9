"""Guard the speed of the body: measure ten figures and fail if one got slower by more than 20 %.

    python tests/evidence/perf.py             # `make perf`: compare with perf.json
    python tests/evidence/perf.py --short     # the same in under a minute, for CI
    python tests/evidence/perf.py --save      # make today's figures the standard

A figure is a ratio: processor time of the work over that of fixed work of the same kind, which this process does in
turn with it. So another clock rate changes it little. A machine of another make changes it more, since it does one kind
of work faster and another one slower than the standard's. So a figure fails only if it got slower by more than 20 %
compared with each kind of fixed work.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, NamedTuple

import mujoco
import numpy as np
from threadpoolctl import ThreadpoolController

from humanclaw import Body, Episode, Plugins
from humanclaw.body import HISTORY, Motion, re_rooted
from humanclaw.cli import show_markdown
from humanclaw.laws.fixture import FORWARD, TURN, Fixture
from humanclaw.motion import DiTGenerator
from humanclaw.records import free_episode
from humanclaw.world import Scene, SceneObject, ego_camera
from humanclaw_bullet.engine import Client
from humanclaw_report.page import report_of

STANDARD: Final = Path(__file__).with_name("perf.json")
SLOWER: Final = 1.2
HOUSE: Final = "house:0"
_FIRST_LINE: Final = """
import sys, types
sys.modules["humanclaw.cli.run"] = types.SimpleNamespace(play=lambda *args, **options: None)
from humanclaw.cli import main
main(["run"])
"""
"""Everything before the plugins are loaded."""
_APART: Final = 40.0
"""Metres between a house and its copy."""
Work = Callable[[], object]


class Measured(NamedTuple):
    """Medians: the ratio of work to fixed work, and milliseconds of processor time of either."""

    ratio: float
    work: float
    fixed: float


@dataclass(frozen=True)
class Figure:
    """Work to measure, and fixed work of the same kind that takes about as long."""

    name: str
    work: Work
    fixed: Work

    def measure(self, samples: int) -> Measured:
        pairs = [(spent(self.work), spent(self.fixed)) for _ in range(samples)]
        work, fixed = (statistics.median(times) * 1e3 for times in zip(*pairs, strict=True))
        return Measured(statistics.median(work / fixed for work, fixed in pairs), work, fixed)


def spent(work: Work) -> float:
    """Processor seconds of this process, and of the processes that it waited for."""
    before = _used()
    work()
    return _used() - before


def _used() -> float:
    both = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in both)


def figures() -> Iterator[Figure]:
    """Yield the figures. Each is warm: what is loaded once is loaded before it is measured."""
    plugins = Plugins.discover()
    yield Figure("chunk of motion, lite", _chunks(plugins), _matrices())
    yield Figure("view, 512 x 512", _views(plugins), _passes())
    yield Figure("half-physics among 360 objects, Bullet", _physics("bullet"), bullet := _bare_bullet())
    yield Figure("half-physics among 360 objects, MuJoCo", _physics("mujoco"), _bare_mujoco())
    yield Figure("start of an episode in a loaded house", _starts(plugins), bullet)
    importing = _run("import click, pluggy, rich.console")
    yield Figure("humanclaw --help", _run("from humanclaw.cli import main; main(['--help'])"), importing)
    yield Figure("first line of humanclaw run", _run(_FIRST_LINE), importing)
    for words in (["skills"], ["bench", "run", "--help"]):
        listing = _run(f"from humanclaw.cli import main; main({words})")
        yield Figure(f"humanclaw {' '.join(words)}", listing, importing)
    with tempfile.TemporaryDirectory() as home:
        yield Figure("pages of 20 episodes, unchanged", _pages(plugins, Path(home)), importing)


# -- the body's work ---------------------------------------------------------------------------------------------------
def _chunks(plugins: Plugins, count: int = 4) -> Work:
    generator, adapter = DiTGenerator.load(), plugins.skills["walk"].adapter
    history, key = generator.start(), [0]

    def walk() -> None:
        nonlocal history
        for _ in range(count):
            key[0] += 1
            history = generator.generate(history, adapter, {"x": 0.0, "z": 0.4, "yaw": 0.1}, key)[-HISTORY:]

    walk()
    return walk


def _views(plugins: Plugins, count: int = 4) -> Work:
    body = Body(HOUSE, plugins=plugins)
    renderer = plugins.make("renderers", body.backends.renderer)
    renderer.load(body.scene)
    state, camera = body.state(), ego_camera(body.state().body)

    def look() -> None:
        for _ in range(count):
            renderer.render(state, camera)

    look()
    return look


def _physics(engine: str, count: int = 3) -> Work:
    """Load the house, stand, and play the same motion each time."""
    fixture = Fixture.of(engine)
    simulator, motions = fixture.simulator(), list[Motion]()
    scene = crowded(fixture.plugins.scene(HOUSE))
    history = fixture.stand(simulator, scene)
    for number in range(count):
        motion = fixture.generate(history, {FORWARD: 0.4, TURN: 0.35}, number)
        history = re_rooted(history.then(motion)[-HISTORY:], simulator.execute(motion).simulated)
        motions.append(motion)

    def play() -> None:
        fixture.stand(simulator, scene)
        for motion in motions:
            simulator.execute(motion)

    return play


def crowded(scene: Scene, fixed: int = 300, movable: int = 60) -> Scene:
    """Return a house with exact numbers of fixed and movable objects: its own, then copies of them next door."""
    counts, objects = {False: fixed, True: movable}, list[SceneObject]()
    for copy in range(100):
        for obj in scene.objects:
            if counts[obj.movable]:
                counts[obj.movable] -= 1
                x, y, z = obj.position
                objects.append(replace(obj, id=len(objects) + 1, position=(x + copy * _APART, y, z)))
    return replace(scene, name=f"{scene.name}, crowded", objects=tuple(objects))


def _starts(plugins: Plugins) -> Work:
    body = Body(HOUSE, plugins=plugins)
    return lambda: body.reset(body.scene)


def _pages(plugins: Plugins, run: Path, count: int = 20) -> Work:
    """Write the page of a run again, of which no record has changed."""
    with Body(HOUSE, plugins=plugins) as body:
        spec = free_episode("Walk about.", body.scene, seed=0, max_steps=5, name="0")
        with Episode(body, spec, plugins.make("agents", "random", {}), folder=run / "0") as episode:
            while not episode.done:
                episode.ask()
    for number in range(1, count):
        shutil.copytree(run / "0", run / str(number))
    report_of(run, plugins)
    return lambda: report_of(run, plugins)


def _run(program: str) -> Work:
    return lambda: subprocess.run([sys.executable, "-c", program], check=True, stdout=subprocess.DEVNULL)


# -- fixed work --------------------------------------------------------------------------------------------------------
def _matrices() -> Work:
    rng = np.random.default_rng(0)
    weights = [rng.standard_normal((192, 768), np.float32) for _ in range(24)]
    tokens = rng.standard_normal((20, 192), np.float32)
    controller = ThreadpoolController()

    def multiply() -> None:
        with controller.limit(limits=1, user_api="blas"):
            for _ in range(12):
                for matrix in weights:
                    tokens @ matrix

    return multiply


def _passes() -> Work:
    array = np.random.default_rng(0).random((512, 512, 16), np.float32)
    return lambda: [np.sqrt(array * array + 1.0) for _ in range(2)]


def _bare_bullet() -> Work:
    """Drop boxes in a world that stays: to make one costs 14 or 25 ms, by where its memory comes from."""
    client = Client()
    client.setGravity(0, 0, -9.81)
    shape = client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.2, 0.2, 0.2])
    places = [[0.5 * (k % 12), 0.5 * (k // 12), 0.45 * (k % 3)] for k in range(150)]
    bodies = [client.createMultiBody(float(k > 0), shape, -1, place) for k, place in enumerate(places)]

    def drop() -> None:
        for body, place in zip(bodies, places, strict=True):
            client.resetBasePositionAndOrientation(body, place, [0, 0, 0, 1])
            client.resetBaseVelocity(body, [0, 0, 0], [0, 0, 0])
        for _ in range(60):
            client.stepSimulation()

    drop()
    return drop


def _bare_mujoco() -> Work:
    boxes = "".join(
        f'<body pos="{0.5 * (k % 12)} {0.5 * (k // 12)} {0.5 + 0.45 * (k % 3)}"><freejoint/>'
        '<geom type="box" size=".2 .2 .2"/></body>'
        for k in range(60)
    )
    plane = '<geom type="plane" size="20 20 1"/>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{plane}{boxes}</worldbody></mujoco>")

    def fall() -> None:
        data = mujoco.MjData(model)
        for _ in range(60):
            mujoco.mj_step(model, data)

    return fall


# -- the table ---------------------------------------------------------------------------------------------------------
def measured(samples: int, then: dict[str, Measured]) -> dict[str, Measured]:
    """Measure each figure. One that seems slower is measured again with three times as many samples, which then counts:
    the less of the two would flatter."""
    results = {}
    for figure in figures():
        results[figure.name] = figure.measure(samples)
        if slower(results, then)[-1:] == [figure.name]:
            results[figure.name] = figure.measure(3 * samples)
    return results


def slower(results: dict[str, Measured], then: dict[str, Measured]) -> list[str]:
    return [name for name, now in results.items() if name in then and now.ratio > SLOWER * then[name].ratio]


def failing(results: dict[str, Measured], then: dict[str, Measured]) -> list[str]:
    """Return the figures that got slower compared with every kind of fixed work, not with their own alone."""
    machine = max((now.fixed / then[name].fixed for name, now in results.items() if name in then), default=1.0)
    return [name for name in slower(results, then) if results[name].work > SLOWER * machine * then[name].work]


def markdown(results: dict[str, Measured], then: dict[str, Measured]) -> str:
    """Return the table of then and now."""
    lines = [
        "| work | then | now | change | ms now | fixed work then | now |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for name, (ratio, work, fixed) in results.items():
        before = then.get(name)
        change = f"{ratio / before.ratio - 1:+.0%}" if before else "new"
        was = (f"{before.ratio:.3g}", f"{before.fixed:.1f}") if before else ("-", "-")
        lines.append(f"| {name} | {was[0]} | {ratio:.3g} | {change} | {work:.1f} | {was[1]} | {fixed:.1f} |")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--short", action="store_true", help="fewer samples")
    parser.add_argument("--save", action="store_true", help="write today's figures to perf.json")
    options = parser.parse_args()
    os.environ["OMP_NUM_THREADS"] = "1"
    began = time.perf_counter()
    kept = {} if options.save else json.loads(STANDARD.read_text("utf-8"))
    then = {name: Measured(**figure) for name, figure in kept.items()}
    results = measured(5 if options.short else 15, then)
    show_markdown(markdown(results, then))
    print(f"Ratios of processor time to fixed work of the same kind; {time.perf_counter() - began:.0f} s.")
    if options.save:
        rounded = {name: {part: round(x, 3) for part, x in now._asdict().items()} for name, now in results.items()}
        STANDARD.write_text(json.dumps(rounded, indent=1) + "\n", "utf-8")
        return 0
    late = failing(results, then)
    if unsure := [name for name in slower(results, then) if name not in late]:
        print(f"Perhaps slower, or this machine is of another make: {', '.join(unsure)}.")
    if late:
        print(f"Slower by more than {SLOWER - 1:.0%}: {', '.join(late)}. Find the cause, or save the new standard.")
    return int(bool(late))


if __name__ == "__main__":
    sys.exit(main())
