"""Measure the gym: processor time of a reset, memory over many, and sixteen bodies in one process.

python tests/evidence/gym.py --resets 10000
"""

from __future__ import annotations

import argparse
import resource
import time

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


def side_by_side(plugins: Plugins) -> None:
    """Step sixteen bodies by turns; print the processor time of a step and the memory of a body."""
    before = megabytes()
    gyms = [Gym("approach", options={"houses": 1}, plugins=plugins) for _ in range(ENVIRONMENTS)]
    for seed, gym in enumerate(gyms):
        gym.reset(seed)
    begun = time.process_time()
    for gym in gyms:
        for _ in range(3):
            gym.call("turn_in_place", {"thoughts": "", "yaw_deg": 30})
    spent = 1000 * (time.process_time() - begun) / (3 * len(gyms))
    print(
        f"{len(gyms)} bodies: {spent:.0f} ms of processor time a step, {(megabytes() - before) / len(gyms):.0f} MB each"
    )
    for gym in gyms:
        gym.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--resets", type=int, default=10_000)
    host = Plugins.discover()
    resets(host, parser.parse_args().resets)
    side_by_side(host)


if __name__ == "__main__":
    main()
