"""`humanclaw habitat check` finds scenes without a place to stand, before an episode does."""

from __future__ import annotations

import json
from pathlib import Path

from click.testing import CliRunner, Result
from toy_dataset import box, model, walls, write

from humanclaw import Plugins
from humanclaw.cli import build


def check(*args: object) -> Result:
    return CliRunner().invoke(build(Plugins.discover), ["habitat", "check", *map(str, args)])


def edit(file: Path, **changes: object) -> None:
    write(file, json.loads(file.read_text()) | changes)


def test_a_good_scene_passes(dataset: Path) -> None:
    result = check(dataset)
    assert result.exit_code == 0, result.output
    assert "16 objects (1 movable)" in result.output


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


def test_a_start_on_nothing_fails(mine: Path) -> None:
    # A room is annotated under a roof but without a floor: only the half from x = 4 has a floor.
    model(mine / "stages" / "toy.glb", box((6, -0.1, 0), (8, 0, 6)), *walls()[1:])
    result = check(mine)
    assert result.exit_code == 1
    assert "it moved by [0.0, -1.2" in result.output


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
