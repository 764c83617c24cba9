"""Fewer triangles: what must be the same afterwards."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rooms import asset, block

from humanclaw.world import Mesh, area, exact, read_model, seat_of, simplify

RED, BLUE = 0.25, 0.75
"""Where in the atlas of two colours each has its middle."""
TWO_COLOURS = np.array([[[200, 0, 0], [0, 0, 200]]], np.uint8)


def sheet(x0: float, x1: float, cells: int, uv) -> Mesh:  # type: ignore[no-untyped-def]
    """A flat sheet of 1 m from x0 to x1, of cells by cells squares; uv: from (N, 3) points to (N, 2)."""
    x, z = np.meshgrid(np.linspace(x0, x1, cells + 1), np.linspace(0, 1, cells + 1), indexing="ij")
    points = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=1)
    row, column = np.divmod(np.arange(cells**2), cells)
    a = row * (cells + 1) + column
    faces = np.concatenate([np.stack([a, a + 1, a + cells + 1], 1), np.stack([a + 1, a + cells + 2, a + cells + 1], 1)])
    return Mesh(points.astype(np.float32), faces.astype(np.int32), uv(points).astype(np.float32), TWO_COLOURS)


def together(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]),
        np.concatenate([mesh.uv for mesh in meshes]),
        meshes[0].texture,
    )


def plain(colour: float):  # type: ignore[no-untyped-def]
    return lambda points: np.tile([colour, 0.5], (len(points), 1))


def rows(*columns: np.ndarray) -> set[tuple[float, ...]]:
    return {tuple(row) for row in np.hstack(columns).tolist()}


def ball(rings: int) -> Mesh:
    """A ball of 1 m radius whose picture goes round once and meets itself where it began."""
    turn, rise = np.meshgrid(np.linspace(0, 1, 2 * rings + 1), np.linspace(0, 1, rings + 1), indexing="ij")
    around, up = 2 * np.pi * (turn % 1), np.pi * (rise - 0.5)
    points = np.stack([np.cos(around) * np.cos(up), np.sin(up), np.sin(around) * np.cos(up)], axis=-1).reshape(-1, 3)
    column, row = np.divmod(np.arange(2 * rings * rings), rings)
    a = column * (rings + 1) + row
    faces = np.concatenate([np.stack([a, a + 1, a + rings + 1], 1), np.stack([a + 1, a + rings + 2, a + rings + 1], 1)])
    uv = np.stack([turn.ravel(), rise.ravel()], axis=1)
    return Mesh(np.round(points, 5).astype(np.float32), faces.astype(np.int32), uv.astype(np.float32), TWO_COLOURS)


def test_a_mesh_that_is_light_enough_is_left_alone() -> None:
    mesh = sheet(0, 1, 4, plain(RED))
    assert simplify(mesh, 32) is mesh


def test_a_flat_sheet_keeps_its_corners_and_so_its_whole_surface() -> None:
    less = simplify(sheet(0, 1, 30, plain(RED)), 100)
    assert len(less.faces) <= 100
    assert area(less) == pytest.approx(1.0, abs=1e-6)


def test_a_sheet_that_is_drawn_from_both_sides_keeps_them_both() -> None:
    front = sheet(0, 1, 30, plain(RED))
    back = Mesh(front.vertices, front.faces[:, ::-1], front.uv, front.texture)
    less = simplify(together(front, back), 200)
    assert len(less.faces) <= 200
    assert area(less) == pytest.approx(2.0, abs=1e-6)


def test_where_two_colours_meet_each_keeps_its_half() -> None:
    less = simplify(together(sheet(0, 1, 20, plain(RED)), sheet(1, 2, 20, plain(BLUE))), 100)
    assert len(less.faces) <= 100
    colours, middles = less.uv[less.faces][:, :, 0], less.vertices[less.faces].mean(axis=1)
    assert (colours == np.where(middles[:, :1] < 1, RED, BLUE)).all()
    assert area(less) == pytest.approx(2.0, abs=1e-6)


def test_a_picture_on_a_sheet_stays_where_it_was() -> None:
    less = simplify(sheet(0, 1, 30, lambda points: points[:, [0, 2]]), 100)
    assert less.uv == pytest.approx(less.vertices[:, [0, 2]], abs=1e-6)


def test_every_vertex_that_stays_keeps_its_place_and_uv() -> None:
    mesh = ball(40)
    less = simplify(mesh, 600)
    assert len(less.faces) <= 600
    assert rows(less.vertices) <= rows(mesh.vertices)
    assert rows(less.uv) <= rows(mesh.uv)


def test_no_triangle_of_a_ball_runs_back_through_the_picture() -> None:
    less = simplify(ball(40), 400)
    across = np.ptp(less.uv[less.faces][:, :, 0], axis=1)[np.abs(less.vertices[less.faces][:, :, 1]).max(axis=1) < 0.8]
    assert len(across) > 100
    assert across.max() < 0.3


def test_a_ball_of_400_triangles_is_still_round() -> None:
    less = simplify(ball(40), 400)
    assert area(less) == pytest.approx(4 * np.pi, rel=0.03)
    a, b, c = (less.vertices[less.faces[:, k]].astype(float) for k in range(3))
    assert abs((a * np.cross(b, c)).sum() / 6) == pytest.approx(4 / 3 * np.pi, rel=0.05)


def test_the_same_mesh_gives_the_same_bytes() -> None:
    first, second = simplify(ball(40), 400), simplify(ball(40), 400)
    assert (first.vertices.tobytes(), first.faces.tobytes(), first.uv.tobytes()) == (
        second.vertices.tobytes(), second.faces.tobytes(), second.uv.tobytes(),
    )  # fmt: skip


@pytest.mark.parametrize("where", ["paint.mtl", "../paint.mtl", "sub/../../paint.mtl", "{folder}/paint.mtl"])
def test_a_model_reads_nothing_outside_of_its_folder(tmp_path: Path, where: str) -> None:
    (tmp_path / "paint.mtl").write_text("newmtl red\nKd 1 0 0\n")
    home = tmp_path if where == "paint.mtl" else tmp_path / "models"
    (home / "sub").mkdir(parents=True)
    named = where.format(folder=tmp_path)
    (home / "a.obj").write_text(f"mtllib {named}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n")
    (part,) = read_model(home / "a.obj").parts
    assert (part.colour == (255, 0, 0)) is (where == "paint.mtl")


def test_equal_shapes_have_equal_bytes_also_at_nought() -> None:
    assert exact(np.array([-0.0, -1e-9, 0.123456])).tobytes() == np.float32([0.0, 0.0, 0.12346]).tobytes()


@pytest.mark.parametrize("rim", [0.03, 0.06])
def test_a_toilet_is_sat_on_at_the_rim_of_its_open_bowl(rim: float) -> None:
    """A bowl of 36 by 45 cm whose bottom is at 25 cm and whose rim at 40 cm, with a cistern of 80 cm behind it."""
    sides = [block(rim, 0.4, 0.45, (x * (0.18 - rim / 2), 0, 0)) for x in (-1, 1)]
    ends = [block(0.36, 0.4, rim, (0, 0, z * (0.225 - rim / 2))) for z in (-1, 1)]
    toilet = asset("toilet", "toilet", block(0.36, 0.25, 0.45), *sides, *ends, block(0.36, 0.8, 0.2, (0, 0, -0.325)))
    seat = seat_of(toilet.mesh, "toilet")
    assert seat.height == pytest.approx(0.4, abs=0.002)
    assert seat.room is not None
    assert seat.room.x1 - seat.room.x0 == pytest.approx(0.36, abs=0.03)
    assert seat_of(asset("lid", "toilet", block(0.36, 0.42, 0.65)).mesh, "toilet").height == pytest.approx(0.42)
