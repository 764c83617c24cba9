"""Measure the gym: processor time of a reset, memory over many, and sixteen bodies in one process.

python tests/evidence/gym.py --resets 10000
"""

from __future__ import annotations

import argparse
import resource
import time
from concurrent.futures import ThreadPoolExecutor

from humanclaw import Gym, Plugins

ENVIRONMENTS = 16


def megabytes() -> float:
    """Return the largest memory of this process so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def resets(plugins: Plugins, count: int) -> None:
    """Begin one task after the other in a house; print the time of a reset, and the memory after each tenth."""
    with Gym("approach", options={"houses": 1}, plugins=plugins) as gym:
        gym.reset(0)
        begun, first = time.process_time(), megabytes()
        for number in range(1, count + 1):
            gym.reset(number)
            if number % max(1, count // 10) == 0:
                spent = 1000 * (time.process_time() - begun) / number
                print(
                    f"{number} resets: {spent:.0f} ms of processor time each, {megabytes() - first:+.0f} MB", flush=True
                )


def turns(gym: Gym, count: int = 3) -> None:
    """Turn a body on the spot."""
    for _ in range(count):
        gym.call("turn_in_place", {"thoughts": "", "yaw_deg": 30})


def side_by_side(plugins: Plugins) -> None:
    """Step sixteen bodies, each in a thread; print steps a second, processor time of a step, memory of a body."""
    before = megabytes()
    gyms = [Gym("approach", options={"houses": 1}, plugins=plugins) for _ in range(ENVIRONMENTS)]
    for seed, gym in enumerate(gyms):
        gym.reset(seed)
        turns(gym, 1)  # The first call of a skill reads its weights.
    spent, begun = time.process_time(), time.perf_counter()
    with ThreadPoolExecutor(len(gyms)) as pool:
        list(pool.map(turns, gyms))
    steps, took = 3 * len(gyms), time.perf_counter() - begun
    each, memory = 1000 * (time.process_time() - spent) / steps, (megabytes() - before) / len(gyms)
    print(
        f"{len(gyms)} bodies at once: {steps / took:.1f} steps a second, {each:.0f} ms of processor time a step, "
        f"{memory:.0f} MB each"
    )
    for gym in gyms:
        gym.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--resets", type=int, default=10_000)
    host = Plugins.discover()
    side_by_side(host)
    resets(host, parser.parse_args().resets)


if __name__ == "__main__":
    main()
