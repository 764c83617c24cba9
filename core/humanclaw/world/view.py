"""Cameras, views, and the protocol of renderers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from humanclaw.body.pose import Array, Motion, forward_kinematics, yaw_matrix
from humanclaw.body.skeleton import EYE, JOINT_INDEX
from humanclaw.world.scene import Scene
from humanclaw.world.simulator import WorldState

BODY_ID: Final = -1
"""Id of the body's own pixels in an id image; 0 means that nothing was drawn."""


@dataclass(frozen=True)
class Camera:
    """A pinhole camera. position, forward, up: (3,) world frame. fov: vertical, degrees."""

    position: Array
    forward: Array
    up: Array
    fov: float = 90.0
    width: int = 512
    height: int = 512


@dataclass(frozen=True)
class View:
    """A picture. rgb: (H, W, 3) uint8. depth: (H, W) float32, metres along the optical axis. ids: (H, W) int32."""

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    ids: NDArray[np.int32]


class Renderer(Protocol):
    """Draws moments of a world. It needs no simulator, so that recorded episodes can be drawn later."""

    def load(self, scene: Scene) -> None: ...

    def render(self, state: WorldState, camera: Camera) -> View: ...

    def close(self) -> None: ...


GAZE_PITCH: Final = np.radians(-20.0)
"""Pitch of the eyes, radians: level and 20 degrees below the horizon. As with the vestibulo-ocular reflex, steps do not
shake them."""


def ego_camera(body: Motion, size: int = 512) -> Camera:
    """Return the camera at the eyes of the last frame of a motion.

    It turns with the head and keeps the horizon level.
    """
    positions, orientations = forward_kinematics(body.root[-1], body.rotations[-1])
    head = orientations[JOINT_INDEX["head"]]
    eye = positions[JOINT_INDEX["head"]] + head @ np.array(EYE)
    facing = float(np.arctan2(head[0, 2], head[2, 2]))
    turn = yaw_matrix(facing)
    forward = turn @ np.array([0.0, np.sin(GAZE_PITCH), np.cos(GAZE_PITCH)])
    up = turn @ np.array([0.0, np.cos(GAZE_PITCH), -np.sin(GAZE_PITCH)])
    return Camera(eye, forward, up, 90.0, size, size)
