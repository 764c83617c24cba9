"""Whether a body can begin in a scene at all: it is put into the simulator once."""

from __future__ import annotations

import numpy as np

from humanclaw import Plugins, Scene, SceneError, default_simulator
from humanclaw.world import OccupancyGrid
from humanclaw_habitat.starting import indoors


def check_start(scene: Scene, plugins: Plugins) -> None:
    """Raise SceneError if the scene has no floor, or its start is outside, in something or on nothing."""
    if not any(thing.category == "floor" and scene.assets[thing.asset].hulls for thing in scene.objects):
        raise SceneError(
            "it has no floor that bears anybody.", "Does its stage have a level surface, and is it collidable?"
        )
    plan = OccupancyGrid.of(scene, scene.start.floor)
    if not plan.at(indoors(scene, plan), np.array([scene.start.x, scene.start.z])):
        raise SceneError("its start is outside, or in something.", "Is there free floor within its rooms?")
    simulator = plugins.make("simulators", default_simulator(plugins), profile="default")
    try:
        # It lets the body stand for half a second, and refuses a start where that falls or is pushed away.
        simulator.reset(scene, scene.start)
    finally:
        simulator.close()
