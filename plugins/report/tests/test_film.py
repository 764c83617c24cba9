"""Tests of films and posters of a recorded episode, with a renderer that paints one colour."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import imageio_ffmpeg
import numpy as np
import pytest
from click.testing import CliRunner
from made import broken_off, record_episode
from PIL import Image
from rooms import UPSTAIRS, asset, block, scene_object, two_rooms, two_storeys

from humanclaw import HumanclawError, Plugins, RecordedEpisode, RecordError, Scene
from humanclaw.cli import build
from humanclaw.world import Camera, View, WorldState
from humanclaw_report.camera import DISTANCE, follow, sight
from humanclaw_report.film import GIF_SIZE, film, poster
from humanclaw_report.playback import AHEAD, Replay, hung_on, opened


class Painter:
    """Paints everything orange and remembers the scenes that it loaded."""

    def __init__(self) -> None:
        self.scenes: list[Scene] = []

    def load(self, scene: Scene) -> None:
        self.scenes.append(scene)

    def render(self, state: WorldState, camera: Camera) -> View:
        shape = (camera.height, camera.width)
        rgb = np.broadcast_to(np.array([230, 120, 40], np.uint8), (*shape, 3))
        return View(rgb, np.ones(shape, np.float32), np.zeros(shape, np.int32))

    def close(self) -> None: ...


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[RecordedEpisode, Scene]:
    folder = tmp_path_factory.mktemp("film")
    scene = record_episode(folder)
    return RecordedEpisode(folder), scene


def test_the_camera_sees_the_body_nearly_all_the_time(made: tuple[RecordedEpisode, Scene]) -> None:
    episode, scene = made
    plan, motion = sight(scene, 0.0), episode.motion()
    eyes = follow([plan], np.zeros(len(motion), int), motion)
    seen = [plan.sees(eye, root) for eye, root in zip(eyes, motion.root, strict=True)]
    assert np.mean(seen) > 0.95, "only the swing through the doorway may hide it"


def test_the_camera_keeps_its_distance_and_moves_smoothly(made: tuple[RecordedEpisode, Scene]) -> None:
    episode, scene = made
    motion = episode.motion()
    eyes = follow([sight(scene, 0.0)], np.zeros(len(motion), int), motion)
    assert np.linalg.norm(eyes - motion.root, axis=1) == pytest.approx(DISTANCE, abs=0.4)
    assert np.linalg.norm(np.diff(eyes, axis=0), axis=1).max() < 0.25, "metres a frame"


@pytest.mark.integration
@pytest.mark.parametrize("every", [2, 3])
def test_an_mp4_lasts_as_long_as_the_episode(made: tuple[RecordedEpisode, Scene], tmp_path: Path, every: int) -> None:
    episode, scene = made
    path = film(episode, scene, Painter(), tmp_path / "film.mp4", every=every, size=(160, 120))
    frames = imageio_ffmpeg.read_frames(str(path))
    meta = next(frames)
    assert meta["size"] == (160, 120)
    assert meta["fps"] == pytest.approx(30 / every)
    assert sum(1 for _ in frames) == len(range(0, len(episode.motion()), every))


def test_a_gif_shows_the_ego_view_in_the_corner(made: tuple[RecordedEpisode, Scene], tmp_path: Path) -> None:
    episode, scene = made
    path = film(episode, scene, Painter(), tmp_path / "film.gif", kind="gif", every=15, size=(160, 120))
    with Image.open(path) as gif:
        assert gif.n_frames == len(range(0, len(episode.motion()), 15))
        gif.seek(4)
        picture = np.asarray(gif.convert("RGB")).astype(int)
    orange = np.abs(picture - [230, 120, 40]).sum(-1) < 60
    assert orange[44:80, 20:60].all()
    assert not orange[16:44, 112:144].all()


def test_a_poster_has_the_width_that_was_asked_for(made: tuple[RecordedEpisode, Scene], tmp_path: Path) -> None:
    path = poster(*made, Painter(), tmp_path / "poster.png", moments=3, width=800)
    with Image.open(path) as image:
        assert image.width == 800
        assert len(image.getcolors(1 << 20) or ()) > 10


def test_the_camera_looks_in_from_above_where_the_ceiling_was(made: tuple[RecordedEpisode, Scene]) -> None:
    lid = asset("lid", "ceiling", block(8, 0.1, 6))
    closed = replace(
        made[1], assets={**made[1].assets, "lid": lid}, objects=(*made[1].objects, scene_object(90, lid, 4, 3, y=2.5))
    )
    assert [o.id for o in opened(closed).objects] == [o.id for o in made[1].objects]


@pytest.fixture(scope="module")
def climbed(tmp_path_factory: pytest.TempPathFactory) -> tuple[RecordedEpisode, Scene]:
    """Record an episode from the ground floor of a house with two storeys to the bed upstairs."""
    folder = tmp_path_factory.mktemp("climbed")
    scene = record_episode(folder, two_storeys(), instruction="sit on the bed", targets=(31,))
    return RecordedEpisode(folder), scene


def test_the_upper_storey_is_shown_once_the_body_is_on_it(climbed: tuple[RecordedEpisode, Scene]) -> None:
    replay = Replay.of(*climbed)
    below, whole = ({scene_object.id for scene_object in shown.objects} for shown in replay.scenes)
    assert whole == {scene_object.id for scene_object in climbed[1].objects}
    assert whole - below == {o.id for o in climbed[1].objects if o.position[1] > 2}
    heights = replay.motion.root[:, 1]
    assert (replay.storeys[heights < UPSTAIRS - 0.3] == 0).all()
    assert (replay.storeys[heights > UPSTAIRS + 0.3] == 1).all()
    assert (np.diff(replay.storeys) >= 0).all(), "it does not flicker"


def test_what_hangs_on_a_wall_is_left_out_with_it() -> None:
    wall, frame, crate = (
        asset("w", "wall", block(4, 2.5, 0.1)),
        asset("p", "picture", block(0.6, 0.4, 0.03)),
        asset("c", "box", block(0.4, 0.4, 0.4)),
    )
    placed = (scene_object(90, wall, 4, 3), scene_object(91, frame, 4, 3.08, y=1.4), scene_object(92, crate, 4, 3.2),
              scene_object(93, frame, 4, 4.5, y=1.4))  # fmt: skip
    scene = two_rooms()
    assets = scene.assets | {one.name: one for one in (wall, frame, crate)}
    assert hung_on(replace(scene, assets=assets, objects=(*scene.objects, *placed)), 90) == {91}


def test_what_gets_in_the_way_fades_in_time_whatever_the_pace_of_the_film(made: tuple[RecordedEpisode, Scene]) -> None:
    replay = Replay.of(*made)
    wall = frozenset({1})
    replay = replace(replay, hidden=(frozenset(),) * 20 + (wall,) * (len(replay.hidden) - 20))
    shares = [replay.fading(frame)[1] for frame in range(19, 20 + AHEAD + 1)]
    assert shares[0] == shares[-1] == 0.0, "not yet, and no more once the wall is in the way"
    assert shares[1:-1] == sorted(shares[1:-1], reverse=True)
    assert replay.fading(25)[0] == frozenset()


def test_the_renderer_is_given_each_storey_once(climbed: tuple[RecordedEpisode, Scene], tmp_path: Path) -> None:
    painter = Painter()
    film(*climbed, painter, tmp_path / "film.gif", kind="gif", every=15, size=(160, 120))
    assert [len(scene.objects) for scene in painter.scenes] == [len(s.objects) for s in Replay.of(*climbed).scenes]


def test_the_camera_follows_the_body_upstairs_and_sees_it(climbed: tuple[RecordedEpisode, Scene]) -> None:
    replay = Replay.of(*climbed)
    assert np.linalg.norm(replay.eyes - replay.motion.root, axis=1) == pytest.approx(DISTANCE, abs=0.4)
    above = replay.storeys == 1
    assert (replay.eyes[above, 1] > UPSTAIRS).all()
    for k, floor in enumerate((0.0, UPSTAIRS)):
        here = replay.storeys == k
        seen = sight(replay.scenes[k], floor).sees(replay.eyes[here], replay.motion.root[here])
        assert seen.mean() > 0.9


def test_a_camera_sees_down_the_well_of_the_stairs_and_not_through_the_floor() -> None:
    plan = sight(two_storeys(), UPSTAIRS)
    eye, on_step, below_floor = np.array([3.0, 5.0, 0.5]), np.array([4.0, 2.4, 0.5]), np.array([3.0, 1.5, 2.2])
    assert plan.sees(eye, on_step)
    assert not plan.sees(eye, below_floor)


def test_a_poster_of_a_climb_has_a_map_of_each_storey(climbed: tuple[RecordedEpisode, Scene], tmp_path: Path) -> None:
    path = poster(*climbed, Painter(), tmp_path / "poster.png", moments=3, width=800)
    with Image.open(path) as image:
        picture = np.asarray(image.convert("RGB")).astype(int)
    red, green, blue = np.moveaxis(picture, -1, 0)
    rows = np.flatnonzero(((green > red + 40) & (green > blue + 20)).any(1))
    assert image.width == 800
    assert len(rows) > 0
    assert rows.max() < image.height / 2, "the bed is upstairs, and that is drawn on top"


def test_an_episode_without_motion_cannot_be_filmed(tmp_path: Path) -> None:
    scene = record_episode(tmp_path)
    broken_off(tmp_path)
    (tmp_path / "motion.npz").unlink()
    with pytest.raises(RecordError, match="holds no motion"):
        film(RecordedEpisode(tmp_path), scene, Painter(), tmp_path / "film.mp4")


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"size": (16_000, 9_000)}, "16 to 4096 pixels wide and high; got 16000 x 9000"),
        ({"size": (160, 0)}, "got 160 x 0"),
        ({"every": 0}, "begin at 1; got 0"),
    ],
)
def test_a_film_that_no_encoder_makes_is_refused_before_a_picture_is_drawn(
    made: tuple[RecordedEpisode, Scene], tmp_path: Path, wrong: dict[str, Any], told: str
) -> None:
    painter = Painter()
    with pytest.raises(HumanclawError, match=told):
        film(*made, painter, tmp_path / "film.mp4", **wrong)
    assert painter.scenes == []
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"width": 10**6}, "16 to 4096 pixels"),
        ({"width": 80}, "16 to 4096 pixels"),
        ({"moments": 10**9}, "16 to 4096 pixels"),
        ({"moments": 0}, "begin at 1; got 0"),
    ],
)
def test_a_poster_without_bounds_is_refused(
    made: tuple[RecordedEpisode, Scene], tmp_path: Path, wrong: dict[str, Any], told: str
) -> None:
    with pytest.raises(HumanclawError, match=told):
        poster(*made, Painter(), tmp_path / "poster.png", **wrong)


def test_a_gif_that_would_fill_memory_is_refused(made: tuple[RecordedEpisode, Scene], tmp_path: Path) -> None:
    with pytest.raises(HumanclawError, match=r"a GIF of \d+ frames is too large at every=1 and 4096 x 4096"):
        film(*made, Painter(), tmp_path / "film.gif", kind="gif", every=1, size=(4096, 4096))


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--height", "16000"], "16000 is not in the range"),
        (["--every", "0"], "0 is not in the range"),
        (["--renderer", "unheard-of"], "there is no renderer 'unheard-of'"),
        (["--out", "film.avi"], "a film ends in .mp4 or .gif; got film.avi"),
    ],
)
def test_a_wrong_option_of_film_is_told_in_a_sentence(
    made: tuple[RecordedEpisode, Scene], options: list[str], told: str
) -> None:
    done = CliRunner().invoke(build(Plugins.discover), ["film", str(made[0].folder), *options])
    assert done.exit_code == 2
    assert told in " ".join(done.output.split())


def test_the_moving_picture_of_the_readme_is_small_enough_to_load() -> None:
    path = Path(__file__).parents[3] / "examples" / "images" / "demo.gif"
    with Image.open(path) as gif:
        assert gif.size == GIF_SIZE
        assert gif.n_frames > 20
    assert path.stat().st_size < 3_000_000
