"""The body's looks: one closed mesh of a clothed person that follows the joints (linear blend skinning).

`make skin` computes it from the skeleton alone, see core/skin. Engines do not see it: collision shapes are LINKS.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from importlib import resources
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from humanclaw.body.pose import Array, forward_kinematics, matrix_from_vector
from humanclaw.body.skeleton import JOINT_INDEX, N_JOINTS, PARENTS
from humanclaw.errors import HumanclawError

SKINS: Final = ("alex", "sam", "kim", "max")
"""Names of the persons that a body can look like; they differ in build, hair and clothes, not in length."""
REGIONS: Final = ("skin", "hair", "shirt", "trousers", "shoes", "soles", "eyes", "brows", "lips")
"""What a vertex belongs to."""
_PARENTS: Final = np.maximum(PARENTS, 0)
_ABOVE: Final = [JOINT_INDEX[joint] + half for joint in ("neck", "head") for half in (0, N_JOINTS)]
"""The frames of neck and head."""
_UNIT: Final = 1e-4
"""Metres for each step of a stored coordinate."""
Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Skin:
    """A mesh of N vertices and M triangles in a bind pose, metres, pelvis at the origin.

    A vertex follows up to four of 48 frames: 0 to 23 are the joints, 24 to 47 the same joints turned half as far.
    Those keep bent limbs round. Where regions meet, each has its own vertices at the same places.
    """

    vertices: Floats
    normals: Floats
    faces: NDArray[np.int32]
    frames: NDArray[np.uint8]
    """(N, 4) frames that a vertex follows."""
    weights: Floats
    """(N, 4) shares of these frames; each row sums to 1."""
    regions: NDArray[np.uint8]
    """(N,) indices into REGIONS."""
    colours: NDArray[np.uint8]
    """(9, 3) red, green and blue of each region."""
    bind: Array
    """(24, 3) rotation vectors of the bind pose."""

    @cached_property
    def uv(self) -> Floats:
        """(N, 2) where the vertices take their colours from a texture of one row, `colours[None]`."""
        across = (self.regions + 0.5) / len(self.colours)
        return np.stack([across, np.full_like(across, 0.5)], axis=1).astype(np.float32)

    def posed(self, root: Array, rotations: Array) -> tuple[Floats, Floats]:
        """Return (N, 3) vertices, metres, and (N, 3) normals of unit length or shorter, in one pose.

        Args:
            root: (3,) place of the pelvis, metres.
            rotations: (24, 3) local rotation vectors.
        """
        places, turns = _frames(root, rotations)
        turns = turns @ self._bound[1]
        moves = np.concatenate([turns, (places - np.einsum("kij,kj->ki", turns, self._bound[0]))[..., None]], -1)
        each = (self._shares @ moves.reshape(-1, 12).astype(np.float32)).reshape(-1, 3, 4)
        vertices = np.einsum("nij,nj->ni", each[..., :3], self.vertices) + each[..., 3]
        return vertices, np.einsum("nij,nj->ni", each[..., :3], self.normals)

    def headless(self, vertices: Floats, neck: Array) -> Floats:
        """Return posed vertices with head and neck folded into the neck's joint: what eyes inside the head see.

        The mesh stays closed. neck: (3,) place of the joint, in the frame of the vertices.
        """
        rows, share = self._head
        folded = vertices.copy()
        folded[rows] += share * (np.asarray(neck, np.float32) - folded[rows])
        return folded

    @cached_property
    def _shares(self) -> csr_array:
        """(N, 48) share of each frame: sparse, as most vertices follow one or two, and a BLAS would start threads."""
        rows = np.repeat(np.arange(len(self.frames)), self.frames.shape[1])
        shares = csr_array((self.weights.ravel(), (rows, self.frames.ravel())), (len(self.frames), 2 * N_JOINTS))
        shares.eliminate_zeros()
        return shares

    @cached_property
    def _bound(self) -> tuple[Array, Array]:
        """Places of the frames in the bind pose, and the inverses of their orientations."""
        places, turns = _frames(np.zeros(3), self.bind)
        return places, turns.swapaxes(-1, -2)

    @cached_property
    def _head(self) -> tuple[NDArray[np.int64], Floats]:
        """The vertices that follow head or neck, and (K, 1) by how much."""
        share = self._shares[:, _ABOVE].sum(axis=1)
        return np.flatnonzero(share), share[share > 0][:, None]


def _frames(root: Array, rotations: Array) -> tuple[Array, Array]:
    """Return (48, 3) places and (48, 3, 3) orientations of the joints, then of the half-turned joints."""
    places, turns = forward_kinematics(root, rotations)
    half = turns[_PARENTS] @ matrix_from_vector(rotations / 2)
    half[0] = turns[0]
    return np.concatenate([places, places]), np.concatenate([turns, half])


@cache
def skin(name: str = SKINS[0]) -> Skin:
    """Return a skin by name. Raises HumanclawError for an unknown one."""
    if name not in SKINS:
        raise HumanclawError(f"there is no skin {name!r}.", f"Choose from: {', '.join(SKINS)}.")
    from safetensors.numpy import load

    stored = load(resources.files("humanclaw.body").joinpath("skins", f"{name}.safetensors").read_bytes())
    return Skin(
        vertices=stored["vertices"].astype(np.float32) * np.float32(_UNIT),
        normals=stored["normals"].astype(np.float32) / np.float32(127),
        faces=stored["faces"].astype(np.int32),
        frames=stored["frames"],
        weights=stored["weights"].astype(np.float32) / np.float32(255),
        regions=stored["regions"],
        colours=stored["colours"],
        bind=stored["bind"].astype(float),
    )
