"""The bench's own arithmetic, and that loading a scene again and again keeps no memory."""

from dataclasses import replace

import numpy as np

from humanclaw_bullet.profile import find_profile
from humanclaw_bullet.speed import Quartiles, crowded, reset_times


def test_a_crowded_house_has_as_many_objects_as_asked_for_and_its_own_come_first(workshop):
    workshop.floor()
    workshop.box("box", (0.3, 0.3, 0.3), (1, 0, 1), movable=True, mass=1.0)
    scene = crowded(workshop.scene(), fixed=3, movable=2)
    assert [thing.movable for thing in scene.objects] == [False, True, False, True, False]
    assert [thing.id for thing in scene.objects] == [1, 2, 3, 4, 5]
    assert [thing.position[0] for thing in scene.objects] == [0, 1, 40, 41, 80]


def test_quartiles_are_those_of_the_numbers():
    assert str(Quartiles.of([1, 2, 3, 4, 5])) == "3 [2, 4]"


def test_resetting_keeps_no_memory(workshop):
    """Neither of boxes nor of a hundred other shapes, which are given to the engine in a different way."""
    workshop.room()
    random = np.random.default_rng(0)
    for number in range(100):
        thing = workshop.box(f"rock {number}", (0.1, 0.1, 0.1), (random.uniform(-1.5, 1.5), 3, 1))
        name = workshop.objects[thing - 1].asset
        hull = random.uniform(0, 0.1, (12, 3)).astype(np.float32)
        workshop.assets[name] = replace(workshop.assets[name], hulls=(hull,))
    _, memory = reset_times(find_profile("default"), workshop.scene(), 40, lambda: None)
    assert memory[-1] - memory[9] < 2.0
