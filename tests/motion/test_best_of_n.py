"""Who stands sets out with one foot: a first step on which both slide is drawn again, and nothing else is."""

import numpy as np
import pytest

from humanclaw.body import Motion, rest_pose
from humanclaw.motion.best_of_n import best_of_n


def _gliding(centimetres: float, frames: int = 15) -> Motion:
    """A statue that is carried ahead: both of its feet slide all the way."""
    motion = rest_pose(frames)
    ahead = np.arange(1, frames + 1)[:, None] / frames * centimetres / 100
    return Motion(motion.root + ahead * [0.0, 0.0, 1.0], motion.rotations)


class _Draws:
    """What each attempt slides by, centimetres, and who was drawn."""

    def __init__(self, *slides: float) -> None:
        self.slides = slides
        self.drawn: list[tuple[int, ...]] = []

    def __call__(self, bodies, attempt):
        self.drawn.append(tuple(bodies))
        return [_gliding(self.slides[attempt]) for _ in bodies]


def _way(motion: Motion) -> float:
    return 100 * float(motion.root[-1, 2])


def test_a_first_step_that_slides_is_drawn_again_until_one_does_not():
    draws = _Draws(8.0, 5.0, 0.5)
    (future,) = best_of_n([rest_pose(5)], draws, 3)
    assert _way(future) == pytest.approx(0.5)
    assert draws.drawn == [(0,), (0,), (0,)]


def test_when_all_slide_the_one_that_slides_least_is_taken():
    draws = _Draws(8.0, 5.0, 7.0, 6.0)
    (future,) = best_of_n([rest_pose(5)], draws, 3)
    assert _way(future) == pytest.approx(5.0)
    assert len(draws.drawn) == 4


def test_who_walks_already_is_drawn_once_however_he_slides():
    walking = _gliding(10.0, 5)
    draws = _Draws(8.0)
    assert _way(best_of_n([walking], draws, 3)[0]) == pytest.approx(8.0)
    assert draws.drawn == [(0,)]


def test_of_many_only_those_that_slide_are_drawn_again():
    draws = _Draws(8.0, 0.5)
    futures = best_of_n([rest_pose(5), _gliding(10.0, 5), rest_pose(5)], draws, 3)
    assert [_way(future) for future in futures] == pytest.approx([0.5, 8.0, 0.5])
    assert draws.drawn == [(0, 1, 2), (0, 2)]
