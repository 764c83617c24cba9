"""ObjectNav episodes as a split: headings and places by hand, and the oracle from start to end."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from toy_dataset import HALF, episode, write, write_episodes

from humanclaw import Body, EpisodeSpec, Plugins, RecordedEpisode, run_episode
from humanclaw.body import Pose2D, wrap_angle
from humanclaw.cli import build
from humanclaw.records import read_episodes
from humanclaw_bench.scores import score
from humanclaw_scripted.oracle import OracleAgent

GOALS = {"toy1_couch": [{"object_id": 0, "position": [7.3, 0.4, 3.0]}], "toy1_tv": [{"object_id": "1"}]}
BACK = [0, 1, 0, 0]
"""A half turn: the agent then looks to +Z in Habitat."""


def run(*args: object) -> Result:
    return CliRunner().invoke(build(Plugins.discover), ["habitat", *map(str, args)])


def made(
    dataset: Path, folder: Path, *episodes: dict[str, Any], goals: Any = GOALS, flags: tuple[str, ...] = ()
) -> Any:
    """The command's result and the split that it wrote."""
    place = write_episodes(folder / "objectnav", list(episodes), goals)
    out = folder / "split.jsonl"
    result = run("episodes", dataset, place, "--out", out, *flags)
    return result, read_episodes(out) if out.exists() else ()


def read_one(dataset: Path, folder: Path, *args: Any, **more: Any) -> EpisodeSpec:
    result, specs = made(dataset, folder, episode(7, *args, **more))
    assert result.exit_code == 0, result.output
    (spec,) = specs
    return spec


@pytest.mark.parametrize(
    ("rotation", "ahead"),
    [
        ([0, 0, 0, 1], (0, -1)),  # Habitat's forward is -Z.
        ([0, HALF, 0, HALF], (-1, 0)),  # A quarter turn to the left.
        ([0, -HALF, 0, HALF], (1, 0)),  # To the right.
        ([1, 0, 0, 0], (0, -1)),  # The first and the second with w first: an upright body turns about Y alone.
        ([HALF, 0, HALF, 0], (-1, 0)),
        (BACK, (0, 1)),
    ],
)
def test_the_body_looks_where_habitats_agent_looks(dataset: Path, tmp_path: Path, rotation: list, ahead: tuple) -> None:
    yaw = read_one(dataset, tmp_path, "couch", [2, 0.1, 2], rotation).start.yaw
    np.testing.assert_allclose((np.sin(yaw), np.cos(yaw)), ahead, atol=1e-3)


@pytest.mark.integration
def test_the_body_really_faces_that_way_in_the_scene(dataset: Path, tmp_path: Path) -> None:
    start = read_one(dataset, tmp_path, "couch", [2, 0.1, 2], [0, -HALF, 0, HALF]).start
    with Body(f"hssd:{dataset}#toy1", Pose2D(start.x, start.z, start.yaw, start.floor)) as body:
        state, view = body.state(), body.view()
    np.testing.assert_allclose(state.body.root[-1][[0, 2]], (2, 2), atol=0.02)
    assert float(wrap_angle(state.body.yaw()[-1] - np.pi / 2)) == pytest.approx(0, abs=0.05)
    assert 1 in view.ids  # The couch at +X shows through the doorway.


def test_the_start_is_on_the_floor_and_the_targets_are_the_goals(dataset: Path, tmp_path: Path) -> None:
    spec = read_one(dataset, tmp_path, "couch", [2, 0.12, 2], BACK)
    assert (spec.start.x, spec.start.z, spec.start.floor) == (2, 2, 0)
    assert (spec.target_category, spec.target_ids, spec.interact) == ("couch", (1,), True)
    assert spec.id == "toy1-couch-7"
    assert spec.scene_digest == Plugins.discover().scene(spec.scene).digest


def test_the_difficulty_is_that_of_the_way(dataset: Path, tmp_path: Path) -> None:
    difficulty = read_one(dataset, tmp_path, "couch", [2, 0.1, 3], BACK).difficulty
    # From x = 2 straight through the doorway to 0.28 m or more before the couch's edge at x = 6.85; the grid is 5 cm.
    assert difficulty is not None
    assert 4.3 < difficulty.distance < 4.85 - 0.28 + 0.05
    assert (difficulty.turns, difficulty.rooms) == (0, 2)


def test_the_reference_releases_offset_is_the_start(dataset: Path, tmp_path: Path) -> None:
    # start_position floats 0.7 m over the floor: too much to be accepted without init_offset.
    spec = read_one(dataset, tmp_path, "tv", [6, 0.7, 1], BACK, init_offset=[-6, 1, 0.0])
    assert (spec.start.x, spec.start.z, spec.start.floor) == (6, 1, 0)
    inner = read_one(dataset, tmp_path / "2", "tv", [6, 0.7, 1], BACK, info={"init_offset": [-6, 1, 0.0]})
    assert (inner.start.x, inner.start.z, inner.start.floor) == (6, 1, 0)


@pytest.mark.parametrize(
    "goal",
    [
        {"object_id": "77", "object_name": "couch1_:0000", "position": [7.3, 0.4, 3.0]},
        {"object_id": 1, "object_name": "couch_12", "position": [7.3, 0.4, 3.0]},  # The id is that of another object.
        {"object_id": "sofa 3", "position": [7.0, 0.5, 3.5]},
        {"object_id": 0, "object_name": "couch1"},
    ],
)
def test_a_goal_is_found_by_name_and_place_and_the_id_is_a_hint(dataset: Path, tmp_path: Path, goal: dict) -> None:
    result, (spec,) = made(dataset, tmp_path, episode(0, "couch", [2, 0, 2], BACK), goals={"toy1_couch": [goal]})
    assert result.exit_code == 0, result.output
    assert spec.target_ids == (1,)


def test_the_hint_decides_between_two_at_the_place(mine: Path, tmp_path: Path) -> None:
    file = mine / "scenes" / "toy1.scene_instance.json"
    scene = json.loads(file.read_text())
    scene["object_instances"].append(scene["object_instances"][0])
    write(file, scene)
    for number, (hint, target) in enumerate([(0, 1), (5, 6), (99, 1)]):
        goals = {"toy1_couch": [{"object_id": hint, "object_name": "couch1_:0000", "position": [7.3, 0.4, 3.0]}]}
        _, (spec,) = made(mine, tmp_path / f"{number}", episode(0, "couch", [2, 0, 2], BACK), goals=goals)
        assert spec.target_ids == (target,)


def test_an_id_alone_is_not_believed_if_it_is_that_of_another_kind(dataset: Path, tmp_path: Path) -> None:
    result, _ = made(dataset, tmp_path, episode(0, "couch", [2, 0, 2], BACK), goals={"toy1_couch": [{"object_id": 1}]})
    assert result.exit_code == 2
    assert "1 goals are not in the scene" in result.output


def test_one_bad_file_and_one_bad_episode_cost_no_other(dataset: Path, tmp_path: Path) -> None:
    place = write_episodes(
        tmp_path / "objectnav", [episode(0, "tv", [2, 0, 2], BACK), episode(1, "tv", [2, 0], BACK)], GOALS
    )
    (place / "content" / "broken.json.gz").write_bytes(b"nothing")
    out = tmp_path / "split.jsonl"
    assert run("episodes", dataset, place, "--out", out).exit_code == 2
    result = run("episodes", dataset, place, "--out", out, "--skip")
    assert result.exit_code == 1, result.output
    assert [spec.id for spec in read_episodes(out)] == ["toy1-tv-0"]
    assert "broken.json.gz: it cannot be read" in result.output
    assert "toy1.json.gz: episode 1: start_position" in result.output


def test_a_goal_that_nothing_in_the_scene_answers_is_named(dataset: Path, tmp_path: Path) -> None:
    goals = {"toy1_couch": [*GOALS["toy1_couch"], {"object_id": 8, "position": [1, 0.4, 3]}]}
    result, _ = made(dataset, tmp_path, episode(0, "couch", [2, 0, 2], BACK), goals=goals)
    assert result.exit_code == 2
    assert "goal 1 of couch" in result.output
    result, (spec,) = made(
        dataset, tmp_path / "2", episode(0, "couch", [2, 0, 2], BACK), goals=goals, flags=("--skip",)
    )
    assert (result.exit_code, spec.target_ids) == (1, (1,))


def test_names_of_other_datasets_are_understood(dataset: Path, tmp_path: Path) -> None:
    goals = {"toy1.glb_sofa": GOALS["toy1_couch"]}
    sofa = episode(0, "sofa", [2, 0.1, 2], BACK, scene_id="hssd-hab/toy1.glb")
    result, specs = made(dataset, tmp_path, sofa, episode(1, "piano", [2, 0.1, 2], BACK), goals=goals)
    assert [spec.target_category for spec in specs] == ["couch"]
    assert "left out: piano is not among chair" in result.output
    assert result.exit_code == 1


def test_goals_may_stand_in_the_episode_itself(dataset: Path, tmp_path: Path) -> None:
    result, (spec,) = made(dataset, tmp_path, episode(0, "tv", [2, 0.1, 2], BACK, goals=[{"object_id": 1}]), goals={})
    assert result.exit_code == 0
    assert spec.target_ids == (2,)


@pytest.mark.parametrize(
    ("task", "goals", "said"),
    [
        (("couch", [2, 0.1, 2], BACK), {}, "the file has no goals"),
        (("couch", [2, 0.1, 2], BACK), {"toy1_couch": [{"object_id": 99}]}, "1 goals are not in the scene"),
        (
            ("couch", [2, 0.1, 2], BACK),
            {"toy1_couch": [{"object_id": 2, "position": [4.85, 0.4, 3]}]},
            "the nearest couch is 2.0 m from",
        ),
        (("couch", [2, 3.1, 2], BACK), GOALS, "the floors are at 0"),
        (("couch", [20, 0.1, 2], BACK), GOALS, "no route from its start"),
    ],
)
def test_an_episode_that_the_scene_does_not_bear_out_is_named(
    dataset: Path, tmp_path: Path, task: tuple, goals: Any, said: str
) -> None:
    result, _ = made(dataset, tmp_path, episode(5, *task), goals=goals)
    assert result.exit_code == 2
    assert "episode 5" in result.output
    assert said in result.output
    result, specs = made(dataset, tmp_path / "2", episode(5, *task), episode(6, "tv", [2, 0, 2], BACK),
                         goals={"toy1_tv": GOALS["toy1_tv"], **goals}, flags=("--skip",))  # fmt: skip
    assert result.exit_code == 1, result.output
    assert [spec.id for spec in specs] == ["toy1-tv-6"]
    assert said in result.output


def test_episodes_of_one_number_get_names_of_their_own(dataset: Path, tmp_path: Path) -> None:
    _, specs = made(dataset, tmp_path, *(episode(3, "tv", [2, 0.1, z], BACK) for z in (2, 3, 4)))
    assert [spec.id for spec in specs] == ["toy1-tv-3", "toy1-tv-3..1", "toy1-tv-3..2"]
    assert [spec.seed for spec in specs] == [0, 1, 2]


def test_a_file_that_holds_no_episodes_is_named(dataset: Path, tmp_path: Path) -> None:
    out = ["--out", str(tmp_path / "x.jsonl")]
    broken = tmp_path / "broken.json.gz"
    broken.write_bytes(b"nothing")
    result = run("episodes", str(dataset), str(broken), *out)
    assert result.exit_code == 2
    assert "broken.json.gz" in result.output
    with gzip.open(broken, "wt") as text:
        json.dump({"episodes": [{"episode_id": 1, "scene_id": "toy1"}]}, text)
    result = run("episodes", str(dataset), str(broken), *out)
    assert result.exit_code == 2
    assert "start_position" in result.output
    result = run("episodes", str(dataset), str(tmp_path / "empty"), *out)
    assert "holds no episodes" in result.output


def test_the_list_of_all_episodes_leads_to_the_files_of_the_scenes(dataset: Path, tmp_path: Path) -> None:
    place = write_episodes(tmp_path / "objectnav", [episode(0, "tv", [2, 0, 2], BACK)], GOALS)
    out = tmp_path / "split.jsonl"
    assert run("episodes", dataset, place / "val.json.gz", "--out", out).exit_code == 0
    assert len(read_episodes(out)) == 1


def test_scenes_are_listed_and_checked(dataset: Path) -> None:
    listed = run("scenes", str(dataset))
    assert listed.output == f"hssd:{dataset}#toy1\n"
    checked = run("check", str(dataset))
    assert checked.exit_code == 0, checked.output
    assert "16 objects (1 movable)" in checked.output
    assert "2 rooms; chair 1, couch 1, potted_plant 1, tv 1" in checked.output


@pytest.mark.integration
def test_the_oracle_finds_the_couch_and_sits_on_it(dataset: Path, tmp_path: Path) -> None:
    spec = read_one(dataset, tmp_path, "couch", [2, 0.1, 2], [0, -HALF, 0, HALF])
    with Body(spec.scene, spec.start, seed=spec.seed) as body:
        record = run_episode(body, spec, OracleAgent(), folder=tmp_path / "episode")
    assert record.outcome == "stopped"
    scored = score(RecordedEpisode(tmp_path / "episode"))
    assert (scored.find, scored.nav, scored.interact) == (True, True, True)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"start_rotation": [0, np.nan, 0, 1]}, "finite"),
        ({"start_rotation": [HALF, HALF, 0, 0]}, "a body stands upright"),
        ({"start_position": [2, np.inf, 2]}, "finite"),
        ({"init_offset": [-2, 2, np.nan]}, "finite"),
    ],
)
def test_a_number_of_no_use_costs_its_episode_and_not_the_split(
    dataset: Path, tmp_path: Path, wrong: dict, said: str
) -> None:
    good, bad = episode(7, "couch", [2, 0.1, 2], BACK), episode(8, "couch", [2, 0.1, 2], BACK) | wrong
    result, specs = made(dataset, tmp_path, good, bad, flags=("--skip",))
    assert result.exit_code == 1
    assert "episode 8" in result.output
    assert said in result.output
    assert [spec.id for spec in specs] == ["toy1-couch-7"]
