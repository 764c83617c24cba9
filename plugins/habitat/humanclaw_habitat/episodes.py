"""ObjectNav episodes as EpisodeSpecs.

The files are those of Habitat-Lab's ObjectNav-v1: content/SCENE.json.gz with `episodes` and `goals_by_category`, whose keys are
`<scene>_<category>`. A goal's object_id is the index of its object in the scene's object_instances. Two fields that the reference
release adds are honoured: `init_offset`, which moves the start, and `init_yaw`, which replaces its heading.
"""

from __future__ import annotations

import gzip
import json
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from humanclaw import EpisodeSpec, HumanclawError, Scene, SceneError
from humanclaw.navigation import DistanceField, MultiFloorMap, goals_at, route_difficulty
from humanclaw.pose import Pose2D, wrap_angle
from humanclaw.records import Difficulty, name_of
from humanclaw.scene import distance_to_box
from humanclaw.tasks import SEATS, instruction
from humanclaw_habitat.attributes import Vec3
from humanclaw_habitat.categories import GOALS, category_of
from humanclaw_habitat.frames import heading

_ASTRAY: Final = 1.0
"""A goal farther than this from its object's bounding box is not at that object, metres."""
_FLOOR: Final = 0.5
"""A start stands on the scene's floor that is at most so far from its height, metres."""


class Goal(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")

    object_id: int
    """Index into the scene's object_instances."""
    position: Vec3 | None = None


class Task(BaseModel):
    """One episode of a file."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    episode_id: str | int
    scene_id: str
    start_position: Vec3
    start_rotation: tuple[float, float, float, float]
    """x, y, z, w"""
    object_category: str
    init_offset: tuple[float, float] | Vec3 | None = None
    """Metres in the world, added to start_position: x and z, or x, y and z."""
    init_yaw: float | None = None
    """Radians, 0 facing +Z, left turns positive."""
    goals: tuple[Goal, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _from_info(cls, values: Any) -> Any:
        """Fields that some files keep in `info`."""
        info = values.get("info") if isinstance(values, Mapping) else None
        extra = {key: info[key] for key in ("init_offset", "init_yaw") if key in info} if info else {}
        return {**extra, **values} if extra else values

    @model_validator(mode="after")
    def _sensible(self) -> Task:
        if np.linalg.norm(self.start_rotation) < 0.5:
            raise ValueError(f"start_rotation must be a quaternion x, y, z, w; got {self.start_rotation}")
        if self.init_yaw is not None and abs(self.init_yaw) > 2 * np.pi:
            raise ValueError(f"init_yaw must be in radians; got {self.init_yaw}, which looks like degrees")
        return self

    @property
    def scene(self) -> str:
        """Name of the scene, without folder and endings."""
        return re.sub(r"(\.scene_instance\.json|\.basis\.glb|\.glb|\.json)$", "", Path(self.scene_id).name)

    @property
    def start(self) -> Pose2D:
        offset = self.init_offset or (0.0, 0.0)
        x, y, z = np.add(self.start_position, (offset[0], offset[1] if len(offset) == 3 else 0.0, offset[-1])).tolist()
        yaw = heading(self.start_rotation) if self.init_yaw is None else float(wrap_angle(self.init_yaw))
        return Pose2D(x=round(x, 4), z=round(z, 4), yaw=round(yaw, 4), floor=round(y, 4))


@dataclass(frozen=True)
class Book:
    """One file of episodes."""

    path: Path
    tasks: tuple[Task, ...]
    goals: Mapping[str, Sequence[Goal]]

    def goals_of(self, task: Task) -> Sequence[Goal]:
        """All goals of a task: those of its category in its scene, or its own where the file keeps them there."""
        keys = [f"{name}_{task.object_category}" for name in (Path(task.scene_id).name, task.scene)]
        return next((self.goals[key] for key in keys if key in self.goals), task.goals)


@dataclass
class Conversion:
    """What became of some files."""

    specs: list[EpisodeSpec] = field(default_factory=list)
    left_out: Counter[str] = field(default_factory=Counter)
    """Why episodes could not be taken, and how many."""


def read_books(path: Path) -> list[Book]:
    """The files of a split: a *.json.gz or *.json, or a folder that has them in it or in its folder content.

    Raises HumanclawError if there is none or one is malformed.
    """
    place = path / "content" if (path / "content").is_dir() else path
    files = sorted(file for file in place.glob("*.json*") if file.name.endswith((".json", ".json.gz")))
    if path.is_file():
        beside = path.parent / "content"
        book = _book(path)
        # val.json.gz next to a folder content is an empty list of what is in there.
        return [book] if book.tasks or not beside.is_dir() else read_books(path.parent)
    if not files:
        raise HumanclawError(f"{path} holds no episodes.", "Name a folder with content/*.json.gz, or one such file.")
    return [_book(file) for file in files]


def _book(path: Path) -> Book:
    try:
        data = path.read_bytes()
        values = json.loads(gzip.decompress(data) if path.suffix == ".gz" else data)
        tasks = tuple(Task.model_validate(entry) for entry in values["episodes"])
        goals = {key: [Goal.model_validate(goal) for goal in found]
                 for key, found in values.get("goals_by_category", {}).items()}  # fmt: skip
    except OSError as error:
        raise HumanclawError(f"{path} cannot be read: {error.strerror or error}.", "Is it a whole .json.gz?") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise HumanclawError(
            f"{path}: {error.title}: {where or 'an entry'}: {first['msg']}.", "See ObjectNav-v1."
        ) from error
    except (ValueError, KeyError, TypeError, AttributeError, EOFError) as error:
        raise HumanclawError(
            f"{path} is no ObjectNav file: {type(error).__name__}: {error}.", "See ObjectNav-v1."
        ) from error
    return Book(path, tasks, goals)


def convert(
    books: Iterable[Book], scene_of: Callable[[str], Scene], *, max_steps: int = 100, skip: bool = False
) -> Conversion:
    """Episodes of all books, scene by scene. scene_of: the scene of a name, with its reference as its name.

    An episode whose category is none of GOALS is left out, and so is, with skip, one that has no target in the scene or whose
    start has no way to one. Raises HumanclawError without skip.
    """
    by_scene: dict[str, list[tuple[Book, Task]]] = defaultdict(list)
    for book in books:
        for task in book.tasks:
            by_scene[task.scene].append((book, task))
    result = Conversion()
    for name, tasks in sorted(by_scene.items()):
        try:
            site = _Site(scene_of(name))
        except SceneError as error:
            if not skip:
                raise
            result.left_out[error.message] += len(tasks)
            continue
        for book, task in tasks:
            _take(task, book, site, result, max_steps, skip)
    return result


def _take(task: Task, book: Book, site: _Site, result: Conversion, max_steps: int, skip: bool) -> None:
    """Add an episode to what is converted, or why it is not."""
    try:
        spec = site.spec(task, book.goals_of(task), max_steps)
    except _UnfitError as error:
        result.left_out[str(error)] += 1
    except SceneError as error:
        if not skip:
            raise HumanclawError(f"{book.path}: episode {task.episode_id}: {error.message}", error.remedy) from error
        result.left_out[f"{task.scene}: {error.message}"] += 1
    else:
        same = sum(known.id.split("..")[0] == spec.id for known in result.specs)
        name = f"{spec.id}..{same}" if same else spec.id
        result.specs.append(spec.model_copy(update={"id": name, "seed": len(result.specs)}))


class _UnfitError(Exception):
    """An episode whose goal is none of GOALS."""


@dataclass
class _Site:
    """A scene and what is known of the ways in it."""

    scene: Scene
    ways: dict[tuple[int, ...], DistanceField] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._floors = MultiFloorMap.of(self.scene)

    def spec(self, task: Task, goals: Sequence[Goal], max_steps: int) -> EpisodeSpec:
        category = category_of([task.object_category])
        if category not in GOALS:
            raise _UnfitError(f"{task.object_category} is not among {', '.join(GOALS)}")
        targets = tuple(dict.fromkeys(self._targets(task, goals)))
        start = self._standing(task.start)
        return EpisodeSpec(
            id=name_of(f"{task.scene}-{category}-{task.episode_id}"), instruction=instruction(category),
            scene=self.scene.name, scene_digest=self.scene.digest, start=start, target_category=category,
            target_ids=targets, interact=category in SEATS, max_steps=max_steps,
            difficulty=self._difficulty(start, targets),
        )  # fmt: skip

    def _targets(self, task: Task, goals: Sequence[Goal]) -> Iterator[int]:
        """Ids of the objects that goals name, those left out of the scene passed over. Raises SceneError if none is there."""
        found = [goal for goal in goals if goal.object_id + 1 in self.scene.by_id]
        if not found:
            said = f"its {len(goals)} goals are not in the scene" if goals else "the file has no goals"
            raise SceneError(f"no {task.object_category} for it: {said}.", "Load the scene whole, or use --skip.")
        for goal in found:
            thing = self.scene.by_id[goal.object_id + 1]
            away = (
                0.0 if goal.position is None else distance_to_box(np.array(goal.position), *self.scene.aabb(thing.id))
            )
            if away > _ASTRAY:
                raise SceneError(
                    f"its goal object {goal.object_id} is {float(away):.1f} m from where the goal says; the scene has "
                    f"{thing.category} there.", "Are the episodes for this version of the dataset?",
                )  # fmt: skip
            yield thing.id

    def _standing(self, start: Pose2D) -> Pose2D:
        """The start on the scene's own floor: those of a navigation mesh hover a little."""
        floors = [plan.floor for plan in self._floors.floors]
        near = min(floors, key=lambda floor: abs(floor - start.floor))
        if abs(near - start.floor) > _FLOOR:
            said = ", ".join(f"{floor:g}" for floor in floors)
            raise SceneError(f"it starts at height {start.floor}, but the floors are at {said}.", "Use --skip.")
        return replace(start, floor=near)

    def _difficulty(self, start: Pose2D, targets: tuple[int, ...]) -> Difficulty:
        """Of the way to the nearest target. Raises SceneError if there is none."""
        if targets not in self.ways:
            places = [goals_at(self._floors, self.scene, target) for target in targets]
            self.ways[targets] = DistanceField.of(self._floors, np.concatenate(places))
        ways, place = self.ways[targets], np.array([start.x, start.floor, start.z])
        distance = float(ways.at(place))
        if not np.isfinite(distance):
            raise SceneError("there is no way from its start to a target.", "Use --skip.")
        return route_difficulty(self.scene, ways.path(place), distance)
