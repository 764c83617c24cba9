"""Tests of films of a recorded episode, with a renderer that paints one colour."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from click.testing import CliRunner
from made import broken_off, record_episode
from PIL import Image
from rooms import UPSTAIRS, asset, block, scene_object, two_rooms, two_storeys

from humanclaw import HumanclawError, Motion, Plugins, RecordedEpisode, RecordError, Scene
from humanclaw.body import JOINT_INDEX, rest_pose
from humanclaw.cli import build
from humanclaw.storage import gif
from humanclaw.world import Camera, View, WorldState, person_id
from humanclaw_report.camera import DISTANCE, FOV, follow, framed
from humanclaw_report.film import GIF_SIZE, film
from humanclaw_report.playback import FilmScene, opened
from humanclaw_report.poses import moments, poses
from humanclaw_report.replay import replay
from humanclaw_report.shots import in_the_way, left_out


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


def cut(monkeypatch: pytest.MonkeyPatch, episode: RecordedEpisode, frames: int) -> None:
    first = episode.motion()[:frames]
    monkeypatch.setattr(RecordedEpisode, "motion", lambda episode: first)


def test_the_camera_keeps_its_distance_and_moves_smoothly(made: tuple[RecordedEpisode, Scene]) -> None:
    motion = made[0].motion()
    eyes = follow(motion)
    assert np.linalg.norm(eyes - motion.root, axis=1) == pytest.approx(DISTANCE, abs=0.4)
    assert np.linalg.norm(np.diff(eyes, axis=0), axis=1).max() < 0.25, "metres a frame"


def test_films_and_pages_show_the_other_bodies_too(
    made: tuple[RecordedEpisode, Scene], monkeypatch: pytest.MonkeyPatch
) -> None:
    episode, scene = made
    other = episode.motion()
    monkeypatch.setattr(RecordedEpisode, "people", lambda self: {person_id(1): other})
    shown = FilmScene.of(episode, scene).state(7).people
    assert np.array_equal(shown[person_id(1)].root, other.root[7:8])
    paged = replay(episode, {}, [])
    assert paged
    assert {"person0_root", "person0_turns"} <= {array["name"] for array in paged["motion"]["arrays"]}


def gesture(joint: str, turn: tuple[float, float, float]) -> Motion:
    """Return a second in which one joint turns there and back, rotation vector in radians."""
    motion = Motion(*(np.repeat(part, 31, 0) for part in (rest_pose().root, rest_pose().rotations)))
    motion.rotations[:, JOINT_INDEX[joint]] += np.sin(np.linspace(0, np.pi, 31))[:, None] * turn
    return motion


@pytest.mark.parametrize(
    ("motion", "least", "most"),
    [(gesture("head", (0.35, 0, 0)), 0.6, 1.0), (gesture("head", (0, 0.5, 0)), 0.6, 1.0),
     (gesture("left_hip", (-0.5, 0, 0)), 1.8, 2.8)],
    ids=["nod", "shake", "kick"],
)  # fmt: skip
def test_on_an_open_floor_the_moving_parts_fill_the_picture(motion: Motion, least: float, most: float) -> None:
    """The picture is as high, metres at the body, as a head with a margin, or as a whole person."""
    eyes, centres = framed(motion)
    assert least < 2 * np.linalg.norm(eyes - centres, axis=1).min() * np.tan(np.radians(FOV / 2)) < most


def test_on_an_open_floor_all_of_a_walk_is_in_the_picture(made: tuple[RecordedEpisode, Scene]) -> None:
    motion = made[0].motion()
    looks = zip(*framed(motion), motion.joints(), strict=True)
    seen = np.stack([Camera.looking(eye, centre, FOV, (160, 90)).pixels(joints) for eye, centre, joints in looks])
    assert ((seen > 0) & (seen < [160, 90])).all()
    assert np.ptp(seen[0, :, 1]) > 0.5 * 90, "large while it stands"


def test_a_wall_is_left_out_of_a_shot_in_which_it_hides_the_body(made: tuple[RecordedEpisode, Scene]) -> None:
    episode, scene = made
    wall = asset("behind", "wall", block(2.0, 2.5, 0.1))
    at = scene_object(90, wall, scene.start.x, scene.start.z - 0.6)
    walled = replace(scene, assets=scene.assets | {"behind": wall}, objects=(*scene.objects, at))
    hidden = FilmScene.of(episode, walled).hidden
    assert 90 in hidden[0]
    assert 90 not in hidden[-1]


def test_the_target_is_in_all_of_the_film(made: tuple[RecordedEpisode, Scene]) -> None:
    assert not any(made[0].record.targets.keys() & hidden for hidden in FilmScene.of(*made).hidden)


def test_a_thing_comes_and_goes_only_at_a_cut(made: tuple[RecordedEpisode, Scene]) -> None:
    film_scene = FilmScene.of(*made)
    changes = {frame for frame, (a, b) in enumerate(pairwise(film_scene.hidden), start=1) if a != b}
    jumps = np.linalg.norm(np.diff(film_scene.eyes, axis=0), axis=1) > 0.3
    assert changes
    assert changes <= set(np.flatnonzero(jumps) + 1)


def test_the_camera_goes_where_the_couch_hides_less_of_the_body(made: tuple[RecordedEpisode, Scene]) -> None:
    episode, scene = made
    joints, film_scene = episode.motion().joints(), FilmScene.of(episode, scene)
    chosen, behind = (in_the_way(scene, joints, eyes)[20][-15:] for eyes in (film_scene.eyes, follow(episode.motion())))
    assert (chosen < behind).all()


def test_a_film_of_an_open_floor_is_one_shot(made: tuple[RecordedEpisode, Scene]) -> None:
    episode, scene = made
    assert len(set(FilmScene.of(episode, replace(scene, rooms=())).hidden)) == 1


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


@pytest.mark.integration
def test_a_short_film_begins_and_ends_with_a_still_second(
    made: tuple[RecordedEpisode, Scene], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A call of half a second is over before one looks."""
    episode, scene = made
    cut(monkeypatch, episode, 20)
    path = film(episode, replace(scene, rooms=()), Painter(), tmp_path / "film.mp4", every=2, size=(160, 120))
    frames = imageio_ffmpeg.read_frames(str(path))
    next(frames)
    assert sum(1 for _ in frames) == 15 + 10 + 15


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


def test_a_gif_lasts_as_long_as_what_it_shows(tmp_path: Path) -> None:
    """Three seconds of 15 pictures a second; a picture lasts 6 or 7 hundredths, since there are no others."""
    rng = np.random.default_rng(0)
    gif(list(rng.integers(0, 256, (45, 16, 16, 3), np.uint8)), tmp_path / "a.gif", 15.0)
    with Image.open(tmp_path / "a.gif") as film:
        times = [(film.seek(number), film.info["duration"])[1] for number in range(film.n_frames)]
    assert (len(times), sum(times), set(times)) == (45, 3000, {60, 70})


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
    film_scene = FilmScene.of(*climbed)
    below, whole = ({scene_object.id for scene_object in shown.objects} for shown in film_scene.scenes)
    assert whole == {scene_object.id for scene_object in climbed[1].objects}
    assert whole - below == {o.id for o in climbed[1].objects if o.position[1] > 2}
    heights = film_scene.motion.root[:, 1]
    assert (film_scene.storeys[heights < UPSTAIRS - 0.3] == 0).all()
    assert (film_scene.storeys[heights > UPSTAIRS + 0.3] == 1).all()
    assert (np.diff(film_scene.storeys) >= 0).all(), "it does not flicker"


def test_what_hangs_on_a_thing_or_stands_on_it_is_left_out_with_it() -> None:
    wall, frame, crate = (
        asset("w", "wall", block(4, 2.5, 0.1)),
        asset("p", "picture", block(0.6, 0.4, 0.03)),
        asset("c", "box", block(0.4, 0.4, 0.4)),
    )
    placed = (scene_object(90, wall, 4, 3), scene_object(91, frame, 4, 3.08, y=1.4), scene_object(92, crate, 4, 3.4),
              scene_object(93, frame, 4, 4.5, y=1.4), scene_object(94, crate, 4, 3.4, y=0.4))  # fmt: skip
    plain = two_rooms()
    assets = plain.assets | {asset.name: asset for asset in (wall, frame, crate)}
    scene = replace(plain, assets=assets, objects=(*plain.objects, *placed))
    assert left_out(scene, {90}, frozenset()) == {90, 91}
    assert left_out(scene, {92}, frozenset()) == {92, 94}
    assert left_out(scene, {92}, frozenset({94})) == set(), "a target would float"


def test_the_renderer_is_given_each_storey_once(climbed: tuple[RecordedEpisode, Scene], tmp_path: Path) -> None:
    painter = Painter()
    film(*climbed, painter, tmp_path / "film.gif", kind="gif", every=15, size=(160, 120))
    assert [len(scene.objects) for scene in painter.scenes] == [len(s.objects) for s in FilmScene.of(*climbed).scenes]


def test_the_camera_follows_the_body_upstairs(climbed: tuple[RecordedEpisode, Scene]) -> None:
    film_scene = FilmScene.of(*climbed)
    assert np.linalg.norm(film_scene.eyes - film_scene.motion.root, axis=1) == pytest.approx(DISTANCE, abs=0.4)
    assert (film_scene.eyes[film_scene.storeys == 1, 1] > UPSTAIRS).all()


def test_an_episode_without_motion_cannot_be_filmed(tmp_path: Path) -> None:
    scene = record_episode(tmp_path)
    broken_off(tmp_path)
    (tmp_path / "motion.npz").unlink()
    with pytest.raises(RecordError, match="holds no motion"):
        film(RecordedEpisode(tmp_path), scene, Painter(), tmp_path / "film.mp4")


def test_a_gif_that_would_fill_memory_is_refused(made: tuple[RecordedEpisode, Scene], tmp_path: Path) -> None:
    with pytest.raises(HumanclawError, match=r"a GIF of \d+ frames is too large at every=1 and 4096 x 4096"):
        film(*made, Painter(), tmp_path / "film.gif", kind="gif", every=1, size=(4096, 4096))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--height", "16000"], "16000 is not in the range"),
        (["--every", "0"], "0 is not in the range"),
        (["--renderer", "unheard-of"], "there is no renderer 'unheard-of'"),
        (["--out", "film.avi"], "a film ends in .mp4 or .gif; got film.avi"),
    ],
)
def test_a_wrong_option_of_film_is_told_in_a_sentence(
    made: tuple[RecordedEpisode, Scene], options: list[str], message: str
) -> None:
    done = CliRunner().invoke(build(Plugins.discover), ["film", str(made[0].folder), *options])
    assert done.exit_code == 2
    assert message in " ".join(done.output.split())


def test_the_moving_picture_of_the_readme_is_small_enough_to_load() -> None:
    path = Path(__file__).parents[3] / "examples" / "images" / "demo.gif"
    with Image.open(path) as gif:
        assert gif.size == GIF_SIZE
        assert gif.n_frames > 20
    assert path.stat().st_size < 3_000_000


def test_an_episode_is_one_picture_of_its_bodies(made: tuple[RecordedEpisode, Scene], tmp_path: Path) -> None:
    episode, scene = made
    with Image.open(poses(episode, scene, Painter(), tmp_path / "bodies.png", (160, 90))) as picture:
        assert picture.size == (160, 90)
        assert np.ptp(np.asarray(picture)) > 100, "the labels"


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_picture_of_a_body_that_stays_has_one_of_it(
    made: tuple[RecordedEpisode, Scene], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    episode, scene = made
    cut(monkeypatch, episode, 15)
    assert poses(episode, scene, Painter(), tmp_path / "bodies.png", (160, 90)).is_file()


def test_bodies_are_drawn_a_metre_apart_and_once_where_they_end() -> None:
    # It walks 3 m in 30 frames and then sways on the spot, .2 m to and fro.
    ahead = np.concatenate([np.arange(31) / 10, np.tile([3.2, 3.0], 10)])
    assert moments(np.stack([0 * ahead, 0 * ahead + 0.9, ahead], -1)) == [0, 10, 20, 50]
