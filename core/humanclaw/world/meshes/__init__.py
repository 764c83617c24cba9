"""Models from files to assets: reading them, one mesh with one atlas, fewer triangles, and convex pieces to collide
with.

The libraries it needs come with `pip install 'humanclaw[meshes]'` and are loaded when a model is read.
"""
