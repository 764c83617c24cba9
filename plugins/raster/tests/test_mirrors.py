"""What a mirror shows is what its side of the room would show to the eye behind it; a dark screen shows it faintly."""

from dataclasses import replace

import numpy as np
import pytest

from humanclaw.body import Pose2D, rest_pose
from humanclaw.world import WorldState

RED, BLUE = (220, 40, 40), (40, 40, 220)
BRIGHTNESS = np.linspace(0, 1.15, 1000)


def tone(brightness):
    """Map brightness to what a picture shows: the film curve."""
    share = np.minimum(brightness / 1.15, 1)
    return 255 * share**2 * (3 - 2 * share)


@pytest.fixture
def hall(builder):
    return fill(builder), hang(builder, "mirror")


def fill(builder):
    """Build a wall at z -2. A red board stands at z 3, a blue one behind the wall."""
    builder.box((6, 4, 0.1), (0, -1, -2.06))
    builder.box((0.5, 0.5, 0.02), (-1.0, 0.75, 3.0), RED)
    builder.box((4, 4, 0.02), (0, -1, -2.5), BLUE)
    return builder


def hang(builder, category, colour=(200, 200, 200)):
    """Hang glass of 1.2 m a side on the wall, which faces +Z."""
    corners = [(x, y, 0.0) for x, y in ((-0.6, -0.6), (0.6, -0.6), (0.6, 0.6), (-0.6, 0.6))]
    return builder.sheet(corners, (0, 1, -2), category, colour)


def seen(view, colour):
    """Return the pixels in which the strongest channel of a colour clearly leads."""
    rgb, k = view.rgb.astype(int), int(np.argmax(colour))
    return rgb[..., k] > 1.5 * np.delete(rgb, k, axis=-1).max(-1)


def test_a_board_behind_the_eye_appears_in_the_mirror_by_reflection(hall, camera):
    builder, glass = hall
    view = builder.look(camera((0, 1, 0), (0, 0, -1), 512))
    rows, columns = np.nonzero(seen(view, RED) & (view.ids == glass))
    # Its image is 2 + 5 m ahead, 0.75 to 1.25 m towards -X, which is on the left of who looks along -Z; 256 pixels to
    # the metre at 1 m.
    assert (columns.min() - 256, columns.max() + 1 - 256) == pytest.approx((-45.8, -27.5), abs=2)
    assert (rows.min() - 256, rows.max() + 1 - 256) == pytest.approx((-9.2, 9.2), abs=2)
    assert not seen(view, BLUE).any()
    assert view.depth[256, 256] == pytest.approx(2.0, abs=1e-4)


def test_a_wall_that_goes_on_behind_a_mirror_hides_nothing_in_it(hall, camera):
    builder, glass = hall
    eye = camera((0, 1, 0), (0, 0, -1), 512)
    alone = builder.look(eye)
    builder.sheet([(-1, -1, -3), (3, -1, -1), (3, 3, -1), (-1, 3, -3)], (0, 0, 0), "wall", BLUE)
    board = seen(alone, RED) & (alone.ids == glass)
    assert np.array_equal(seen(builder.look(eye), RED) & board, board)


def test_light_falls_on_a_reflected_box_from_the_side_of_the_box(builder, camera):
    """Without lamps, brightness is 0.7 to -Z and 0.85 to +Z, where the glass faces."""
    glass = hang(builder, "mirror")
    builder.box((0.3, 0.3, 0.3), (0, 0.85, 3), RED)
    view = builder.look(camera((0, 1, 0), (0, 0, -1), 512))
    light = 0.85 * (0.7 * RED[0] / 255) ** 2.2 + 0.15 * (0.85 * 200 / 255) ** 2.2
    shown = view.rgb[(view.ids == glass) & seen(view, RED), 0]
    assert np.median(shown) == pytest.approx(tone(light ** (1 / 2.2)), abs=2)


def test_a_mirror_is_drawn_in_a_picture_one_pixel_wide(hall, camera):
    builder, glass = hall
    view = builder.look(replace(camera((0, 1, -1.9), (0, 0, -1), 300), width=1))
    assert (view.ids == glass).all()


def test_the_body_sees_itself_whole_in_a_mirror(hall, camera):
    builder, glass = hall
    eye = camera((0, 1.6, 0), (0, -0.3, -1), 512)
    empty = builder.look(eye)
    body = Pose2D(0.0, 0.0, np.pi).to_world(rest_pose())
    mirrored = builder.look(eye, WorldState(body, {}))
    changed = (np.abs(mirrored.rgb.astype(int) - empty.rgb) > 20).any(-1) & (mirrored.ids == glass)
    assert changed.sum() > 500
    behind = builder.look(camera((0, 1, -4), (0, 0, 1), 512))
    assert not (seen(behind, RED) & (behind.ids == glass)).any()


@pytest.mark.parametrize(("colour", "reflects"), [((20, 20, 20), True), ((120, 140, 160), False)])
def test_a_screen_reflects_a_fiftieth_of_the_light_while_it_is_dark(builder, camera, colour, reflects):
    screen, eye = hang(fill(builder), "tv", colour), camera((0, 1, 0), (0, 0, -1), 512)
    view = builder.look(eye)
    assert view.ids[256, 219] == screen
    # The middle of the board's image, and the same height on the other side, where nothing is.
    board, empty = (view.rgb[256, 256 + 37 * side].astype(int) for side in (-1, 1))
    sky = np.array([218, 232, 245])
    if reflects:
        own = (np.array(colour) / 255) ** 2.2 * 0.95
        light = own + 0.02 * np.interp(sky, tone(BRIGHTNESS), BRIGHTNESS) ** 2.2
        assert empty == pytest.approx(tone(light ** (1 / 2.2)), abs=2)
        assert empty[2] - board[2] > 5
        assert board[0] - board[2] > 2
    else:
        assert np.abs(board - empty).max() == 0
