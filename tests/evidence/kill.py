"""Kill a run many times, at random moments, and compare its records with those of an undisturbed run.

python tests/evidence/kill.py --kills 200 --simulator mujoco     # `make kill` does both engines
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from humanclaw import EpisodeSpec, load_run
from humanclaw.records import write_episodes


def split(folder: Path, episodes: int, steps: int) -> Path:
    """Write a split of short episodes in two houses."""
    specs = [
        EpisodeSpec(id=f"kill-{k}", instruction="Walk about.", scene=f"house:{k % 2}", max_steps=steps, seed=k)
        for k in range(episodes)
    ]
    write_episodes(folder / "kill.jsonl", specs)
    return folder / "kill.jsonl"


def run(file: Path, out: Path, simulator: str) -> subprocess.Popen[bytes]:
    """Start a run or resume it."""
    command = [sys.executable, "-m", "humanclaw", "bench", "run", "--split", str(file), "--agent", "random"]
    options = ["--simulator", simulator, "--workers", "2", "--out", str(out)]
    return subprocess.Popen([*command, *options], stdout=subprocess.DEVNULL, start_new_session=True)


def digests(out: Path) -> dict[str, str]:
    return {one.record.spec.id: one.digest for one in load_run(out)}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--simulator", default="mujoco")
    parser.add_argument("--episodes", type=int, default=5)
    parser.add_argument("--steps", type=int, default=12)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    when = random.Random(asked.seed)
    with tempfile.TemporaryDirectory() as temporary:
        home = Path(temporary)
        file = split(home, asked.episodes, asked.steps)
        began = time.monotonic()
        assert run(file, home / "clean", asked.simulator).wait() == 0, "the undisturbed run fails"
        length, expected = time.monotonic() - began, digests(home / "clean")
        kills = rounds = 0
        while kills < asked.kills:
            rounds += 1
            out = home / f"killed-{rounds}"
            while kills < asked.kills:
                running = run(file, out, asked.simulator)
                try:
                    running.wait(when.uniform(0, length))
                    break
                except subprocess.TimeoutExpired:
                    os.killpg(running.pid, signal.SIGKILL)
                    running.wait()
                    kills += 1
            assert run(file, out, asked.simulator).wait() == 0, f"round {rounds} fails after {kills} kills"
            if digests(out) != expected:
                print(
                    f"round {rounds} of {asked.simulator} differs from the undisturbed run after {kills} kills: {out}"
                )
                return 1
            print(f"{asked.simulator}: {kills} kills, {rounds} runs, all byte-identical", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
