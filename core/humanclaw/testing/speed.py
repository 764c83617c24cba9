"""Time and memory of this process. Times are CPU seconds, which other work on the machine disturbs least."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from humanclaw.body.pose import Array
from humanclaw.world.scene import Scene
from humanclaw.world.simulator import Simulator


def reset_times(simulator: Simulator, scene: Scene, count: int) -> tuple[list[float], Array]:
    """Return the CPU milliseconds of loading a scene, and (count,) resident megabytes after each."""
    times, memory = list[float](), list[float]()
    for _ in range(count):
        began = time.process_time()
        simulator.reset(scene, scene.start)
        times.append(1000 * (time.process_time() - began))
        memory.append(resident())
    simulator.close()
    return times, np.array(memory)


def resident(statm: Path = Path("/proc/self/statm")) -> float:
    """Return the resident megabytes of this process; NaN on systems without the file, such as macOS and Windows."""
    if not statm.exists():
        return float("nan")
    pages = int(statm.read_text().split()[1])
    return pages * 4096 / 2**20
