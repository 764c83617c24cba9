"""Views with labels, from houses that no split of the benchmark has.

Views from random places are drawn without physics, with the body in poses that it takes when it moves. Views of
rollouts are those that an agent comes to see: with the pilot as the agent, its own mistakes are in the next data (as in
DAgger, Ross et al. 2011), labelled by the simulator.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import Gym, Plugins, Scene, TaskError
from humanclaw.body import Motion, Pose2D
from humanclaw.storage import write_atomically
from humanclaw.world import BODY_ID, GAZES, Camera, MultiFloorMap, View, WorldState, ego_camera
from humanclaw_pilot.network import CATEGORIES, CELLS, CLASSES, halved

FLAT: Final = 0.03
"""What is this near to the floor counts as floor, metres."""
SHOWN: Final = 12
"""Pixels of a cell's 64 from which it shows a target."""
FARTHEST: Final = 15.0
"""Largest depth, metres."""


@dataclass(frozen=True, eq=False)
class Example:
    """A view and what the network should say of it."""

    picture: NDArray[np.uint8]
    """(SIZE, SIZE, 3)"""
    kinds: NDArray[np.uint8]
    """(CELLS, CELLS) index in CLASSES."""
    depth: NDArray[np.float16]
    """(CELLS, CELLS) metres along the optical axis."""


def example(view: View, scene: Scene, camera: Camera, floor: float) -> Example:
    """Label a view by the simulator's ids and depth. floor: height of the floor that the body stands on, metres."""
    side = len(view.ids) // CELLS
    depth = np.minimum(np.where(np.isfinite(view.depth), view.depth, FARTHEST), FARTHEST)
    rise = camera.forward[1] + (1 - (np.arange(len(depth)) + 0.5) / (len(depth) / 2))[:, None] * camera.up[1]
    flat = np.abs(camera.position[1] + depth * rise - floor) < FLAT
    of_id = np.zeros(max(thing.id for thing in scene.objects) + 2, int)
    of_id[BODY_ID] = CLASSES.index("body")
    for number, category in enumerate(CATEGORIES, 3):
        of_id[[thing.id for thing in scene.of_category(category)]] = number
    kinds = np.where(flat & (view.ids != BODY_ID) & (of_id[view.ids] == 0), 1, of_id[view.ids])
    cell = np.arange(len(depth)) // side
    place = (cell[:, None] * CELLS + cell) * len(CLASSES) + kinds
    counts = np.bincount(place.ravel(), minlength=CELLS**2 * len(CLASSES)).reshape(-1, len(CLASSES))
    logs = np.bincount(place.ravel(), np.log(depth).ravel(), CELLS**2 * len(CLASSES)).reshape(counts.shape)
    shows = counts[:, 3:].max(1) >= SHOWN
    shown = np.where(shows, 3 + counts[:, 3:].argmax(1), counts[:, :3].argmax(1))
    mean = np.take_along_axis(logs / np.maximum(counts, 1), shown[:, None], 1)
    shape = CELLS, CELLS
    return Example(halved(view.rgb), shown.astype(np.uint8).reshape(shape), np.exp(mean).astype("f2").reshape(shape))


def written(path: Path, examples: Sequence[Example]) -> None:
    """Write examples to a file, whole or not at all."""
    content, names = io.BytesIO(), vars(examples[0])
    columns: dict[str, Any] = {name: np.stack([getattr(example, name) for example in examples]) for name in names}
    np.savez(content, **columns)
    write_atomically(path, content.getvalue())


# -- rollouts ----------------------------------------------------------------------------------------------------------
def played(plugins: Plugins, agent: str, options: Mapping[str, Any], first: int, seeds: Sequence[int], steps: int
           ) -> Iterator[tuple[Example, Motion]]:  # fmt: skip
    """Let an agent play training tasks in the house `first`; yield each view with its labels, and the pose.

    Seeds without a task there are left out."""
    with Gym("train", options={"first": first, "houses": 1}, plugins=plugins) as gym:
        for seed in seeds:
            teacher = plugins.make("agents", agent, options)
            try:
                turn = gym.reset(seed)
            except TaskError:
                continue
            episode = gym.episode
            teacher.begin(gym.context)
            while not turn.done and len(episode.steps) < steps:
                body = episode.body
                pose, floor = body.state().body[-1:], Pose2D.of(body.history).floor
                yield example(body.view(), body.scene, ego_camera(pose), floor), pose
                turn = gym.submit(teacher.decide(turn.observation, episode.history))


# -- random places -----------------------------------------------------------------------------------------------------
def planted(plugins: Plugins, number: int, poses: Sequence[Motion], count: int) -> Iterator[Example]:
    """Yield views from random places of a training house; two of three look towards a target.

    Raises HumanclawError for a house of dev or of hidden tests."""
    plugins.make("tasks", "train", {"first": number, "houses": 1})
    scene, rng = plugins.scene(f"house:train-{number}"), np.random.default_rng([number, 41])
    renderer = plugins.make("renderers", "raster")
    renderer.load(scene)
    start = np.array([scene.start.x, scene.start.floor, scene.start.z])
    places = np.concatenate(MultiFloorMap.of(scene).starts(start, 0.2))
    for _ in range(count):
        place = _place(scene, places, rng)
        pose = poses[int(rng.integers(len(poses)))]
        pose = place.to_world(Pose2D.of(pose).to_local(pose))
        camera = ego_camera(pose, gaze=GAZES["body"])
        yield example(renderer.render(WorldState(pose, {}), camera), scene, camera, place.floor)
    renderer.close()


def _place(scene: Scene, places: NDArray[Any], rng: np.random.Generator) -> Pose2D:
    """Draw one of the (N, 3) places and a heading."""
    here, yaw = places[int(rng.integers(len(places)))], float(rng.uniform(-np.pi, np.pi))
    present = [things for things in map(scene.of_category, CATEGORIES) if things]
    if present and rng.random() < 0.67:
        of_kind = present[int(rng.integers(len(present)))]
        target = np.array(of_kind[int(rng.integers(len(of_kind)))].position)
        gaps = np.linalg.norm((places - target)[:, [0, 2]], axis=1) + 10 * np.abs(places[:, 1] - target[1]) // 15
        near = places[gaps < rng.uniform(0.8, 6)]
        here = near[int(rng.integers(len(near)))] if len(near) else here
        yaw = float(np.arctan2(*(target - here)[[0, 2]]) + rng.normal(0, 0.4))
    return Pose2D(float(here[0]), float(here[2]), yaw, float(here[1]))
