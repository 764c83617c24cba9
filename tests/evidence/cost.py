"""Measure how cost grows with work, on this machine: `make cost` prints a table, whose last column tells the law.

Processor time, and wall time for workers. The exponent is that of the last step of a row: 1.0 is linear.
"""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Final

from perf import spent

from humanclaw import Body, Choice, Episode, Plugins, load_run
from humanclaw.cli import show_markdown
from humanclaw.records import free_episode

STEPS: Final = (10, 100, 1000)
WORKERS: Final = (1, 2, 4, 8)
EPISODES: Final = 24
PAGES: Final = (6, 24)
Row = tuple[str, Sequence[int], Sequence[float]]


def steps(home: Path) -> Row:
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
        return "steps of an episode", STEPS, [spent(partial(play, count)) for count in STEPS]


def runs(home: Path) -> Iterator[Row]:
    """The same episodes by more workers: processor time, then wall time."""
    whole = Path(__file__).parents[2] / "plugins" / "bench" / "humanclaw_bench" / "data" / "mini.jsonl"
    (split := home / "some.jsonl").write_text("".join(whole.read_text("utf-8").splitlines(keepends=True)[:EPISODES]))
    taken, lasted = list[float](), list[float]()
    for count in WORKERS:
        began = time.perf_counter()
        taken.append(spent(_command("bench", "run", "--split", split, "--workers", count, "--out", home / str(count))))
        lasted.append(time.perf_counter() - began)
    yield f"workers for {EPISODES} episodes", WORKERS, taken
    yield "the same, wall", WORKERS, lasted


def pages(home: Path) -> Iterator[Row]:
    """Pages of a run, written, and again when nothing changed."""
    episodes = [episode.folder for episode in load_run(home / "1")]
    written, again = list[float](), list[float]()
    for count in PAGES:
        (part := home / f"pages-{count}").mkdir()
        for folder in episodes[:count]:
            subprocess.run(["cp", "-r", folder, part], check=True)
        report = _command("report", part)
        written.append(spent(report))
        again.append(spent(report))
    yield "pages of a run", PAGES, written
    yield "the same again, unchanged", PAGES, again


def _command(*words: object) -> Callable[[], object]:
    line = [sys.executable, "-m", "humanclaw", *map(str, words)]
    return lambda: subprocess.run([*line, "--yes"] if "bench" in line else line, check=True, stdout=subprocess.DEVNULL)


def main() -> None:
    lines = ["| work | how much | s | exponent |", "| --- | --- | --- | ---: |"]
    with tempfile.TemporaryDirectory() as folder:
        for name, sizes, taken in (steps(Path(folder)), *runs(Path(folder)), *pages(Path(folder))):
            law = math.log(taken[-1] / taken[-2]) / math.log(sizes[-1] / sizes[-2])
            times = ", ".join(f"{seconds:.1f}" for seconds in taken)
            lines.append(f"| {name} | {', '.join(map(str, sizes))} | {times} | {law:.2f} |")
    show_markdown("\n".join(lines))


if __name__ == "__main__":
    main()
