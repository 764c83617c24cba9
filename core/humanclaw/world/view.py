"""Cameras, views, and the protocol of renderers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from humanclaw.body.pose import Array, Motion, forward_kinematics, yaw_matrix
from humanclaw.body.skeleton import EYE, JOINT_INDEX
from humanclaw.errors import HumanclawError
from humanclaw.world.scene import Scene
from humanclaw.world.simulator import WorldState

LONGEST: Final = 8192
"""Maximum width and height of a picture, pixels: larger ones fill memory."""
BODY_ID: Final = -1
"""Id of the body's own pixels in an id image; 0 means that nothing was drawn."""
_VERTICAL: Final = 1e-6
"""Sine of the angle between a direction and the vertical below which its heading is rounding errors."""


@dataclass(frozen=True)
class Camera:
    """A pinhole camera. position, forward, up: (3,) world frame. fov: vertical, degrees.

    Raises HumanclawError for a width or height outside 1 to LONGEST pixels, and for numbers that are not finite.
    """

    position: Array
    forward: Array
    up: Array
    fov: float = 90.0
    width: int = 512  # The paper counts a target's pixels in 512 x 512.
    height: int = 512

    def __post_init__(self) -> None:
        if not (0 < self.width <= LONGEST and 0 < self.height <= LONGEST):
            got = f"{self.width} x {self.height}"
            raise HumanclawError(f"a picture is 1 to {LONGEST} pixels wide and high; got {got}.", "Name another size.")
        if not np.isfinite([self.position, self.forward, self.up]).all():
            raise HumanclawError("a camera's place and directions must be finite.", "Let it look at another place.")

    @classmethod
    def looking(cls, eye: ArrayLike, centre: ArrayLike, fov: float, size: tuple[int, int]) -> Self:
        """Return a camera at eye (3,) that looks at centre (3,) without roll. fov: degrees; size: width, height."""
        forward = np.subtract(centre, eye) / np.linalg.norm(np.subtract(centre, eye))
        right = np.cross(forward, [0.0, 1.0, 0.0])
        if np.linalg.norm(right) < _VERTICAL:
            right = np.array([1.0, 0.0, 0.0])
        up = np.cross(right / np.linalg.norm(right), forward)
        return cls(np.asarray(eye, float), forward, up, fov, *size)

    def pixels(self, points: ArrayLike) -> Array:
        """Return column and row (..., 2) of points (..., 3) in world frame, which lie before the camera."""
        right = np.cross(self.forward, self.up)
        x, y, z = np.moveaxis(
            (np.asarray(points, float) - self.position) @ np.stack([right, self.up, self.forward]).T, -1, 0
        )
        focal = self.height / 2 / np.tan(np.radians(self.fov) / 2)
        return np.stack([self.width / 2 + focal * x / z, self.height / 2 - focal * y / z], -1)


@dataclass(frozen=True)
class View:
    """A picture. rgb: (H, W, 3) uint8. depth: (H, W) float32, metres along the optical axis. ids: (H, W) int32."""

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    ids: NDArray[np.int32]


def together(views: Sequence[View]) -> NDArray[np.uint8]:
    """Return one picture (H, W, 3) of the bodies of several views by one camera: the nearest body in each pixel."""
    rgb = np.stack([view.rgb for view in views])
    depth = np.stack([np.where(view.ids == BODY_ID, view.depth, np.inf) for view in views])
    nearest = np.take_along_axis(rgb, depth.argmin(0)[None, ..., None], 0)[0]
    # Beside the bodies the darkest view counts, which has the shadow.
    return np.asarray(np.where(np.isfinite(depth).any(0)[..., None], nearest, rgb.min(0)))


class Renderer(Protocol):
    """Draws moments of a world. It needs no simulator, so that recorded episodes can be drawn later."""

    def load(self, scene: Scene) -> None: ...

    def render(self, state: WorldState, camera: Camera) -> View: ...

    def close(self) -> None: ...


@dataclass(frozen=True)
class CameraMount:
    """Where the eyes sit in the head, and how far below the horizon they look."""

    ahead: float
    """Metres before the head joint."""
    pitch: float
    """Radians; negative is down. As with the vestibulo-ocular reflex, steps do not shake it."""


GAZES: Final[Mapping[str, CameraMount]] = {
    "body": CameraMount(EYE[2], float(np.radians(-30.0))),
    "far": CameraMount(0.11, float(np.radians(-20.0))),
}
"""By name. `body` often has the own limbs in view; `far` is before the skull and seldom has."""
DEFAULT_GAZE: Final = "body"


def gaze_of(name: str) -> CameraMount:
    """Return a gaze by name. Raises HumanclawError for an unknown one."""
    if name not in GAZES:
        raise HumanclawError(f"there is no gaze {name!r}.", f"Choose from: {', '.join(GAZES)}.")
    return GAZES[name]


def ego_camera(body: Motion, size: int = 512, gaze: CameraMount = GAZES[DEFAULT_GAZE]) -> Camera:
    """Return the camera at the eyes of the last frame of a motion.

    It turns with the head and keeps the horizon level.
    """
    positions, orientations = forward_kinematics(body.root[-1], body.rotations[-1])
    head = orientations[JOINT_INDEX["head"]]
    eye = positions[JOINT_INDEX["head"]] + head @ np.array([0.0, EYE[1], gaze.ahead])
    facing = float(np.arctan2(head[0, 2], head[2, 2]))
    turn = yaw_matrix(facing)
    forward = turn @ np.array([0.0, np.sin(gaze.pitch), np.cos(gaze.pitch)])
    up = turn @ np.array([0.0, np.cos(gaze.pitch), -np.sin(gaze.pitch)])
    return Camera(eye, forward, up, 90.0, size, size)
