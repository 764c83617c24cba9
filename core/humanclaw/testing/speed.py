"""Measure how fast the world runs, for `humanclaw bench-world`. Times are CPU seconds of this process, which other work
on the machine disturbs least."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, TypeVar

import numpy as np

from humanclaw.body.pose import Array, next_history
from humanclaw.testing.fixture import FORWARD, TURN, Fixture, Tick
from humanclaw.world.scene import Scene, SceneObject
from humanclaw.world.simulator import Simulator

T = TypeVar("T")
FIXED, MOVABLE = 300, 60
_APART: Final = 40.0
"""Metres between a house and its copy."""


@dataclass(frozen=True)
class Quartiles:
    """The 25th, 50th and 75th percentiles of measurements."""

    low: float
    median: float
    high: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Quartiles:
        return cls(*(float(value) for value in np.percentile(values, (25, 50, 75))))

    def __str__(self) -> str:
        return f"{self.median:.3g} [{self.low:.3g}, {self.high:.3g}]"


def crowded(scene: Scene, fixed: int = FIXED, movable: int = MOVABLE) -> Scene:
    """Return a house with exact numbers of fixed and movable objects: its own, then copies of them next door."""
    counts, objects = {False: fixed, True: movable}, list[SceneObject]()
    for copy in range(100):
        for obj in scene.objects:
            if counts[obj.movable]:
                counts[obj.movable] -= 1
                objects.append(_copy(obj, len(objects) + 1, copy * _APART))
    return replace(scene, name=f"{scene.name}, crowded", objects=tuple(objects))


def _copy(obj: SceneObject, number: int, shift: float) -> SceneObject:
    x, y, z = obj.position
    return replace(obj, id=number, position=(x + shift, y, z))


def chunk_times(fixture: Fixture, scene: Scene, count: int, tick: Tick) -> list[float]:
    """Return the CPU milliseconds of half seconds of walking, contacts included."""
    simulator, times = fixture.simulator(), []
    history = fixture.stand(simulator, scene)
    for number in range(count):
        command = {FORWARD: 0.4, TURN: np.radians(20 if number % 8 < 4 else -20)}
        motion = fixture.generate(history, command, number)
        milliseconds, execution = _timed(lambda motion=motion: simulator.execute(motion))  # type: ignore[misc]
        times.append(milliseconds)
        history = next_history(history, motion, execution.simulated)
        tick()
    simulator.close()
    return times


def reset_times(simulator: Simulator, scene: Scene, count: int, tick: Tick) -> tuple[list[float], Array]:
    """Return the CPU milliseconds of loading a scene, and (count,) resident megabytes after each."""
    times, memory = [], []
    for _ in range(count):
        times.append(_timed(lambda: simulator.reset(scene, scene.start))[0])
        memory.append(resident())
        tick()
    simulator.close()
    return times, np.array(memory)


def resident(statm: Path = Path("/proc/self/statm")) -> float:
    """Return the resident megabytes of this process; NaN on systems without the file, such as macOS and Windows."""
    if not statm.exists():
        return float("nan")
    pages = int(statm.read_text().split()[1])
    return pages * 4096 / 2**20


def _timed(action: Callable[[], T]) -> tuple[float, T]:
    began = time.process_time()
    done = action()
    return 1000 * (time.process_time() - began), done
