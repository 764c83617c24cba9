"""Make the body's skin: `make skin` writes core/humanclaw/body/skin.safetensors from shape.py alone."""

from __future__ import annotations

import sys
from pathlib import Path

import fast_simplification
import numpy as np
from people import PEOPLE
from shape import BIND_POSE, POSITIONS, SOLE, Build, body, layers, local, ramp
from skimage.measure import marching_cubes

from humanclaw.body import JOINT_INDEX, PARENTS, REGIONS, Array

STEP = 0.005
LOW, HIGH = np.array([0.0, -0.99, -0.21]), np.array([0.78, 0.80, 0.27])
HALF_FACES = 2600
STEEP = 10.0


# -- surface -----------------------------------------------------------------------------------------------------------
def surface(build: Build) -> tuple[Array, Array]:
    """Return vertices and faces of the left half, open at x = 0."""
    axes = [np.arange(low, high, STEP) for low, high in zip(LOW, HIGH, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    shape = points.shape[:3]
    field = np.concatenate([body(part.reshape(-1, 3), build) for part in np.array_split(points, 40)])
    vertices, faces, _, _ = marching_cubes(field.reshape(shape), 0.0, spacing=(STEP,) * 3)
    vertices = vertices + LOW
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


def importance(points: Array) -> Array:
    """Return how much larger a place is made while the mesh is simplified: face and hand keep more triangles."""
    h, w = local(points, "head"), local(points, "left_wrist")
    face = ramp((h[:, 2] - 0.02) / 0.05) * ramp((h[:, 1] + 0.05) / 0.04)
    return np.asarray(1 + 0.5 * ramp((h[:, 1] + 0.04) / 0.05) + 1.3 * face + 1.0 * ramp((w[:, 0] + 0.01) / 0.03))


def simplified(points: Array, faces: Array, count: int) -> tuple[Array, Array]:
    """Return a mesh with so many triangles, whose vertices are some of the given ones."""
    from scipy.spatial import cKDTree

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
def cut(points: Array, faces: Array, values: Array, where: Array | None = None) -> tuple[Array, Array, Array]:
    """Split the faces along the line where values are 0; return points, faces, and each new face's old one.

    where: (M,) faces that are split; their neighbours follow where an edge is shared.
    """
    values = values.copy()
    sides = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    used = np.tile(np.ones(len(faces), bool) if where is None else where, 3)
    edges = np.unique(sides[used], axis=0)
    points = points.copy()
    # A line that passes close to a vertex takes it along, so that no slivers appear.
    a, b = edges.T
    crossing = values[a] * values[b] < 0
    share = np.where(crossing, values[a] / np.where(crossing, values[a] - values[b], 1), 0.5)
    for vertex, other, part in [(a, b, share), (b, a, 1 - share)]:
        for k in np.flatnonzero(crossing & (part < 0.2)):
            v, o = vertex[k], other[k]
            if values[v] != 0 and (points[v, 0] > 1e-6 or points[o, 0] <= 1e-6):
                points[v] = points[v] + part[k] * (points[o] - points[v])
                values[v] = 0
    crossing = values[a] * values[b] < 0
    cross = edges[crossing]
    share = values[cross[:, 0]] / (values[cross[:, 0]] - values[cross[:, 1]])
    new = points[cross[:, 0]] + share[:, None] * (points[cross[:, 1]] - points[cross[:, 0]])
    number = {tuple(edge): len(points) + k for k, edge in enumerate(cross.tolist())}
    points = np.concatenate([points, new])
    made, source = [], []
    for index, face in enumerate(faces.tolist()):
        ring = []
        for k in range(3):
            ring.append(face[k])
            key = tuple(sorted((face[k], face[(k + 1) % 3])))
            if key in number:
                ring.append(number[key])
        for triangle in _fan(ring, len(number) and ring, number, face, points):
            made.append(triangle)
            source.append(index)
    return points, np.array(made), np.array(source)


def _fan(ring, _, number, face, points):
    if len(ring) == 3:
        return [ring]
    new = [k for k, vertex in enumerate(ring) if vertex not in face]
    if len(new) == 1:
        k = new[0]
        r = ring[k:] + ring[:k]
        return [[r[0], r[1], r[2]], [r[0], r[2], r[3]]]
    if len(new) == 2:
        # Rotate so that the corner between the two new points comes second.
        for k in range(5):
            r = ring[k:] + ring[:k]
            if r[0] not in face and r[2] not in face:
                break
        one = np.linalg.norm(points[r[0]] - points[r[3]]) < np.linalg.norm(points[r[2]] - points[r[4]])
        rest = [[r[0], r[2], r[3]], [r[0], r[3], r[4]]] if one else [[r[2], r[3], r[4]], [r[2], r[4], r[0]]]
        return [[r[0], r[1], r[2]], *rest]
    a, x, b, y, c, z = ring if ring[0] in face else ring[1:] + ring[:1]
    return [[a, x, z], [x, b, y], [y, c, z], [x, y, z]]


def polygon(points, faces, label, wanted, corners, allowed):
    """Give the faces in front of the head inside a convex polygon of (x, y), counter-clockwise, a region."""
    inside = np.isin(label, [REGIONS.index(name) for name in allowed])
    for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
        normal = np.array([-(b[1] - a[1]), b[0] - a[0]])
        normal /= np.linalg.norm(normal)
        h = local(points, "head")
        inside &= h[faces].mean(1)[:, 2] > 0.055
        values = (h[:, :2] - a) @ normal
        points, faces, source = cut(points, faces, values, inside)
        label, inside = label[source], inside[source]
        h = local(points, "head")
        inside &= ((h[faces].mean(1)[:, :2] - a) @ normal) > 0
    label = label.copy()
    label[inside] = REGIONS.index(wanted)
    return points, faces, label


def oval(x, y, a, b, count=8, tilt=0.0):
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False) + np.pi / count
    u, v = a * np.cos(angle), b * np.sin(angle)
    return [
        np.array([x + p * np.cos(tilt) - q * np.sin(tilt), y + p * np.sin(tilt) + q * np.cos(tilt)])
        for p, q in zip(u, v, strict=True)
    ]


def regions(points: Array, faces: Array, build: Build) -> tuple[Array, Array, Array]:
    """Split the faces at the borders of the pieces of clothing; return points, faces and (M,) region of each face."""
    names = list(layers(points[:1], build))
    for name in names:
        found = layers(points, build, STEEP)
        values = found[name] - np.min([found[other] for other in names if other != name], axis=0)
        points, faces, _ = cut(points, faces, values)
    found = layers(points[faces].mean(1), build, STEEP)
    label = np.array([REGIONS.index(name) for name in names])[np.argmin([found[name] for name in names], axis=0)]
    shoes = label == REGIONS.index("shoes")
    points, faces, source = cut(points, faces, local(points, "left_ankle")[:, 1] + 0.0748 - SOLE, shoes)
    label = label[source]
    low = local(points[faces].mean(1), "left_ankle")[:, 1] + 0.0748 < SOLE
    label[(label == REGIONS.index("shoes")) & low] = REGIONS.index("soles")
    points, faces, label = polygon(
        points, faces, label, "eyes", oval(0.0315, 0.0825, 0.0118, 0.0060, tilt=0.05), ["skin"]
    )
    brow = [
        np.array(c)
        for c in [(0.014, 0.1005), (0.034, 0.1065), (0.047, 0.1015), (0.047, 0.1035), (0.034, 0.1105), (0.014, 0.1065)]
    ]
    points, faces, label = polygon(points, faces, label, "brows", brow[:2] + brow[4:], ["skin"])
    points, faces, label = polygon(points, faces, label, "brows", [brow[1], brow[2], brow[3], brow[4]], ["skin"])
    mouth = [
        np.array(c)
        for c in [(-0.01, 0.0105), (0.010, 0.0115), (0.0205, 0.0185), (0.009, 0.0250), (0.0, 0.0245), (-0.01, 0.0250)]
    ]
    points, faces, label = polygon(points, faces, label, "lips", mouth, ["skin"])
    return points, faces, label


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
    from shape import arm, face, hand, leg, shoe, torso

    inner = np.min([torso(points, build), leg(points, build), shoe(points), face(points, build)], axis=0)
    limb = np.minimum(arm(points, build), hand(points))
    hands, h = local(points, "left_wrist"), local(points, "head")
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
        "neck": np.ones(len(points)), "head": np.ones(len(points)),
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
    from humanclaw.body import JOINTS

    flip = [JOINT_INDEX[n.replace("left", "\0").replace("right", "left").replace("\0", "right")] for n in JOINTS]
    table = np.array([*flip, *(24 + f for f in flip)])
    return np.asarray(table[frames])


# -- all together ------------------------------------------------------------------------------------------------------
def made(build: Build) -> dict[str, Array]:
    """Return the arrays of a skin."""
    dense, dense_faces = surface(build)
    points, faces = simplified(dense, dense_faces, HALF_FACES)
    points = settled(points, build, 2)
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
    symmetric = weights_in_the_middle(follow, share, middle)
    follow, share = symmetric
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
    from safetensors.numpy import save_file

    for name in names or PEOPLE:
        build, colours = PEOPLE[name]
        arrays = stored(made(build), [colours[region] for region in REGIONS])
        save_file(arrays, folder / f"{name}.safetensors", {"licence": "Apache-2.0", "made by": "core/skin/make.py"})
        print(f"{name}: {len(arrays['vertices'])} vertices, {len(arrays['faces'])} triangles")


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
