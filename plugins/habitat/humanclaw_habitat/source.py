"""Load a scene from a reference: place everything in a scene instance as Habitat places it."""

from __future__ import annotations

import hashlib
import json
import re
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final

import numpy as np
from tqdm import tqdm

from humanclaw import Scene, SceneError
from humanclaw.body import Array, Pose2D, matrix_from_quaternion
from humanclaw.world import Asset, Room, SceneObject
from humanclaw_habitat.attributes import Placing, SceneInstance, Template, Vec3
from humanclaw_habitat.categories import MOVABLE, category_of
from humanclaw_habitat.dataset import Dataset, Kind
from humanclaw_habitat.frames import quaternion, rotation
from humanclaw_habitat.models import Models
from humanclaw_habitat.reference import Reference
from humanclaw_habitat.regions import floors, rooms
from humanclaw_habitat.starting import roomiest
from humanclaw_habitat.urdf import MovingLink, joints, moving_links

_REMEDY: Final = "Load the rest with ?missing=skip; `humanclaw habitat check PATH --skip` lists everything missing."
_SMALL: Final = 1.0
"""Longest side of an object that may become movable, metres."""
_DENSITY: Final = 200.0
"""Mass per volume of the bounding box of a small object without a stated mass, kg/m^3."""
_MASSES: Final = (0.1, 15.0)
"""Lower and upper limit of such a mass, kg."""
_NAMED: Final = 5
"""Number of lost objects that a warning names; the scene's notes name all."""


def load_scene(source: str, argument: str) -> Scene:
    """Read a scene as read_scene does, and warn about what is left out."""
    scene = read_scene(source, argument)
    for note, what in (("left_out", "left out"), ("not_read", "not read in full")):
        lost = json.loads(scene.notes[note])
        if lost:
            more = f"\n... and {len(lost) - _NAMED} more" if len(lost) > _NAMED else ""
            listed = "\n".join(lost[:_NAMED])
            warnings.warn(f"{scene.name}: {len(lost)} {what}:\n{listed}{more}", stacklevel=3)
    return scene


def read_scene(source: str, argument: str) -> Scene:
    """Read the scene that source:argument names. The module `reference` describes the argument.

    Object k of the scene instance, counted from 0, has id k + 1. Articulated objects follow, then the pieces of the
    building, then doors and drawers of articulated objects. Shows its progress while it reads model files.

    Raises SceneError if the dataset, the scene or anything in it is missing or unreadable. With missing=skip, the
    scene's notes name what is left out instead. The notes always name what of a model file is not read, and what has no
    effect.
    """
    reference = Reference.parse(argument)
    dataset = Dataset.open(reference.path)
    name = dataset.scene_name(reference.scene)
    return _Assembly.of(dataset, name, reference).scene(f"{source}:{replace(reference, scene=name).argument}")


@dataclass
class _Assembly:
    """A scene under construction from its files."""

    dataset: Dataset
    name: str
    instance: SceneInstance
    models: Models
    skip: bool
    small: bool
    assets: dict[str, Asset] = field(default_factory=dict)
    objects: list[SceneObject] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    ignored: list[str] = field(default_factory=list)
    """Features of the scene that are understood but have no effect."""
    levels: list[tuple[float, float]] = field(default_factory=list)
    leaves: list[SceneObject] = field(default_factory=list)
    """What hangs on hinges and slides of articulated objects."""

    @classmethod
    def of(cls, dataset: Dataset, name: str, reference: Reference) -> _Assembly:
        models = Models((dataset.name, dataset.licence), reference.triangles)
        return cls(dataset, name, dataset.scene(name), models, reference.skip, reference.small)

    def scene(self, name: str) -> Scene:
        things = self.instance.object_instances
        for number, placing in enumerate(tqdm(things, desc=self.name, unit="object", disable=None, leave=False)):
            self._try(f"object {number} ({placing.template_name})", partial(self._place, number, placing))
        for number, placing in enumerate(self.instance.articulated_object_instances):
            what = f"articulated object {number} ({placing.template_name})"
            self._try(what, partial(self._stand, what, len(things) + number + 1, placing))
        self._try(f"stage {self.instance.stage_instance.template_name!r}", self._build)
        last = max((obj.id for obj in self.objects), default=0)
        self.objects += [replace(leaf, id=last + number) for number, leaf in enumerate(self.leaves, 1)]
        if self.instance.default_lighting:
            self.ignored.append(f"light setup {self.instance.default_lighting}: a scene is lit by the renderer")
        slabs = self._slabs()
        regions = rooms(self.dataset.regions(self.name, self.instance), self.levels)
        inside = [region for region in regions if _has_floor(region, slabs)]
        empty = sorted({region.name for region in regions} - {region.name for region in inside})
        self.ignored += [f"room {name!r}: no floor is under it" for name in empty]
        return self._finished(name, inside or floors(slabs, [level for level, _ in self.levels]))

    def _try(self, what: str, place: Callable[[], None]) -> None:
        """Place an object. If that fails, raise the error, or with missing=skip note it and continue."""
        try:
            place()
        except SceneError as error:
            if not self.skip:
                raise SceneError(f"{self.dataset.scenes[self.name].file}: {what}: {error.message}",
                                 f"{error.remedy} {_REMEDY}".strip()) from error  # fmt: skip
            self.left_out.append(f"{what}: {error.message}")

    def _known(self, kind: Kind, wanted: str) -> Kind:
        """Return a template; note it if its name fits others too."""
        if kind.others:
            self.ignored.append(f"template {wanted!r} fits {kind.name}, which is taken, and {', '.join(kind.others)}")
        return kind

    def _place(self, number: int, placing: Placing) -> None:
        kind = self._known(self.dataset.furniture(placing.template_name), placing.template_name)
        template = kind.template
        scale, category = _scale(placing, template), self.dataset.category(kind)
        fragment = self.models.scene_of(kind, scale, category)
        mass = self._mass(placing, template, category, np.ptp(fragment.aabb(1), axis=0))
        # Only a movable object joins its hulls into one: a fixed one keeps the exact pieces.
        if mass and template.join_collision_meshes:
            fragment = self.models.scene_of(kind, scale, category, joined=True)
        (part,) = fragment.objects
        turn, place = rotation(placing.rotation), np.array(placing.translation)
        if (placing.translation_origin or self.instance.translation_origin) != "asset_local":
            place = place - turn @ np.array(template.com or json.loads(fragment.notes["middle"]))
        self.assets |= fragment.assets
        self.objects.append(replace(_placed(part, turn, place), id=number + 1, movable=mass > 0, mass=mass))

    def _stand(self, what: str, number: int, placing: Placing) -> None:
        """Place an articulated object: a fixed part, and what hangs on its hinges and slides."""
        kind = self.dataset.articulated(placing.template_name)
        category = self.dataset.category(kind)
        if category == "object":
            category = category_of([re.sub(r"[_-]?\d+$", "", kind.name)])
        fragment = self.models.scene_of(kind, _scale(placing, kind.template), category)
        turn, place = rotation(placing.rotation), np.array(placing.translation)
        placed = [_placed(part, turn, place) for part in fragment.objects]
        self.assets |= fragment.assets
        self.objects += [replace(part, id=number) for part in placed if not part.joint]
        path = kind.path(kind.template.render_asset)
        states = {f"{fragment.name} {moving.link}": _initial(moving, placing) for moving in moving_links(path)}
        leaves = [part.opened(states[part.asset]) for part in placed if part.joint]
        self.leaves += leaves
        if still := joints(path) - len(leaves):
            self.ignored.append(f"{what}: {still} of its joints stand still")

    def _mass(self, placing: Placing, template: Template, category: str, size: Array) -> float:
        """Return the mass of a movable object in kg; 0 for a fixed one. size: (3,) of its bounding box, metres."""
        given = template.mass * placing.mass_scale
        if placing.motion_type in ("dynamic", "", "undefined"):
            return given
        if not (self.small and category in MOVABLE and size.max() <= _SMALL):
            return 0.0
        return (
            given if "mass" in template.model_fields_set else round(float(np.clip(_DENSITY * size.prod(), *_MASSES)), 3)
        )

    def _build(self) -> None:
        stage = self.instance.stage_instance
        if not (wanted := stage.template_name):
            return
        if any(stage.translation) or any(stage.rotation[1:]):
            self.ignored.append(
                f"stage {wanted!r}: it stands where its model puts it, not where its translation and rotation do"
            )
        fragment = self.models.building(self._known(self.dataset.stage(wanted), wanted))
        self.levels = [(level, area) for level, area in json.loads(fragment.notes["levels"])]
        self.assets |= fragment.assets
        first = len(self.instance.object_instances) + len(self.instance.articulated_object_instances)
        self.objects += [replace(part, id=first + part.id) for part in fragment.objects]

    def _slabs(self) -> list[Array]:
        """Return the convex pieces of the floor, each (K, 3) points in the world frame."""
        return [
            hull + np.array(thing.position)
            for thing in self.objects
            if thing.category == "floor"
            for hull in self.assets[thing.asset].hulls
        ]

    def _finished(self, name: str, regions: Sequence[Room]) -> Scene:
        if not self.objects:
            raise SceneError(
                f"nothing of the scene {self.name} could be loaded.", "Check that the dataset is complete."
            )
        areas = dict(self.levels)
        floor = max(
            {room.floor for room in regions} or areas or {0.0}, key=lambda level: (areas.get(level, 0.0), level)
        )
        objects = tuple(replace(thing, room=_room_of(thing, regions)) for thing in self.objects)
        notes = {
            "dataset": self.dataset.name, "files": self._files(), "left_out": json.dumps(self.left_out),
            "ignored": json.dumps(self.ignored),
            "not_read": json.dumps([f"{path}: {'; '.join(lost)}" for path, lost in self.models.lost.items()]),
        }  # fmt: skip
        scene = Scene(name, self.assets, objects, tuple(regions), Pose2D(0.0, 0.0, 0.0, floor), notes)
        return scene.starting(roomiest(scene, floor))

    def _files(self) -> str:
        """Return the SHA-256 over all model files that were read."""
        return hashlib.sha256(" ".join(sorted(self.models.digests.values())).encode()).hexdigest()


def _scale(placing: Placing, template: Template) -> Vec3:
    """Return the scale of a placed template along its axes, metres a unit. Raises SceneError if one is 0."""
    # Exports hold 0.9999998807907176 for a scale of 1. Rounded, equal scales share one asset.
    factors = np.array([template.scale, placing.non_uniform_scale]).prod(axis=0)
    x, y, z = np.round(factors * template.units_to_meters * placing.uniform_scale, 4).tolist()
    if not x * y * z:
        raise SceneError(f"its scale must not be 0 along any axis; got {x} x {y} x {z}.")
    return x, y, z


def _placed(thing: SceneObject, turn: Array, place: Array) -> SceneObject:
    """Return an object of a fragment, rotated and then moved with the fragment."""
    x, y, z = (np.round(turn @ np.array(thing.position) + place, 5) + 0.0).tolist()
    return replace(
        thing, position=(x, y, z), rotation=quaternion(turn @ matrix_from_quaternion(np.array(thing.rotation)))
    )


def _initial(moving: MovingLink, placing: Placing) -> float:
    """Return where a joint is in a scene, radians or metres: at rest, if the scene does not say."""
    wanted = placing.initial_joint_pose
    if isinstance(wanted, dict):
        return wanted.get(moving.name, wanted.get(moving.link, moving.state))
    return wanted[moving.number] if moving.number < len(wanted) else moving.state


def _has_floor(room: Room, slabs: Sequence[Array]) -> bool:
    """Tell whether a piece of floor, (K, 3) points, is at the room's height and overlaps its rectangle."""
    low, high = np.array([room.x0, room.z0]), np.array([room.x1, room.z1])
    return any(
        abs(slab[:, 1].max() - room.floor) < 0.05
        and (slab[:, [0, 2]].min(axis=0) < high).all()
        and (slab[:, [0, 2]].max(axis=0) > low).all()
        for slab in slabs
    )


def _room_of(thing: SceneObject, regions: Sequence[Room]) -> str:
    """Return the room below an object; empty if there is none."""
    # The 0.3 m let a sunken object keep its room, and are less than a storey.
    x, y, z = thing.position
    inside = [r for r in regions if r.x0 <= x <= r.x1 and r.z0 <= z <= r.z1 and r.floor <= y + 0.3]
    return max(inside, key=lambda room: room.floor).name if inside else ""
