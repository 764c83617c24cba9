"""Models from files to assets: reading them, one mesh with one atlas, fewer triangles, and convex pieces to collide
with.

The libraries it needs come with `pip install 'humanclaw[meshes]'` and are loaded when a model is read.
"""

from humanclaw.meshes.baking import area, bake
from humanclaw.meshes.decimation import simplify
from humanclaw.meshes.hulls import KeepOutBox, convex_pieces
from humanclaw.meshes.measure import ANYWHERE, MIDDLE, back_of, seat_of, top_of
from humanclaw.meshes.reading import Part, bounds, read_mesh, read_model, write_model
from humanclaw.meshes.shaping import base_of, exact, lightened, moved, turned, with_lid

__all__ = [
    "ANYWHERE",
    "MIDDLE",
    "KeepOutBox",
    "Part",
    "area",
    "back_of",
    "bake",
    "base_of",
    "bounds",
    "convex_pieces",
    "exact",
    "lightened",
    "moved",
    "read_mesh",
    "read_model",
    "seat_of",
    "simplify",
    "top_of",
    "turned",
    "with_lid",
    "write_model",
]
