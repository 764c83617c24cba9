"""Compute the skins of humanclaw.body from shape.py alone: `make skin`. The same shapes give the same bytes.

Marching cubes of one half, fewer triangles where it is flat, cut where clothes meet, weights by joint, mirrored.
"""

from __future__ import annotations

import sys
from pathlib import Path

import fast_simplification
import numpy as np
from numpy.typing import NDArray
from people import PEOPLE
from safetensors.numpy import save_file
from scipy.spatial import cKDTree
from shape import (
    BIND_POSE,
    POSITIONS,
    SOLE,
    Build,
    arm,
    body,
    face,
    hand,
    layers,
    leg,
    local,
    ramp,
    shoe,
    torso,
)  # fmt: skip
from skimage.measure import marching_cubes

from humanclaw.body import JOINT_INDEX, JOINTS, PARENTS, REGIONS, Array

Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]
Mesh = tuple[Array, Indices, Indices]
"""Points, faces, and the region of each face."""
STEP = 0.005
"""Side of a cell in which the surface is sought, metres: half of it doubles detail and takes eight times as long."""
SHOE = 0.0748
"""Height of the ankle over the sole, metres."""
LOW, HIGH = np.array([0.0, -0.99, -0.21]), np.array([0.78, 0.80, 0.27])
"""Corners of the box around the left half in its bind pose, metres."""
HAND = (0.50, -0.17, -0.02), (0.70, 0.03, 0.16)
"""Corners of the place where steps are half as wide: fingers are 4 mm apart."""
HALF_FACES = 2900
"""Of the left half: more cost time in each picture, fewer show their edges."""
STEEP = 10.0
"""Slope of the planes at which cloth ends, for the borders of regions: steep ones are straight."""


# -- surface -----------------------------------------------------------------------------------------------------------
def surface(build: Build) -> tuple[Array, Array]:
    """Return vertices and faces of the left half, open at x = 0."""
    axes = [
        np.sort(np.append(np.arange(low, high, STEP), np.arange(start, end, STEP) + STEP / 2))
        for low, high, start, end in zip(LOW, HIGH, *HAND, strict=True)
    ]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    shape = points.shape[:3]
    field = np.concatenate([body(part.reshape(-1, 3), build) for part in np.array_split(points, 40)])
    cells, faces, _, _ = marching_cubes(field.reshape(shape), 0.0)
    vertices = np.stack([np.interp(cells[:, k], np.arange(len(axis)), axis) for k, axis in enumerate(axes)], 1)
    return settled(vertices, build), faces.astype(np.int64)


def gradient(points: Array, build: Build) -> Array:
    """Return (N, 3) unit normals of the shape by central differences."""
    e = 0.0015
    there = np.stack([body(points + e * axis, build) - body(points - e * axis, build) for axis in np.eye(3)], -1)
    there[points[:, 0] < 1e-6, 0] = 0
    return np.asarray(there / np.maximum(np.linalg.norm(there, axis=1, keepdims=True), 1e-9))


def settled(points: Array, build: Build, rounds: int = 3) -> Array:
    """Move points onto the surface, along its normals; points at x = 0 stay there."""
    middle = points[:, 0] < 1e-5
    for _ in range(rounds):
        points = points - 0.8 * np.clip(body(points, build), -0.01, 0.01)[:, None] * gradient(points, build)
        points[middle, 0] = 0
        points[:, 0] = np.maximum(points[:, 0], 0)
    return points


def unfolded(points: Array, faces: Indices, build: Build) -> Array:
    """Move the corners of faces that look inwards to the middle of their neighbours, until none does."""
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    sides = np.concatenate([sides, sides[:, ::-1]])
    count = np.bincount(sides[:, 0], minlength=len(points))[:, None]
    for _ in range(8):
        a, b, c = (points[faces[:, k]] for k in range(3))
        folded = (np.cross(b - a, c - a) * gradient((a + b + c) / 3, build)).sum(axis=1) <= 0
        bad = np.unique(faces[folded])
        bad = bad[points[bad, 0] > 1e-6]
        mean = np.stack([np.bincount(sides[:, 0], points[sides[:, 1], axis], len(points)) for axis in range(3)], 1)
        points = points.copy()
        points[bad] = (mean / count)[bad]
        points = settled(points, build, 1)
    return points


def importance(points: Array) -> Array:
    """Return how much larger a place is made while the mesh is simplified: face and hand keep more triangles."""
    h, w = local(points, "head"), local(points, "left_wrist")
    face = ramp((h[:, 2] + 0.06) / 0.13) * ramp((h[:, 1] + 0.05) / 0.06)
    return np.asarray(1 + 0.6 * ramp((h[:, 1] + 0.06) / 0.10) + 1.3 * face + 0.8 * ramp((w[:, 0] + 0.01) / 0.03))


def simplified(points: Array, faces: Array, count: int) -> tuple[Array, Array]:
    """Return a mesh with so many triangles, whose vertices are some of the given ones."""
    grown = points * 1.0
    for joint in ("head", "left_wrist"):
        centre = POSITIONS[JOINT_INDEX[joint]]
        near = np.linalg.norm(points - centre, axis=1) < 0.4
        mask = near & (local(points, joint)[:, 1 if joint == "head" else 0] > -0.06)
        grown[mask] = centre + (points[mask] - centre) * importance(points)[mask, None]
    grown[points[:, 0] < 1e-5, 0] = 0
    moved, thin = fast_simplification.simplify(
        (grown * 1e3).astype(np.float32), faces.astype(np.int32), target_count=count
    )
    _, nearest = cKDTree(grown).query(moved / 1e3)
    edge = np.abs(moved[:, 0]) < 0.3
    middle = np.flatnonzero(points[:, 0] < 1e-5)
    _, on = cKDTree(grown[middle]).query(moved[edge] / 1e3)
    nearest[edge] = middle[on]
    return points[nearest], thin.astype(np.int64)


# -- regions -----------------------------------------------------------------------------------------------------------
def cut(points: Array, faces: Indices, values: Array, where: Mask | None = None) -> tuple[Array, Indices, Indices]:
    """Split the faces along the line where values are 0; return points, faces, and each new face's old one.

    where: (M,) faces that are split; a neighbour follows where it shares an edge.
    """
    sides = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    edges = np.unique(sides[np.tile(np.ones(len(faces), bool) if where is None else where, 3)], axis=0)
    points, values = _taken_along(points, values, edges)
    edges = edges[values[edges[:, 0]] * values[edges[:, 1]] < 0]
    (a, b), (here, there) = edges.T, values[edges.T]
    new = points[a] + (here / (here - there))[:, None] * (points[b] - points[a])
    number = {edge: len(points) + k for k, edge in enumerate(map(tuple, edges.tolist()))}
    points = np.concatenate([points, new])
    pieces = [(piece, k) for k, face in enumerate(faces.tolist()) for piece in _pieces(face, number, points)]
    return points, np.array([piece for piece, _ in pieces]), np.array([k for _, k in pieces])


def _taken_along(points: Array, values: Array, edges: Indices) -> tuple[Array, Array]:
    """Move the points that are close to the line onto it, so that no slivers appear; the middle stays in the middle."""
    points, values = points.copy(), values.copy()
    for start, end in np.concatenate([edges, edges[:, ::-1]]).tolist():
        here, there = values[start], values[end]
        stays = points[start, 0] <= 1e-6 < points[end, 0]
        if here * there < 0 and abs(here) < 0.2 * abs(here - there) and not stays:
            points[start] += here / (here - there) * (points[end] - points[start])
            values[start] = 0
    return points, values


def _pieces(face: list[int], number: dict[tuple[int, int], int], points: Array) -> list[list[int]]:
    """Return the triangles of a face of which none, one or two edges are split."""
    ring = []
    for k in range(3):
        ring.append(face[k])
        a, b = sorted((face[k], face[(k + 1) % 3]))
        ring += [number[a, b]] if (a, b) in number else []
    turns = [ring[k:] + ring[:k] for k in range(len(ring))]
    if len(ring) == 3:
        return [ring]
    if len(ring) == 4:
        a, b, c, d = next(turn for turn in turns if turn[0] not in face)
        return [[a, b, c], [a, c, d]]
    # Two new points with one corner of the face between them; the rest is cut along its shorter diagonal.
    a, b, c, d, e = next(turn for turn in turns if turn[0] not in face and turn[2] not in face)
    short = np.linalg.norm(points[a] - points[d]) < np.linalg.norm(points[c] - points[e])
    return [[a, b, c], *([[a, c, d], [a, d, e]] if short else [[c, d, e], [c, e, a]])]


def outlined(mesh: Mesh, wanted: str, corners: list[tuple[float, float]]) -> Mesh:
    """Give the skin inside a convex outline on the face, (x, y) in the head's frame, counter-clockwise, a region."""
    points, faces, label = mesh
    inside = (label == REGIONS.index("skin")) & (local(points, "head")[faces].mean(1)[:, 2] > 0.055)
    for a, b in zip(np.array(corners), np.roll(corners, -1, axis=0), strict=True):
        normal = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)
        points, faces, source = cut(points, faces, (local(points, "head")[:, :2] - a) @ normal, inside)
        label, inside = label[source], inside[source]
        inside &= (local(points, "head")[faces].mean(1)[:, :2] - a) @ normal > 0
    return points, faces, np.where(inside, REGIONS.index(wanted), label)


EYE = [(0.0315 + 0.0118 * np.cos(t), 0.0825 + 0.006 * np.sin(t)) for t in np.linspace(0, 2 * np.pi, 9)[:-1] + np.pi / 8]
BROW = ((0.014, 0.1005), (0.034, 0.1065), (0.034, 0.1105), (0.014, 0.1065)), (
    (0.034, 0.1065), (0.047, 0.1015), (0.047, 0.1035), (0.034, 0.1105),
)  # fmt: skip
LIPS = [(-0.01, 0.0105), (0.010, 0.0115), (0.0205, 0.0185), (0.009, 0.0250), (0.0, 0.0245), (-0.01, 0.0250)]


def regions(points: Array, faces: Indices, build: Build) -> Mesh:
    """Split the faces at the borders of the pieces of clothing; return points, faces and (M,) region of each face."""
    names = list(layers(points[:1], build))
    for name in names:
        found = layers(points, build, STEEP)
        values = found[name] - np.min([found[other] for other in names if other != name], axis=0)
        points, faces, _ = cut(points, faces, values)
    found = layers(points[faces].mean(1), build, STEEP)
    label = np.array([REGIONS.index(name) for name in names])[np.argmin([found[name] for name in names], axis=0)]
    shoes = label == REGIONS.index("shoes")
    height = local(points, "left_ankle")[:, 1] + SHOE - SOLE
    points, faces, source = cut(points, faces, height, shoes)
    low = local(points[faces].mean(1), "left_ankle")[:, 1] + SHOE < SOLE
    label = np.where(shoes[source] & low, REGIONS.index("soles"), label[source])
    mesh = points, faces, label
    for region, outline in (("eyes", EYE), ("brows", BROW[0]), ("brows", BROW[1]), ("lips", LIPS)):
        mesh = outlined(mesh, region, list(outline))
    return mesh


# -- weights -----------------------------------------------------------------------------------------------------------
BLENDS = {
    # joint: direction in its own rest frame's world axes, half-width (metres) of the bend
    "spine1": ((0, 1, 0), 0.055), "spine2": ((0, 1, 0), 0.06), "spine3": ((0, 1, 0), 0.06),
    "neck": ((0, 1, 0.15), 0.045),
    "head": ((0, 0.75, 0.66), 0.04), "left_collar": ((1, 0, 0), 0.05), "left_shoulder": ((0.94, -0.30, 0), 0.075),
    "left_elbow": ((1, 0, 0), 0.06), "left_wrist": ((1, 0, 0), 0.045), "left_hand": ((1, 0, 0), 0.02),
    "left_hip": ((0.22, -0.94, 0.20), 0.10), "left_knee": ((0, -1, 0.0), 0.075), "left_ankle": ((0, -0.93, 0.36), 0.04),
    "left_foot": ((0, 0, 1), 0.03),
}  # fmt: skip
"""Where a joint bends the skin: a direction (bind pose for trunk, shoulder and hip; else the joint's frame) and the
distance over which the turn goes from nothing to all."""
OWN_FRAME = {"left_elbow", "left_wrist", "left_hand", "left_knee", "left_ankle", "left_foot"}


def memberships(points: Array, build: Build) -> dict[str, Array]:
    """Return for some joints the share (0 to 1) of each point that may follow them at all."""
    inner = np.min([torso(points, build), leg(points, build), shoe(points), face(points, build)], axis=0)
    limb = np.minimum(arm(points, build), hand(points))
    hands, h = local(points, "left_wrist"), local(points, "head")
    around = np.hypot(points[:, 0], points[:, 2] + 0.015)
    outer = ramp((inner - limb) / 0.06 + 0.5)
    return {
        "left_collar": ramp((points[:, 1] - 0.26) / 0.12) * (1 - ramp((h[:, 1] + 0.09) / 0.05)),
        "arm": outer,
        "left_shoulder": outer * ramp((points[:, 1] - points[:, 0] * -1.2 - 0.25) / 0.08),
        "left_elbow": (local(points, "left_shoulder")[:, 0] > 0.15).astype(float),
        "left_wrist": (local(points, "left_elbow")[:, 0] > 0.15).astype(float),
        "left_hand": 1 - ramp((hands[:, 2] - 0.042 + 0.35 * np.maximum(hands[:, 0] - 0.075, -0.03)) / 0.01)
        * (hands[:, 0] < 0.105),
        "left_hip": ramp((points[:, 0] + 0.02) / 0.04) * (points[:, 1] < 0.1) * (1 - outer),
        # Shoulders stay when the neck turns.
        "neck": np.maximum(ramp((points[:, 1] - 0.47) / 0.05), 1 - ramp((around - 0.06) / 0.05)),
    }  # fmt: skip


def weights(points: Array, build: Build) -> tuple[Array, Array]:
    """Return (N, 4) frames and (N, 4) weights of points with x >= 0.

    Frames 0 to 23 are the joints, 24 to 47 the same joints turned half as far: they keep bent limbs round.
    """
    frames = np.zeros((len(points), 48))
    frames[:, 0] = 1
    member = memberships(points, build)
    centre = {"head": (0, -0.012, 0), "left_hip": (0, 0.015, 0)}
    for joint in [name for name in JOINT_INDEX if name in BLENDS]:
        index, (way, width) = JOINT_INDEX[joint], BLENDS[joint]
        direction = np.array(way) / np.linalg.norm(way)
        if joint in OWN_FRAME:
            along = local(points, joint) @ direction
        else:
            along = (points - POSITIONS[index] - centre.get(joint, (0, 0, 0))) @ direction
        s = np.clip(along / width, -1, 1)
        share = member.get(joint, 1.0)
        child = ramp(np.maximum(s, 0)) * share
        half = (1 - ramp(np.abs(s))) * share
        if joint.startswith("spine") or joint == "left_collar":
            # What belongs to the arm follows the whole way up to the collar, however low it hangs.
            child, half = child + (1 - child) * member["arm"], half * (1 - member["arm"])
        rest = frames[:, PARENTS[index]].copy()
        frames[:, index] = rest * child
        frames[:, 24 + index] = rest * half
        frames[:, PARENTS[index]] = rest * (1 - child - half)
    order = np.argsort(-frames, axis=1, kind="stable")[:, :4]
    kept = np.take_along_axis(frames, order, axis=1)
    return order, kept / kept.sum(axis=1, keepdims=True)


def other_side(frames: Array) -> Array:
    flip = [JOINT_INDEX[n.replace("left", "\0").replace("right", "left").replace("\0", "right")] for n in JOINTS]
    table = np.array([*flip, *(24 + f for f in flip)])
    return np.asarray(table[frames])


# -- all together ------------------------------------------------------------------------------------------------------
def made(build: Build) -> dict[str, Array]:
    """Return the arrays of a skin."""
    dense, dense_faces = surface(build)
    points, faces = simplified(dense, dense_faces, HALF_FACES)
    points = unfolded(settled(points, build, 2), faces, build)
    points, faces, label = regions(points, faces, build)
    normals = gradient(points, build)
    follow, share = weights(points, build)
    # In the middle both sides count alike.
    count, middle = len(points), points[:, 0] < 1e-6
    again = np.flatnonzero(~middle)
    partner = np.arange(count)
    partner[again] = count + np.arange(len(again))
    every = np.concatenate([points, points[again] * [-1, 1, 1]])
    turned = np.concatenate([faces, partner[faces][:, ::-1]])
    follow, share = weights_in_the_middle(follow, share, middle)
    result = {
        "vertices": every,
        "normals": np.concatenate([normals, normals[again] * [-1, 1, 1]]),
        "joints": np.concatenate([follow, other_side(follow[again])]),
        "weights": np.concatenate([share, share[again]]),
    }
    return seamed(result, turned, np.concatenate([label, label]))


def weights_in_the_middle(follow: Array, share: Array, middle: Array) -> tuple[Array, Array]:
    follow, share = follow.copy(), share.copy()
    for v in np.flatnonzero(middle):
        whole = np.zeros(48)
        np.add.at(whole, follow[v], share[v] / 2)
        np.add.at(whole, other_side(follow[v]), share[v] / 2)
        best = np.argsort(-whole, kind="stable")[:4]
        follow[v], share[v] = best, whole[best] / whole[best].sum()
    return follow, share


def seamed(arrays: dict[str, Array], faces: Array, label: Array) -> dict[str, Array]:
    """Return the same surface with a vertex of its own for each region that meets there, sorted by region."""
    spots = np.round(arrays["vertices"] * 1e4)[faces]
    whole = (spots != np.roll(spots, 1, axis=1)).any(axis=2).all(axis=1)
    faces, label = faces[whole], label[whole]
    order = np.argsort(label, kind="stable")
    faces, label = faces[order], label[order]
    pairs = np.stack([np.repeat(label, 3), faces.ravel()], 1)
    unique, back = np.unique(pairs, axis=0, return_inverse=True)
    found = {name: array[unique[:, 1]] for name, array in arrays.items()}
    return found | {"faces": back.reshape(-1, 3), "regions": unique[:, 0]}


def stored(arrays: dict[str, Array], colours: list[tuple[int, int, int]]) -> dict[str, Array]:
    """Return the arrays of a file: tenths of a millimetre, and weights in 255ths."""
    share = np.round(arrays["weights"] * 255)
    share[:, 0] += 255 - share.sum(axis=1)
    return {
        "vertices": np.round(arrays["vertices"] * 1e4).astype(np.int16),
        "normals": np.round(arrays["normals"] * 127).astype(np.int8),
        "faces": arrays["faces"].astype(np.uint16),
        "frames": arrays["joints"].astype(np.uint8),
        "weights": share.astype(np.uint8),
        "regions": arrays["regions"].astype(np.uint8),
        "colours": np.array(colours, np.uint8),
        "bind": BIND_POSE.astype(np.float32),
    }


def main(folder: Path, *names: str) -> None:
    for name in names or PEOPLE:
        build, colours = PEOPLE[name]
        arrays = stored(made(build), [colours[region] for region in REGIONS])
        save_file(arrays, folder / f"{name}.safetensors", {"licence": "Apache-2.0", "made by": "core/skin/make.py"})
        print(f"{name}: {len(arrays['vertices'])} vertices, {len(arrays['faces'])} triangles")


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
