"""Measure steps in this process, or those of Gymnasium and robosuite: python steps.py ours|others. Prints
milliseconds by row for peers.py, which starts it."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from statistics import median
from typing import Any

import numpy as np


def milliseconds(work: Callable[[], object], times: int, samples: int = 5) -> float:
    """Return milliseconds of processor time of one: the median of samples after a first, which counts only if alone."""
    taken = []
    for _ in range(samples + 1):
        began = time.process_time()
        for _ in range(times):
            work()
        taken.append(1e3 * (time.process_time() - began) / times)
    return median(taken[1:] or taken)


def ours() -> dict[str, float]:
    """A substep of half-physics on each engine, one of the engine alone on the same world, and a step of a body."""
    from humanclaw import Body, Call

    times = {}
    for name in ("bullet", "mujoco"):
        times[f"{name}, half-physics"], times[f"{name}, bare"] = substeps(name)
    body = Body("house:0")
    times["humanclaw"] = milliseconds(lambda: body.execute(Call("turn_in_place", {"yaw_deg": 30})), 1)
    return times


def substeps(engine: str) -> tuple[float, float]:
    from humanclaw.laws.fixture import FORWARD, TURN, Fixture

    fixture = Fixture.of(engine)
    simulator, scene = fixture.simulator(), fixture.plugins.scene("house:0")
    motion = fixture.generate(fixture.stand(simulator, scene), {FORWARD: 0.4, TURN: 0.1}, 0)
    count, walked = len(motion) * fixture.profile.substeps, []
    for _ in range(6):
        fixture.stand(simulator, scene)
        walked.append(milliseconds(lambda: simulator.execute(motion), 1, 0) / count)
    world = simulator._loaded().world  # No public door leads to the engine itself.
    bare = world._client.stepSimulation if engine == "bullet" else _one_step(world._m, world._d)
    return median(walked[1:]), milliseconds(bare, count)


def _one_step(model: Any, data: Any) -> Callable[[], None]:
    """Return MuJoCo's next step of a world, always the same one: a limp body gains speed without end."""
    import mujoco

    states = data.qpos, data.qvel, data.qacc_warmstart
    before = [state.copy() for state in states]

    def step() -> None:
        for state, first in zip(states, before, strict=True):
            state[:] = first
        mujoco.mj_step(model, data)

    return step


def others() -> dict[str, float]:
    """A step of Humanoid-v5 and of robosuite's Lift."""
    import gymnasium
    import robosuite

    humanoid = gymnasium.make("Humanoid-v5")
    humanoid.reset(seed=0)
    humanoid.action_space.seed(0)

    def move() -> None:
        *_, over, cut, _ = humanoid.step(humanoid.action_space.sample())
        if over or cut:
            humanoid.reset()

    lift = robosuite.make("Lift", robots="Panda", has_renderer=False, has_offscreen_renderer=False,
                          use_camera_obs=False, ignore_done=True)  # fmt: skip
    lift.reset()
    rng, (low, high) = np.random.default_rng(0), lift.action_spec
    return {
        "humanoid": milliseconds(move, 100),
        "robosuite": milliseconds(lambda: lift.step(rng.uniform(low, high)), 20),
    }


if __name__ == "__main__":
    print(json.dumps(globals()[sys.argv[1]]()))
