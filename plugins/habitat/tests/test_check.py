"""`humanclaw habitat check` finds scenes without a place to stand, before an episode does."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import trimesh
from click.testing import CliRunner, Result
from toy_dataset import PLACED, box, model, walls, write

from humanclaw import Plugins
from humanclaw.cli import build

pytestmark = pytest.mark.integration


def check(*args: object) -> Result:
    return CliRunner().invoke(build(Plugins.discover), ["habitat", "check", *map(str, args)])


def edit(file: Path, **changes: object) -> None:
    write(file, json.loads(file.read_text()) | changes)


def test_a_scene_without_a_floor_fails(mine: Path) -> None:
    model(mine / "stages" / "toy.glb", box((0, 0, 0), (0.1, 2.7, 6)))
    result = check(mine)
    assert result.exit_code == 1
    assert "no floor" in result.output


def test_a_building_that_bears_nobody_fails(mine: Path) -> None:
    edit(mine / "stages" / "toy.stage_config.json", is_collidable=False)
    result = check(mine)
    assert result.exit_code == 1
    assert "no floor" in result.output


def test_the_start_is_where_an_annotated_room_really_has_a_floor(mine: Path) -> None:
    model(mine / "stages" / "toy.glb", box((6, -0.1, 0), (8, 0, 6)), *walls()[1:])
    result = check(mine)
    assert "room 'living room': no floor is under it" in result.output
    assert result.exit_code == 0, result.output


def test_rooms_annotated_below_the_building_keep_the_starts_floor(mine: Path) -> None:
    below = {"name": "cellar", "poly_loop": [[x, -2, z] for x, z in ((-9, -9), (9, -9), (9, 9), (-9, 9))],
             "floor_height": -2.0, "extrusion_height": 4.0}  # fmt: skip
    edit(mine / "semantics" / "scenes" / "toy1.semantic_config.json", region_annotations=[below])
    result = check(mine)
    assert "room 'cellar': no floor is under it" in result.output
    assert result.exit_code == 0, result.output


def test_a_stage_of_one_thin_sheet_is_a_floor_whichever_way_it_faces(mine: Path) -> None:
    for turned in (False, True):
        sheet = trimesh.Trimesh([(0, 0, 0), (8, 0, 0), (8, 0, 6), (0, 0, 6)], [(0, 2, 1), (0, 3, 2)])
        sheet.invert() if turned else None
        model(mine / "stages" / "toy.glb", sheet)
        result = check(mine)
        assert result.exit_code == 0, (turned, result.output)


def test_a_start_in_something_fails(mine: Path) -> None:
    model(mine / "stages" / "toy.glb", *walls(), box((0, 0.5, 0), (8, 1.5, 6)))
    model(mine / "stages" / "shell.glb", *walls(), box((-1, 0.1, -1), (9, 1.5, 7)))
    edit(mine / "stages" / "toy.stage_config.json", collision_asset="shell.glb")
    result = check(mine)
    assert result.exit_code == 1
    assert "fails: its start is" in result.output


def test_the_start_is_in_the_house_and_not_on_the_lawn(mine: Path) -> None:
    (mine / "semantics" / "scenes" / "toy1.semantic_config.json").unlink()
    model(mine / "stages" / "toy.glb", *walls(), box((-20, -0.1, -20), (28, -0.001, 26)))
    start = Plugins.discover().scene(f"hssd:{mine}#toy1").start
    assert 0 < start.x < 8
    assert 0 < start.z < 6
    assert check(mine).exit_code == 0


def test_what_falls_out_of_the_house_is_named(mine: Path) -> None:
    placed = [dict(entry) for entry in PLACED]
    placed[3]["translation"] = [20, 1, 5]
    edit(mine / "scenes" / "toy1.scene_instance.json", object_instances=placed)
    assert "falls: object 4 (cup)" in check(mine).output


def test_what_was_left_out_is_told_and_ends_with_one(mine: Path) -> None:
    (mine / "objects" / "t" / "tv1.glb").unlink()
    result = check(mine, "--skip")
    assert result.exit_code == 1
    assert "left out: object 1 (tv1)" in result.output


def test_one_scene_that_cannot_be_loaded_costs_no_other(mine: Path) -> None:
    (mine / "scenes" / "broken.scene_instance.json").write_text("nothing")
    result = check(mine)
    assert result.exit_code == 1
    assert "broken fails" in result.output
    assert "16 objects" in result.output
