"""Models from files to assets: reading them, one mesh with one atlas, fewer triangles, and convex pieces to collide with.

The libraries it needs come with `pip install 'humanclaw[meshes]'` and are loaded when a model is read.
"""

from humanclaw.meshes.baking import area, bake
from humanclaw.meshes.decimation import simplify
from humanclaw.meshes.hulls import convex_pieces
from humanclaw.meshes.reading import Part, read_model, write_model

__all__ = ["Part", "area", "bake", "convex_pieces", "read_model", "simplify", "write_model"]
