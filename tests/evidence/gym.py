"""Measure the gym: time of a reset and memory over many, and sixteen bodies in one process.

python tests/evidence/gym.py --resets 10000
python tests/evidence/gym.py --resets 10000 --client     # through OpenEnv's own client
"""

from __future__ import annotations

import argparse
import socket
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np

from humanclaw import Gym, Plugins
from humanclaw.testing import resident

ENVIRONMENTS = 16


def repeated(what: str, begin: Callable[[int], object], count: int) -> None:
    """Begin task 0, 1, ... count; print memory on the way, and the processor time of a reset of this process."""
    begin(0)
    begun, times = resident(), []
    for number in range(1, count + 1):
        before = time.process_time(), time.perf_counter()
        begin(number)
        times.append((time.process_time() - before[0], time.perf_counter() - before[1]))
        if number in {count // 10, count // 2, count}:
            spread = np.percentile(1000 * np.array(times), (50, 95, 99, 100), axis=0).T
            processor, clock = (" / ".join(f"{value:.0f}" for value in row) for row in spread)
            print(f"{number} {what}: {begun:.0f} MiB at first, {resident():.0f} now", flush=True)
            print(f"  ms at 50 / 95 / 99 / 100 %: {processor} of processor time, {clock} by the clock", flush=True)


@contextmanager
def served(gym: Callable[[], Gym]) -> Iterator[str]:
    """Serve a gym to OpenEnv's clients from a thread of this process."""
    import uvicorn

    from humanclaw_openenv.server import app

    with socket.create_server(("127.0.0.1", 0)) as taken:
        server = uvicorn.Server(uvicorn.Config(app(gym, 1), log_level="warning"))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [taken]})
        thread.start()
        while not server.started:
            time.sleep(0.05)
        yield f"http://127.0.0.1:{taken.getsockname()[1]}"
        server.should_exit = True
        thread.join()


def by_client(gym: Callable[[], Gym], count: int) -> None:
    """Reset by OpenEnv's client: in one session, in a new session each, and by HTTP requests, which have no session."""
    import requests
    from openenv import GenericEnvClient

    with served(gym) as address:

        def session(number: int) -> None:
            with GenericEnvClient(base_url=address).sync() as client:
                client.reset(seed=number)

        def request(number: int) -> None:
            requests.post(f"{address}/reset", json={"seed": number}, timeout=60).raise_for_status()

        repeated("requests of a body each", request, count // 10)
        repeated("sessions of a body each", session, count // 10)
        with GenericEnvClient(base_url=address).sync() as env:
            repeated("resets in a session", lambda number: env.reset(seed=number), count)


def turns(gym: Gym, count: int = 3) -> None:
    """Turn a body on the spot."""
    for _ in range(count):
        gym.call("turn_in_place", {"thoughts": "", "yaw_deg": 30})


def side_by_side(make: Callable[[], Gym]) -> None:
    """Step sixteen bodies, each in a thread; print steps a second, processor time of a step, memory of a body."""
    before = resident()
    gyms = [make() for _ in range(ENVIRONMENTS)]
    for seed, gym in enumerate(gyms):
        gym.reset(seed)
        turns(gym, 1)  # The first call of a skill reads its weights.
    spent, begun = time.process_time(), time.perf_counter()
    with ThreadPoolExecutor(len(gyms)) as pool:
        list(pool.map(turns, gyms))
    steps, took = 3 * len(gyms), time.perf_counter() - begun
    each, memory = 1000 * (time.process_time() - spent) / steps, (resident() - before) / len(gyms)
    print(
        f"{len(gyms)} bodies at once: {steps / took:.1f} steps a second, {each:.0f} ms of processor time a step, "
        f"{memory:.0f} MiB each"
    )
    for gym in gyms:
        gym.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--resets", type=int, default=10_000)
    parser.add_argument("--client", action="store_true", help="reset through OpenEnv's client")
    asked = parser.parse_args()
    options: dict[str, Any] = {"houses": 1}
    make = partial(Gym, "approach", options=options, plugins=Plugins.discover())
    if asked.client:
        by_client(make, asked.resets)
        return
    with make() as gym:
        repeated("resets", gym.reset, asked.resets)
    side_by_side(make)


if __name__ == "__main__":
    main()
