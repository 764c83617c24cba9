"""CPU milliseconds of 512 x 512 views from the rooms of generated houses: python bench.py [HOUSE ...]"""

from __future__ import annotations

import sys
import time

import numpy as np

from humanclaw import Motion, Plugins, Renderer, Scene
from humanclaw.body import rest_pose
from humanclaw.world import WorldState, ego_camera


def moments(scene: Scene) -> list[WorldState]:
    """Return a body in the middle of each room, each facing another way."""
    found = []
    for number, room in enumerate(scene.rooms):
        body, rotations = rest_pose(), rest_pose().rotations.copy()
        rotations[:, 0] = [0, 0.9 * number, 0]
        middle = np.array([(room.x0 + room.x1) / 2, room.floor, (room.z0 + room.z1) / 2])
        found.append(WorldState(Motion(body.root + middle, rotations), {}))
    return found


def cpu_times(renderer: Renderer, states: list[WorldState]) -> list[float]:
    """Return milliseconds per view: the median of three tries, after one to warm up."""
    times = []
    for state in states:
        camera, tries = ego_camera(state.body), []
        for _ in range(4):
            begin = time.process_time()
            renderer.render(state, camera)
            tries.append(1e3 * (time.process_time() - begin))
        times.append(float(np.median(tries[1:])))
    return times


def main(houses: list[int]) -> None:
    plugins = Plugins.discover()
    renderer = plugins.make("renderers", "raster")
    for house in houses:
        scene = plugins.scene(f"house:{house}")
        triangles = sum(len(scene.assets[obj.asset].mesh.faces) for obj in scene.objects)
        begin = time.process_time()
        renderer.load(scene)
        load = time.process_time() - begin
        times = cpu_times(renderer, moments(scene))
        print(
            f"house:{house}: {len(scene.objects)} objects, {triangles} triangles, {len(scene.rooms)} views: "
            f"{np.median(times):.1f} ms (most {max(times):.1f}), load {load:.1f} s"
        )


if __name__ == "__main__":
    main([int(argument) for argument in sys.argv[1:]] or [0, 1, 2])
