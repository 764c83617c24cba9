"""A scene refuses what nobody could act in, where its author has written it."""

from dataclasses import replace

import pytest
from rooms import asset, block

from humanclaw import SceneError

STOOL = asset("stool", "chair", block(0.4, 0.45, 0.4), seat=0.45)


@pytest.mark.parametrize("height", [0.5, 45.0, 0.0, -0.45, float("nan")])
def test_a_seat_that_is_not_on_its_asset_is_refused_with_both_heights(height):
    with pytest.raises(
        SceneError, match=rf"the seat of asset 'stool' is at {height:g} m, and the asset is 0\.45 m high"
    ):
        replace(STOOL, seat_height=height)


def test_a_seat_may_be_below_the_back_and_a_little_above_what_carries_it():
    couch = asset("couch", "couch", block(2.0, 0.42, 0.9), block(2.0, 0.4, 0.25, (0, 0.42, -0.325)), seat=0.42)
    assert replace(couch, seat_height=0.43).seat_height == 0.43
    assert replace(STOOL, seat_height=0.46).seat_height == 0.46


def test_a_seat_without_collision_pieces_carries_nobody():
    with pytest.raises(SceneError, match="has a seat and no collision pieces"):
        replace(STOOL, hulls=())
