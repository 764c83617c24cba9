"""Open the fridge of a house: `python examples/fridge.py FILE.jpg` draws it in six pictures."""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from humanclaw import Body, Plugins
from humanclaw.body import Pose2D, matrix_from_quaternion, yaw_matrix
from humanclaw.world import Camera

SKILLS = Path(__file__).parents[1] / "skills"
PACKAGES = [SKILLS / name / f"humanclaw_skill_{name}" for name in ("hands", "handle")]
SIDE = {"side": "right"}
CALLS = (
    ("reach", SIDE | {"x_cm": -22, "y_cm": 110, "z_cm": 48}), ("reach", SIDE | {"x_cm": -22, "y_cm": 110, "z_cm": 63}),
    ("grasp", SIDE), ("pull", SIDE | {"cm": 20}), ("pull", SIDE | {"cm": 20}),
    ("step_back", {"z_cm": 15}), ("step_back", {"z_cm": 15}), ("release", SIDE),
)  # fmt: skip
DRAWN = (0, 2, 4), (5, 6, 8)


def before(scene, door):
    """Return a place from which the right hand reaches the edge of a closed door."""
    turn, middle = matrix_from_quaternion(np.array(door.rotation)), np.mean(scene.aabb(door.id), axis=0)
    hinge, ahead = np.array(door.position) + turn @ door.joint.point, turn @ [0.0, 0.0, 1.0]
    aside = (middle - hinge) * [1.0, 0.0, 1.0] - (middle - hinge) @ ahead * ahead
    x, _, z = middle + 0.85 * aside + 0.71 * ahead + 0.2 * np.cross(ahead, [0.0, 1.0, 0.0])
    return Pose2D(float(x), float(z), float(np.arctan2(-ahead[0], -ahead[2])))


def picture(body, renderer, place):
    """Draw the body from its right: on its left is a wall."""
    ahead, left = yaw_matrix(place.yaw)[:, 2], yaw_matrix(place.yaw)[:, 0]
    at = np.array([place.x, 0.95, place.z]) + 0.3 * ahead
    eye = np.array([place.x, 1.5, place.z]) - 1.4 * left - 0.3 * ahead
    return renderer.render(body.state(), Camera(eye, at - eye, np.array([0.0, 1.0, 0.0]), 65.0, 400, 400)).rgb


def main(file: str) -> None:
    plugins = Plugins.discover(PACKAGES)
    scene, renderer = plugins.scene("house:0"), plugins.make("renderers", "raster")
    renderer.load(scene)
    door = max((leaf for leaf in scene.of_category("fridge") if leaf.joint), key=lambda leaf: scene.aabb(leaf.id)[0][1])
    place = before(scene, door)
    with Body(scene, place, plugins=plugins) as body:
        pictures = [picture(body, renderer, place)]
        for name, params in CALLS:
            print(body.call(name, **params).feedback)
            pictures.append(picture(body, renderer, place))
        angle = abs(np.degrees(door.state_at(body.state().objects[door.id])))
    print(f"The door is open by {angle:.0f} degrees.")
    rows = [np.hstack([pictures[k] for k in row]) for row in DRAWN]
    Image.fromarray(np.vstack(rows)).save(file, quality=80)


if __name__ == "__main__":
    main(sys.argv[1])
