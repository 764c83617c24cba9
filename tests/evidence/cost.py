"""Measure how cost grows with work, on this machine: `make cost` prints a table, whose last column tells the law.

    python tests/evidence/cost.py                             # `make cost`
    python tests/evidence/cost.py --only pages --run FOLDER   # 100 pages of a finished run, then all

Processor time; wall time too for workers, and alone for Ray's, which are no children of this process. The exponent is
that of the last step of a row: 1.0 is linear.
"""

from __future__ import annotations

import argparse
import math
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib.util import find_spec
from itertools import chain, pairwise
from pathlib import Path
from typing import Final

from perf import spent

from humanclaw import Body, Choice, Episode, Plugins, load_run
from humanclaw.cli import show_markdown
from humanclaw.records import free_episode
from humanclaw.testing import resident

STEPS: Final = (10, 100, 1000)
CALLS: Final = (100, 1000, 10_000)
WORKERS: Final = (1, 2, 4, 8)
RAY: Final = (1, 2, 4)
EPISODES: Final = 24
Row = tuple[str, Sequence[int], Sequence[float]]


def steps(home: Path) -> Iterator[Row]:
    """Steps of one episode in one process, random calls, recorded."""
    ends = [name for name, skill in Plugins.discover().skills.items() if skill.role == "stop"]
    plugins = Plugins.discover(choice=Choice(without=tuple(ends)))
    with Body("house:0", plugins=plugins) as body:

        def play(count: int) -> None:
            spec = free_episode("Walk about.", body.scene, seed=count, max_steps=count, name=f"steps-{count}")
            with Episode(body, spec, plugins.make("agents", "random", {}), folder=home / spec.id) as episode:
                while not episode.done:
                    episode.ask()

        play(20)  # Every skill is read once.
        yield "steps of an episode", STEPS, [spent(partial(play, count)) for count in STEPS]


def calls(_: Path) -> Iterator[Row]:
    """Calls in one process: processor time, and the memory that it holds."""
    taken, held = [0.0], list[float]()
    with Body("house:0") as body:
        _walk(body, 0, 20)
        for first, last in pairwise((0, *CALLS)):
            taken.append(taken[-1] + spent(partial(_walk, body, first, last)))
            held.append(resident())
    yield "calls in one process", CALLS, taken[1:]
    yield "the same, MiB", CALLS, held


def _walk(body: Body, first: int, last: int) -> None:
    for number in range(first, last):
        body.call("walk", z_cm=40) if number % 2 else body.call("turn_in_place", yaw_deg=45 + number % 4 * 7.5)


def workers(home: Path) -> Iterator[Row]:
    """The same episodes by more workers."""
    taken, lasted = zip(*(_played(home, count) for count in WORKERS), strict=True)
    yield f"workers for {EPISODES} episodes", WORKERS, taken
    yield "the same, wall", WORKERS, lasted


def ray(home: Path) -> Iterator[Row]:
    """The same by workers of a cluster on this machine; nothing without Ray."""
    if find_spec("ray"):
        yield "workers of Ray, wall", RAY, [_played(home, count, "--ray")[1] for count in RAY]


def _played(home: Path, count: int, *more: str) -> tuple[float, float]:
    """Return processor and wall time of a run with this many workers."""
    whole = Path(__file__).parents[2] / "plugins" / "bench" / "humanclaw_bench" / "data" / "mini.jsonl"
    (split := home / "some.jsonl").write_text("".join(whole.read_text("utf-8").splitlines(keepends=True)[:EPISODES]))
    began, out = time.perf_counter(), home / "".join(("run", *more, str(count)))
    taken = spent(_command("bench", "run", "--split", split, "--workers", count, "--out", out, *more))
    return taken, time.perf_counter() - began


def pages(home: Path, run: Path | None = None) -> Iterator[Row]:
    """Pages of a run, written, and again when nothing changed."""
    episodes = [episode.folder for episode in load_run(run or home / "run1")]
    sizes = (min(100, len(episodes) // 4), len(episodes))
    written, again = list[float](), list[float]()
    for count in sizes:
        part = home / f"pages-{count}"
        for folder in episodes[:count]:
            shutil.copytree(folder, part / folder.name)
        report = _command("report", part)
        written.append(spent(report))
        again.append(spent(report))
    yield "pages of a run", sizes, written
    yield "the same again, unchanged", sizes, again


def _command(*words: object) -> Callable[[], object]:
    line = [sys.executable, "-m", "humanclaw", *map(str, words)]
    return lambda: subprocess.run([*line, "--yes"] if "bench" in line else line, check=True, stdout=subprocess.DEVNULL)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--short", action="store_true", help=f"without {CALLS[-1]:,} calls, which take ten minutes")
    parser.add_argument("--run", type=Path, help="a finished run whose pages are written (default: that of one worker)")
    parser.add_argument("--only", default="", help="steps, calls, workers, ray or pages")
    asked = parser.parse_args()
    works = {work.__name__: work for work in (steps, calls, workers, ray)} | {"pages": partial(pages, run=asked.run)}
    chosen = [asked.only] if asked.only else [name for name in works if name != "calls" or not asked.short]
    lines = ["| work | how much | s | exponent |", "| --- | --- | --- | ---: |"]
    with tempfile.TemporaryDirectory() as folder:
        for name, sizes, taken in chain.from_iterable(works[name](Path(folder)) for name in chosen):
            law = math.log(taken[-1] / taken[-2]) / math.log(sizes[-1] / sizes[-2])
            told = ", ".join(f"{seconds:.1f}" for seconds in taken)
            lines.append(f"| {name} | {', '.join(map(str, sizes))} | {told} | {law:.2f} |")
    show_markdown("\n".join(lines))


if __name__ == "__main__":
    main()
