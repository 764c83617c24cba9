"""Read articulated objects: the shapes of a URDF's links, with each joint at its rest position, and the joints.

A joint rests at 0, or at the nearest value that its limits allow. As in Habitat, the frame is the file's own: a URDF is
not rotated. A hinge or slide moves all that hangs on it as one piece: joints further out stand still.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from humanclaw import SceneError
from humanclaw.body import Array, matrix_from_vector
from humanclaw.storage import read_file
from humanclaw.world import Hinge, Joint, Part, Slide
from humanclaw_habitat.attributes import LARGEST, MOST
from humanclaw_habitat.frames import scaled

_MOVING: Final = ("revolute", "continuous", "prismatic", "planar", "floating")
_LINKS: Final = 500
"""Maximum links of a file: finding their places takes the square of that."""
_SEGMENTS: Final = 24
"""Sides of a cylinder and of a capsule."""
_GREY: Final = (200, 200, 200)
"""Of a part that names no colour."""


@dataclass(frozen=True)
class MovingLink:
    """A link on a hinge or a slide of the fixed part. Frame: that of the root link; metres, radians."""

    link: str
    name: str
    """Of the joint."""
    number: int
    """Of the joint among those of the file that move, from 0."""
    joint: Joint
    state: float
    """At rest."""
    mass: float
    """Kilograms; 0 if the file gives none."""


def links(path: Path, what: str, read: Callable[[Path], list[Part]], moving: str = "") -> list[Part]:
    """Return the 'visual' or 'collision' elements of the links that a moving link carries, in the root link's frame,
    metres.

    read: returns the parts of a model file. moving: the link of a MovingLink; empty: links that do not move. Raises
    SceneError if the file is not a URDF, its joints form a circle or a shape is unknown.
    """
    robot = _root(path)
    carried = {moving.link for moving in moving_links(path)}
    links: list[Part] = []
    for link in robot.findall("link"):
        place, chain = _place(robot, link.get("name", ""), path)
        if next((name for name in chain if name in carried), "") != moving:
            continue
        for shape in link.iter(what):
            frame = place @ _origin(shape, path)
            parts = _shape(shape, path, read)
            links += [replace(part, vertices=part.vertices @ frame[:3, :3].T + frame[:3, 3]) for part in parts]
    return links


def moving_links(path: Path) -> list[MovingLink]:
    """Return the links on hinges and slides that have no other such link between them and the root, as the file lists
    their joints. Raises SceneError if it cannot be read."""
    robot, by_link = _root(path), dict[str, MovingLink]()
    moving = {_named(joint, "child", path): joint for joint in robot.findall("joint") if _range(joint, path)}
    for number, (link, joint) in enumerate(moving.items()):
        _, chain = _place(robot, _named(joint, "parent", path), path)
        if not moving.keys() & set(chain):
            by_link[link] = _placed(robot, link, number, joint, path)
    return list(by_link.values())


def _placed(robot: ElementTree.Element, link: str, number: int, joint: ElementTree.Element, path: Path) -> MovingLink:
    frame = _place(robot, _named(joint, "parent", path), path)[0] @ _origin(joint, path)
    x, y, z = (float(value) for value in frame[:3, :3] @ _way(joint, path))
    low, high = _range(joint, path) or (0.0, 0.0)
    dynamics = joint.find("dynamics")
    weight = next((part.find("inertial/mass") for part in robot.findall("link") if part.get("name") == link), None)
    given = {} if dynamics is None else {
        key: float(_numbers(dynamics.get(key, ""), 1, path)[0]) for key in ("friction", "damping") if dynamics.get(key)
    }  # fmt: skip
    point = (float(frame[0, 3]), float(frame[1, 3]), float(frame[2, 3]))
    slides = joint.get("type") == "prismatic"
    kept = Slide(low, high, axis=(x, y, z), **given) if slides else Hinge(point, low, high, axis=(x, y, z), **given)
    mass = 0.0 if weight is None else float(_numbers(weight.get("value", ""), 1, path)[0])
    return MovingLink(link, joint.get("name", ""), number, kept, float(np.clip(0.0, low, high)), mass)


def _range(joint: ElementTree.Element, path: Path) -> tuple[float, float] | None:
    """Return the limits of a hinge or slide; None for joints that cannot or do not move."""
    if joint.get("type") == "continuous":
        return -np.pi, np.pi
    limit = joint.find("limit")
    if limit is None or joint.get("type") not in ("revolute", "prismatic"):
        return None
    low, high = _limits(limit, path)
    if joint.get("type") == "revolute" and high - low > 2 * np.pi:
        low = max(low, float(np.clip(0.0, low, high)) - np.pi)
        high = min(high, low + 2 * np.pi)
    return (low, high) if low < high else None


def _limits(limit: ElementTree.Element, path: Path) -> tuple[float, float]:
    """Return the limits of a joint. Files write 1e30 for none; no way is longer than the world is wide."""
    low, high = np.clip(_numbers(f"{limit.get('lower', '0')} {limit.get('upper', '0')}", 2, path), -MOST, MOST).tolist()
    return low, high


def meshes(path: Path) -> list[Path]:
    """Return the model files that a URDF names, even outside its folder. Raises SceneError if it cannot be read."""
    return sorted({_file(mesh, path) for mesh in _root(path).iter("mesh")})


def joints(path: Path) -> int:
    """Return the number of joints of a URDF that could move. Raises SceneError if it cannot be read."""
    return sum(joint.get("type") in _MOVING for joint in _root(path).findall("joint"))


def _root(path: Path) -> ElementTree.Element:
    try:
        robot = ElementTree.fromstring(read_file(path, LARGEST))
    except OSError as error:
        raise SceneError(f"{path} cannot be read: {error.strerror}.", "Check that the dataset is complete.") from error
    except (ElementTree.ParseError, ValueError, LookupError) as error:  # The last two: an encoding of no use.
        raise SceneError(
            f"{path} is not a URDF: {error}.", "Fetch it again; in a git checkout run `git lfs pull`."
        ) from error
    if robot.tag != "robot":
        raise SceneError(f"{path} is not a URDF: its root element must be a robot; got {robot.tag}.")
    if (many := max(len(robot.findall(kind)) for kind in ("link", "joint"))) > _LINKS:
        raise SceneError(f"{path} has {many} links or joints; at most {_LINKS} are read.", "Split it, or leave it out.")
    return robot


def _place(robot: ElementTree.Element, link: str, path: Path) -> tuple[Array, list[str]]:
    """Return the (4, 4) frame of a link in that of the root link, and the link with all above it."""
    above = {_named(joint, "child", path): joint for joint in robot.findall("joint")}
    frame, chain = np.eye(4), [link]
    for _ in range(len(above) + 1):  # A longer chain would have to pass a joint twice.
        if link not in above:
            return frame, chain
        joint = above[link]
        frame = _origin(joint, path) @ _rest(joint, path) @ frame
        link = _named(joint, "parent", path)
        chain.append(link)
    raise SceneError(f"{path}: the joints form a circle at link {link!r}.")


def _named(joint: ElementTree.Element, end: str, path: Path) -> str:
    """Return the link at an end of a joint: 'parent' or 'child'."""
    element = joint.find(end)
    if element is None or not element.get("link"):
        raise SceneError(f"{path}: each joint must name a {end} link; joint {joint.get('name', '')!r} names none.")
    return element.get("link", "")


def _rest(joint: ElementTree.Element, path: Path) -> Array:
    """Return the (4, 4) motion of a joint at rest: none, unless its limits exclude 0."""
    limit = joint.find("limit")
    frame = np.eye(4)
    if limit is None or joint.get("type") not in ("revolute", "prismatic"):
        return frame
    value = float(np.clip(0.0, *_limits(limit, path)))
    way = _way(joint, path)
    if joint.get("type") == "prismatic":
        frame[:3, 3] = value * way
    else:
        frame[:3, :3] = matrix_from_vector(value * way)
    return frame


def _way(joint: ElementTree.Element, path: Path) -> Array:
    """Return the (3,) unit axis of a joint, in its own frame."""
    axis = joint.find("axis")
    way = _numbers("1 0 0" if axis is None else axis.get("xyz", "1 0 0"), 3, path)
    return np.asarray(way / max(float(np.linalg.norm(way)), 1e-12))


def _origin(element: ElementTree.Element, path: Path) -> Array:
    """Return the (4, 4) frame of an element's origin: roll, pitch and yaw about fixed axes."""
    origin = element.find("origin")
    frame = np.eye(4)
    if origin is not None:
        frame[:3, :3] = Rotation.from_euler("xyz", _numbers(origin.get("rpy", "0 0 0"), 3, path)).as_matrix()
        frame[:3, 3] = _numbers(origin.get("xyz", "0 0 0"), 3, path)
    return frame


def _shape(element: ElementTree.Element, path: Path, read: Callable[[Path], list[Part]]) -> list[Part]:
    """Return the parts of a visual or collision element, in its own frame."""
    geometry = element.find("geometry")
    for shape in () if geometry is None else geometry:
        if shape.tag == "mesh":
            return scaled(read(_file(shape, path)), _numbers(shape.get("scale", "1 1 1"), 3, path))
        return [replace(_solid(shape, path), colour=_colour(element, path) or _GREY)]
    raise SceneError(f"{path}: each {element.tag} must have a geometry; one has none.")


def _solid(shape: ElementTree.Element, path: Path) -> Part:
    """Return a box, sphere, cylinder or capsule centred on its origin, with axis +Z."""
    from trimesh import creation

    def length(key: str) -> float:
        value = float(_numbers(shape.get(key, ""), 1, path)[0])
        if value <= 0:
            raise SceneError(f"{path}: a {shape.tag} has the {key} {value:g}.", "Give one above 0.")
        return value

    if shape.tag == "box":
        mesh = creation.box(_numbers(shape.get("size", ""), 3, path))
    elif shape.tag == "sphere":
        mesh = creation.icosphere(2, length("radius"))
    elif shape.tag == "cylinder":
        mesh = creation.cylinder(length("radius"), length("length"), _SEGMENTS)
    elif shape.tag == "capsule":
        mesh = creation.capsule(length("length"), length("radius"), count=[8, _SEGMENTS])
    else:
        raise SceneError(f"{path}: the shape {shape.tag} is not supported.")
    vertices = np.asarray(mesh.vertices, float) - mesh.bounds.mean(axis=0)
    return Part(vertices, np.asarray(mesh.faces, np.int64), None, _GREY)


def _colour(element: ElementTree.Element, path: Path) -> tuple[int, int, int] | None:
    """Return the colour in a visual's own material, red, green, blue from 0 to 255; None if it has none."""
    colour = element.find("material/color")
    if colour is None:
        return None
    red, green, blue = (
        round(255 * float(value)) for value in np.clip(_numbers(colour.get("rgba", ""), 4, path)[:3], 0, 1)
    )
    return red, green, blue


def _file(mesh: ElementTree.Element, path: Path) -> Path:
    name = mesh.get("filename", "").removeprefix("package://").removeprefix("file://")
    # abspath, not resolve(): symbolic links stay, because whoever owns the folder decides where they lead.
    return Path(os.path.abspath(path.parent / name))


def _numbers(text: str, count: int, path: Path) -> Array:
    """Parse numbers separated by blanks or commas. Raises SceneError if they are not as many, or one is not finite."""
    try:
        numbers = np.array([float(word) for word in text.replace(",", " ").split()])
    except ValueError as error:
        raise SceneError(f"{path}: {error}.") from error
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        raise SceneError(f"{path}: expected {count} finite numbers; got {text!r}.")
    return numbers
