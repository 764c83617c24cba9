"""Kill runs, submissions and writers of a cache at random moments, and let the clock jump; what is left must be that of
an undisturbed one.

python tests/evidence/kill.py --kills 100 --simulator mujoco     # `make kill` does both engines
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
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path

from humanclaw import EpisodeSpec, load_run
from humanclaw.records import write_episodes
from humanclaw.storage import VARIABLE, Cache
from humanclaw_bench.submission import Submission, read

Start = Callable[[], "subprocess.Popen[bytes]"]
_PUT = """
import sys; from itertools import count; from pathlib import Path; from humanclaw.storage import Cache
cache = Cache("things", root=Path(sys.argv[1]))
for number in count():
    cache.put(str(number % 10), bytes([number % 256]) * (1 << 20))
    print(flush=True)
"""


def split(folder: Path, episodes: int, steps: int) -> Path:
    """Write a split of short episodes in two houses."""
    specs = [
        EpisodeSpec(id=f"kill-{k}", instruction="Walk about.", scene=f"house:{k % 2}", max_steps=steps, seed=k)
        for k in range(episodes)
    ]
    write_episodes(folder / "kill.jsonl", specs)
    return folder / "kill.jsonl"


def started(*words: str | Path, stdout: int = subprocess.DEVNULL, **variables: str) -> subprocess.Popen[bytes]:
    """Start Python with these words and variables of the environment."""
    command, environment = [sys.executable, *map(str, words)], os.environ | variables
    return subprocess.Popen(command, stdout=stdout, start_new_session=True, env=environment)


def run(file: Path, out: Path, simulator: str, **variables: str) -> subprocess.Popen[bytes]:
    """Start a run or resume it. It has the cache of its folder's name, so that kills also hit the writing of it."""
    words = ("-m", "humanclaw", "bench", "run", "--split", file, "--agent", "random", "--seed", "0")
    variables = {VARIABLE: f"{out}-cache"} | variables
    return started(*words, "--simulator", simulator, "--workers", "2", "--out", out, **variables)


def digests(out: Path) -> dict[str, str]:
    return {episode.record.spec.id: episode.digest for episode in load_run(out)}


def killed(start: Start, length: float, most: int, when: random.Random) -> tuple[int, float]:
    """Kill it at moments within `length` seconds, until it ends by itself or was killed `most` times; then let it end.

    Returns the number of kills, and the length in which one that is not disturbed now ends: the machine may have become
    faster.
    """
    kills = 0
    while kills < most:
        running, began = start(), time.monotonic()
        try:
            running.wait(when.uniform(0, length))
            length = length if kills else time.monotonic() - began
            break
        except subprocess.TimeoutExpired:
            os.killpg(running.pid, signal.SIGKILL)
            running.wait()
            kills += 1
    assert start().wait() == 0, f"it fails after {kills} kills"
    return kills, length


def kill_runs(file: Path, simulator: str, kills: int, when: random.Random) -> dict[str, str]:
    """Kill runs, and compare their records with those of an undisturbed one, which are returned."""
    home, done, rounds, began = file.parent, 0, 0, time.monotonic()
    assert run(file, home / "clean", simulator).wait() == 0, "the undisturbed run fails"
    length, expected = time.monotonic() - began, digests(home / "clean")
    while done < kills:
        rounds += 1
        out = home / f"killed-{rounds}"
        more, length = killed(lambda: run(file, out, simulator), length, kills - done, when)  # noqa: B023  Called now.
        done += more
        assert digests(out) == expected, f"round {rounds} differs after {done} kills: {out}"
        print(f"{simulator}: {done} kills, {rounds} runs, all byte-identical", flush=True)
    return expected


def kill_submissions(out: Path, kills: int, when: random.Random) -> None:
    """Kill `bench submit`: there is no submission then, or a whole one."""
    path, began = out / "submission.json", time.monotonic()

    def submit() -> subprocess.Popen[bytes]:
        if path.exists():
            assert undated(read(out, load_run(out))) == expected
            path.unlink()
        return started("-m", "humanclaw", "bench", "submit", out, "--who", "me")

    assert submit().wait() == 0
    expected, length, done = undated(read(out, load_run(out))), time.monotonic() - began, 0
    while done < kills:
        more, length = killed(submit, length, kills - done, when)
        done += more
        assert undated(read(out, load_run(out))) == expected
    print(f"{done} kills of bench submit: the same submission", flush=True)


def undated(submission: Submission) -> Submission:
    return submission.model_copy(update={"made": None})


def kill_caches(home: Path, kills: int, when: random.Random) -> None:
    """Kill a process that writes entries of a cache: each is there whole, or not at all."""
    cache, held = Cache("things", root=home), 0
    warnings.simplefilter("error")
    for _ in range(kills):
        running = started("-c", _PUT, home, stdout=subprocess.PIPE)
        with running:
            assert running.stdout
            assert running.stdout.readline() == b"\n"
            time.sleep(when.uniform(0.0, 0.5))
            os.killpg(running.pid, signal.SIGKILL)
        blobs = [data for data in map(cache.get, map(str, range(10))) if data]
        assert all(data == data[:1] * (1 << 20) for data in blobs)
        held = max(held, len(blobs))
    assert held == 10, "nothing was written"
    print(f"{kills} kills of a writer of the cache: every entry whole", flush=True)


def jump(file: Path, simulator: str, library: str, expected: Mapping[str, str], when: random.Random) -> None:
    """Run while the clock jumps by up to a year, twice a second. library: libfaketime."""
    clock, out, jumps = file.parent / "clock", file.parent / "jumping", 0
    clock.write_text("+0")
    faked = {"FAKETIME_TIMESTAMP_FILE": str(clock), "FAKETIME_NO_CACHE": "1", "FAKETIME_DONT_FAKE_MONOTONIC": "1"}
    running = run(file, out, simulator, LD_PRELOAD=library, **faked)
    while running.poll() is None:
        clock.write_text(f"{when.uniform(-365, 365):+.3f}d")
        jumps += 1
        time.sleep(0.5)
    assert running.returncode == 0
    assert digests(out) == expected
    print(f"{simulator}: {jumps} jumps of the clock: byte-identical", flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--simulator", default="mujoco")
    parser.add_argument("--episodes", type=int, default=5)
    parser.add_argument("--steps", type=int, default=12)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--clock", metavar="LIBFAKETIME", help="also let the clock jump, by this library")
    asked = parser.parse_args()
    when = random.Random(asked.seed)
    with tempfile.TemporaryDirectory() as temporary:
        file = split(Path(temporary), asked.episodes, asked.steps)
        expected = kill_runs(file, asked.simulator, asked.kills, when)
        kill_submissions(file.parent / "clean", asked.kills, when)
        kill_caches(file.parent / "cache", asked.kills, when)
        if asked.clock:
            jump(file, asked.simulator, asked.clock, expected, when)
    return 0


if __name__ == "__main__":
    sys.exit(main())
