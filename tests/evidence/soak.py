"""Make 2,000 decisions in one process: memory, handles, threads and temporary files must not grow.

python tests/evidence/soak.py --decisions 2000     # `make soak`
python tests/evidence/soak.py --decisions 1500 --episode 1500     # all in one episode
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from humanclaw import Backends, Body, Choice, Episode, Plugins, default_simulator
from humanclaw.records import free_episode
from humanclaw.testing import resident

EVERY = 100
"""Decisions from sample to sample."""


@dataclass(frozen=True)
class Sample:
    """The resources that the process holds."""

    decisions: int
    mebibytes: float
    handles: int
    threads: int
    temporary: int

    @classmethod
    def now(cls, decisions: int) -> Sample:
        folder = Path(f"/proc/{os.getpid()}/fd")
        handles = len(list(folder.iterdir())) if folder.exists() else 0
        return cls(decisions, resident(), handles, threading.active_count(), len(os.listdir(tempfile.gettempdir())))


@contextmanager
def own_temporaries() -> Iterator[None]:
    """Use a private temporary folder: other processes write to the shared one."""
    with tempfile.TemporaryDirectory() as folder:
        tempfile.tempdir = os.environ["TMPDIR"] = folder
        yield


def grows(samples: list[Sample]) -> str:
    """Return the resources that grow in the second half, if any. Memory may vary by 5 %."""
    half = len(samples) // 2
    early, late = samples[1 : half + 1], samples[half + 1 :]
    slack = {"mebibytes": 1.05, "handles": 1.0, "threads": 1.0, "temporary": 1.0}
    worse = [
        name
        for name, factor in slack.items()
        if np.median([getattr(state, name) for state in late]) > factor * max(getattr(state, name) for state in early)
    ]
    return ", ".join(worse)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--decisions", type=int, default=2000)
    parser.add_argument("--episode", type=int, default=EVERY, help="decisions in an episode")
    parser.add_argument("--simulator", default="")
    asked = parser.parse_args()
    if asked.episode < EVERY or asked.episode % EVERY:
        parser.error(f"--episode expects a multiple of {EVERY}; it got {asked.episode}")
    with own_temporaries():
        worse = grows(played(asked.decisions, asked.episode, asked.simulator))
    print(f"still growing: {worse}" if worse else "flat")
    return int(bool(worse))


def played(decisions: int, length: int, simulator: str) -> list[Sample]:
    """Play a number of decisions in episodes of some length; sample before the first and after every EVERY."""
    ends = tuple(name for name, skill in Plugins.discover().skills.items() if skill.role == "stop")
    plugins = Plugins.discover(choice=Choice(without=ends))  # No episode ends before its last step.
    samples = [Sample.now(0)]
    backends = Backends(simulator or default_simulator(plugins))
    with tempfile.TemporaryDirectory() as out, Body("house:0", plugins=plugins, backends=backends) as body:
        for number in range(max(4 * EVERY // length, decisions // length, 1)):
            spec = free_episode("Walk about.", body.scene, seed=number, max_steps=length, name=f"soak-{number}")
            agent = plugins.make("agents", "random", {})
            with Episode(body, spec, agent, folder=Path(out) / spec.id) as episode:
                while not episode.done:
                    episode.ask()
                    if len(episode.steps) % EVERY == 0:
                        samples.append(Sample.now(samples[-1].decisions + EVERY))
                        print(samples[-1], flush=True)
    return samples


if __name__ == "__main__":
    sys.exit(main())
