"""Read a folder of model files, and compare triangles and surface with what trimesh reads of each.

`HUMANCLAW_MODELS=FOLDER python tests/evidence/models.py` prints the files on which the two differ, or of which
something is left out: triangles and surface here, then with trimesh, and why.
"""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

import numpy as np
import trimesh

from humanclaw.errors import SceneError
from humanclaw.world import read_model

KINDS = {".glb", ".gltf", ".obj", ".off", ".ply", ".stl"}
Row = tuple[str, str, str]


def ours(path: Path) -> Row:
    """Return triangles, surface and what was left out; or why a file is refused."""
    try:
        model = read_model(path)
    except SceneError as error:
        if "holds no triangle" in error.message:
            return "0", "0", ""
        return "refused", "", error.message.replace(str(path), "it")
    corners = np.concatenate([part.vertices[part.faces] for part in model.parts])
    return str(len(corners)), f"{surface(corners):.4g}", "; ".join(model.left_out)


def theirs(path: Path) -> Row:
    try:
        scene = trimesh.load_scene(path, process=False)
        corners = [mesh.triangles for mesh in scene.dump() if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces)]
    except Exception as error:  # It raises errors of many types.
        return "refused", "", type(error).__name__
    triangles = np.concatenate(corners) if corners else np.zeros((0, 3, 3))
    return str(len(triangles)), f"{surface(triangles):.4g}", ""


def surface(corners: np.ndarray) -> float:
    return float(
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    )


def main() -> None:
    folder = Path(os.environ["HUMANCLAW_MODELS"])
    count: Counter[str] = Counter()
    for path in sorted(file for file in folder.rglob("*") if file.suffix.lower() in KINDS):
        own, other = ours(path), theirs(path)
        alike = own[:2] == other[:2]
        count["alike" if alike else "other"] += 1
        count["refused"] += own[0] == "refused"
        count["refused by trimesh"] += other[0] == "refused"
        count["with something left out"] += own[0] != "refused" and bool(own[2])
        if not alike or own[2]:
            print(
                f"| {path.relative_to(folder)} | {own[0]} | {own[1]} | {other[0]} | {other[1]} | {own[2]} |", flush=True
            )
    print(dict(count))


if __name__ == "__main__":
    main()
