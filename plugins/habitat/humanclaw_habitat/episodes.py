"""Convert ObjectNav episodes to EpisodeSpecs.

The files have the format of Habitat-Lab's ObjectNav-v1: content/SCENE.json.gz with `episodes` and `goals_by_category`,
whose keys are `<scene>_<category>`.

A goal is matched to an object by name and place. Its object_id only breaks ties: some releases mean an index into
object_instances, others a number of the semantic annotation.

The reference release adds `init_offset`, the start in a world with z up: (-x, z, height of the floor). Only that height
is read: `start_position` hovers over the floor.
"""

from __future__ import annotations

import gzip
import io
import json
import re
import zlib
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from pydantic import AfterValidator, ValidationError, model_validator

from humanclaw import EpisodeSpec, HumanclawError, Scene, SceneError
from humanclaw.body import Array, Pose2D
from humanclaw.records import SEATS, Difficulty, first_fault, instruction, name_of, route_difficulty
from humanclaw.storage import read_file
from humanclaw.world import DistanceField, MultiFloorMap, SceneObject, distance_to_box, goals_at
from humanclaw_habitat.attributes import LARGEST, Attributes, M, Vec3
from humanclaw_habitat.categories import GOALS, category_of
from humanclaw_habitat.frames import heading
from humanclaw_habitat.models import template_of

_ASTRAY: Final = 1.0
"""Largest distance between a goal and the bounding box of its object, metres."""
_FLOOR: Final = 0.5
"""Largest distance between the height of a start and a floor of the scene, metres."""

_TILT: Final = 0.1
"""Tangent of half the largest tilt of a start: 11 degrees."""
_VERSION: Final = "Check that the episodes are for this version of the dataset and that the scene is complete."


class Goal(Attributes):
    object_id: int | str | None = None
    """A hint: in some releases the index into the scene's object_instances."""
    object_name: str | None = None
    """Handle of the object in Habitat, such as TEMPLATE_:0003, or its name in the annotation."""
    position: Vec3 | None = None

    @property
    def hint(self) -> int:
        """Id that the object has if object_id is an index; 0 if it cannot be an index."""
        said = str(self.object_id)
        return int(said) + 1 if said.isdecimal() else 0

    @property
    def template(self) -> str:
        """Name of the object's template: the handle without its number."""
        return re.sub(r"_:\d+$", "", Path(self.object_name or "").name)


def _upright(rotation: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    """Return x, y, z, w of a rotation about Y, which some files write as w, x, y, z."""
    a, b, c, d = rotation
    if np.hypot(a, c) < _TILT * np.hypot(b, d):
        return rotation
    if np.hypot(b, d) < _TILT * np.hypot(a, c):
        return b, c, d, a
    raise ValueError(f"a body stands upright, so this must be a quaternion x, y, z, w about Y; got {rotation}")


class Task(Attributes):
    """One episode of a file."""

    episode_id: str | int
    scene_id: str
    start_position: Vec3
    start_rotation: Annotated[tuple[float, float, float, float], AfterValidator(_upright)]
    """x, y, z, w, about Y."""
    object_category: str
    init_offset: Vec3 | None = None
    """-x, z and height of the floor under the body, metres."""
    goals: tuple[Goal, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _from_info(cls, values: Any) -> Any:
        """Take init_offset from `info`, where some files keep it."""
        info = values.get("info") if isinstance(values, Mapping) else None
        return {"init_offset": info["init_offset"], **values} if info and "init_offset" in info else values

    @property
    def scene(self) -> str:
        """Name of the scene, without its folder and file endings."""
        return re.sub(r"(\.scene_instance\.json|\.basis\.glb|\.glb|\.json)$", "", Path(self.scene_id).name)

    @property
    def start(self) -> Pose2D:
        """Start of the body. Its height is that of the floor only if the file has init_offset."""
        x, y, z = self.start_position
        floor = self.init_offset[2] if self.init_offset else y
        return Pose2D(x=round(x, 4), z=round(z, 4), yaw=round(heading(self.start_rotation), 4), floor=round(floor, 4))


@dataclass(frozen=True)
class Book:
    """One file of episodes."""

    path: Path
    tasks: tuple[Task, ...]
    goals: Mapping[str, Sequence[Goal]]

    def goals_of(self, task: Task) -> Sequence[Goal]:
        """Return all goals of a task: those of its category in its scene, otherwise those in the task itself."""
        keys = [f"{name}_{task.object_category}" for name in (Path(task.scene_id).name, task.scene)]
        return next((self.goals[key] for key in keys if key in self.goals), task.goals)


@dataclass
class LeftOut:
    """What could not be converted, and why."""

    skip: bool = False
    """Whether to convert the rest; otherwise the first failure is an error."""
    reasons: Counter[str] = field(default_factory=Counter)
    """Reason to the number of episodes that it left out."""

    def add(self, where: str, error: HumanclawError, count: int = 1) -> None:
        """Count a failure; without skip, raise the error with the place where it occurred."""
        message = f"{where}: {error.message}"
        if not self.skip:
            raise HumanclawError(message, f"{error.remedy} Use --skip to convert the rest.".strip()) from error
        self.reasons[message] += count


def read_books(path: Path, left_out: LeftOut) -> list[Book]:
    """Read the files of a split: a *.json.gz or *.json, or a folder that holds them directly or in `content`.

    Raises HumanclawError if there is no file, or if one is malformed and left_out does not skip.
    """
    place = path / "content" if (path / "content").is_dir() else path
    files = sorted(file for file in place.glob("*.json*") if file.name.endswith((".json", ".json.gz")))
    if path.is_file():
        beside = path.parent / "content"
        books = _books([path], left_out)
        # Habitat writes val.json.gz without episodes beside a folder `content`, which then holds them.
        return books if any(book.tasks for book in books) or not beside.is_dir() else read_books(path.parent, left_out)
    if not files:
        raise HumanclawError(f"{path} holds no episodes.", "Name a folder with content/*.json.gz, or one such file.")
    return _books(files, left_out)


def _books(files: Iterable[Path], left_out: LeftOut) -> list[Book]:
    books = []
    for file in files:
        try:
            values = _values(file)
        except HumanclawError as error:
            left_out.add(str(file), error)
        else:
            tasks = _checked(Task, f"{file}: episode", _named(values["episodes"]), left_out)
            goals = {key: tuple(_checked(Goal, f"{file}: {key}: goal", enumerate(listed), left_out))
                     for key, listed in values.get("goals_by_category", {}).items()}  # fmt: skip
            books.append(Book(file, tuple(tasks), goals))
    return books


def _values(path: Path) -> Mapping[str, Any]:
    """Read a file. Raises HumanclawError if it is unreadable or has no list of episodes."""
    try:
        data = read_file(path, LARGEST)
        values = json.loads(gzip.GzipFile(fileobj=io.BytesIO(data)).read(LARGEST) if path.suffix == ".gz" else data)
    except (OSError, ValueError, EOFError, RecursionError, zlib.error) as error:
        raise HumanclawError(f"it cannot be read: {error}.", "Check that the .json.gz is complete.") from error
    goals = values.get("goals_by_category", {}) if isinstance(values, dict) else None
    if not isinstance(goals, dict) or not all(
        isinstance(some, list) for some in (values.get("episodes"), *goals.values())
    ):
        message = "it is not an ObjectNav file: it has no list of episodes, or its goals are not lists."
        raise HumanclawError(message, "See Habitat's format ObjectNav-v1.")
    return dict(values)


def _named(entries: Iterable[Any]) -> Iterator[tuple[object, Any]]:
    """Yield each episode after its id, or after its number in the file if it has none."""
    for number, entry in enumerate(entries):
        yield entry.get("episode_id", number) if isinstance(entry, Mapping) else number, entry


def _checked(model: type[M], where: str, entries: Iterable[tuple[object, Any]], left_out: LeftOut) -> Iterator[M]:
    """Yield the valid entries of a file as models. entries: pairs of a name and the values."""
    for name, entry in entries:
        try:
            yield model.model_validate(entry)
        except ValidationError as error:
            fault = HumanclawError(f"{first_fault(error)}.", "See Habitat's format ObjectNav-v1.")
            left_out.add(f"{where} {name}", fault)


def convert(
    books: Iterable[Book], scene_of: Callable[[str], Scene], left_out: LeftOut, *, max_steps: int = 100
) -> list[EpisodeSpec]:
    """Convert the episodes of all books, scene by scene.

    scene_of: returns the scene of a name; the name of that scene is its reference. Episodes whose category is not in
    GOALS are left out. Without skip, raises HumanclawError for a scene that cannot be loaded and for an episode that
    has no target in the scene or no route to one.
    """
    by_scene: dict[str, list[tuple[Book, Task]]] = defaultdict(list)
    for book in books:
        for task in book.tasks:
            by_scene[task.scene].append((book, task))
    specs: list[EpisodeSpec] = []
    for name, tasks in sorted(by_scene.items()):
        try:
            site = _Site(scene_of(name), left_out)
        except SceneError as error:
            left_out.add(f"scene {name}", error, len(tasks))
        else:
            _take(site, tasks, specs, left_out, max_steps)
    return specs


def _take(
    site: _Site, tasks: Iterable[tuple[Book, Task]], specs: list[EpisodeSpec], left_out: LeftOut, max_steps: int
) -> None:
    """Convert the episodes of a scene and add them to specs."""
    for book, task in tasks:
        try:
            spec = site.spec(task, book.goals_of(task), max_steps)
        except _UnfitError as error:
            left_out.reasons[str(error)] += 1
        except SceneError as error:
            left_out.add(f"{book.path}: episode {task.episode_id}", error)
        else:
            # Files may repeat an episode_id, but ids of a split are unique: repeats get "..1", "..2".
            same = sum(known.id.split("..")[0] == spec.id for known in specs)
            name = f"{spec.id}..{same}" if same else spec.id
            specs.append(spec.model_copy(update={"id": name, "seed": len(specs)}))


class _UnfitError(Exception):
    """The goal of an episode is not in GOALS."""


@dataclass
class _Site:
    """A scene and the distance fields to its targets, each computed once."""

    scene: Scene
    left_out: LeftOut
    ways: dict[tuple[int, ...], DistanceField] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._floors = MultiFloorMap.of(self.scene)

    def spec(self, task: Task, goals: Sequence[Goal], max_steps: int) -> EpisodeSpec:
        category = category_of([task.object_category])
        if category not in GOALS:
            raise _UnfitError(f"{task.object_category} is not among {', '.join(GOALS)}")
        targets = self._targets(task, goals, category)
        start = self._standing(task.start)
        return EpisodeSpec(
            id=name_of(f"{task.scene}-{category}-{task.episode_id}"), instruction=instruction(category),
            scene=self.scene.name, scene_digest=self.scene.digest, start=start, target_category=category,
            target_ids=targets, interact=category in SEATS, max_steps=max_steps,
            difficulty=self._difficulty(start, targets),
        )  # fmt: skip

    def _targets(self, task: Task, goals: Sequence[Goal], category: str) -> tuple[int, ...]:
        """Return the ids of the objects that the goals mean. Goals without an object are reported and ignored.

        Raises SceneError if no goal has an object.
        """
        meant = [self._meant(goal, category) for goal in goals]
        targets = tuple(dict.fromkeys(obj.id for obj in meant if obj))
        if not targets:
            lost = f"its {len(goals)} goals are not in the scene{self._near(goals, category)}"
            said = lost if goals else "the file has no goals"
            raise SceneError(f"it has no target of category {task.object_category}: {said}.", _VERSION)
        for number, (goal, obj) in enumerate(zip(goals, meant, strict=True)):
            if obj is None:
                fault = SceneError(f"no such object is there{self._near([goal], category)}.", _VERSION)
                self.left_out.add(f"scene {task.scene}: goal {number} of {task.object_category}", fault, 0)
        return targets

    def _near(self, goals: Sequence[Goal], category: str) -> str:
        """Say how far the nearest object of a category is from the goals; empty if there is none."""
        places = [np.array(goal.position) for goal in goals if goal.position]
        far = [self._away(obj, place) for obj in self.scene.objects if obj.category == category for place in places]
        return f"; the nearest {category} is {min(far):.1f} m from where they should be" if far else ""

    def _meant(self, goal: Goal, category: str) -> SceneObject | None:
        """Return the object at the goal's position that has the goal's template, or at least its category.

        None if there is no such object.
        """
        alike = [obj for obj in self.scene.objects if obj.category == category]
        named = [obj for obj in self.scene.objects if goal.template and template_of(obj) == goal.template]
        objects = named or alike
        if goal.position is None:
            return next((obj for obj in objects if obj.id == goal.hint), None)
        place = np.array(goal.position)
        ranked = [(self._away(obj, place), obj.id != goal.hint, obj.id, obj) for obj in objects]
        return next((obj for away, *_, obj in sorted(ranked, key=lambda rank: rank[:3]) if away <= _ASTRAY), None)

    def _away(self, obj: SceneObject, place: Array) -> float:
        return float(distance_to_box(place, *self.scene.aabb(obj.id)))

    def _standing(self, start: Pose2D) -> Pose2D:
        """Return the start on the scene's own floor: starts on a navigation mesh hover over it."""
        floors = [plan.floor for plan in self._floors.floors]
        near = min(floors, key=lambda floor: abs(floor - start.floor))
        if abs(near - start.floor) > _FLOOR:
            said = ", ".join(f"{floor:g}" for floor in floors)
            raise SceneError(f"it starts at height {start.floor} m, but the floors are at {said} m.", "Use --skip.")
        return replace(start, floor=near)

    def _difficulty(self, start: Pose2D, targets: tuple[int, ...]) -> Difficulty:
        """Return the difficulty of the route to the nearest target. Raises SceneError if there is no route."""
        # Episodes of a scene share few sets of targets, and a distance field covers the whole building.
        if targets not in self.ways:
            places = [goals_at(self._floors, self.scene, target) for target in targets]
            self.ways[targets] = DistanceField.of(self._floors, np.concatenate(places))
        ways, place = self.ways[targets], np.array([start.x, start.floor, start.z])
        distance = float(ways.at(place))
        if not np.isfinite(distance):
            raise SceneError("there is no route from its start to a target.", "Use --skip.")
        return route_difficulty(self.scene, ways.path(place), distance)
