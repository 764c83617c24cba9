"""The splits `hands`, `mini-hands` and `smoke-hands`, drawn from seeds in the houses of val.

Four families: bring a thing to a piece of furniture, tidy one from the floor onto it, open a piece of furniture, look
inside and answer. An instruction names its objects by category, and by room where the house holds several; what stays
ambiguous is left out.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from humanclaw import EpisodeSpec, Scene
from humanclaw.body import Array, Pose2D
from humanclaw.records import Goal, name_of, route_difficulty
from humanclaw.world import DistanceField, MultiFloorMap, SceneObject, viewpoints
from humanclaw_bench.hands import FAMILIES, Family, family_of
from humanclaw_bench.splits import NEAREST, roomy

EACH: Final = 75
"""Episodes of each family in `hands`; 15 of them in `mini-hands`, 1 in `smoke-hands`."""
STEPS: Final[Mapping[Family, int]] = {"bring": 200, "tidy": 200, "open": 100, "look": 100}
"""Decisions at most: what is carried takes two ways."""
FAR: Final = 0.5
"""Metres from where a body can stand to a thing at most, so that an arm reaches it."""
OPEN: Final = 0.5
"""Share of the way to wide open that counts as open."""
_HEIGHTS: Final = (0.3, 1.3)
"""Heights over the floor of things to bring, metres."""
_TOPS: Final = (0.35, 1.1)
"""Heights over the floor of what things are put on, metres."""
_BRING: Final = frozenset({"book", "cup", "vase", "bottle", "bowl", "teddy_bear", "toy", "clock", "soap", "pot"})
_TIDY: Final = frozenset({"shoe", "box", "backpack", "teddy_bear", "book", "toy", "cup"})
"""Balls are left out: they roll off what they are put on."""
_PLACES: Final = frozenset({"table", "coffee_table", "desk", "console_table", "sideboard", "dresser", "bench"})
_OPENS: Final = {"fridge": "fridge", "wardrobe": "wardrobe", "dishwasher": "dishwasher", "stove": "oven"}
"""Furniture that opens, and its word."""
_INSIDE: Final = {
    "fridge": ("jar", "plate", "glass"),
    "wardrobe": ("towels", "handbag", "shoes", "storage_box"),
    "dishwasher": ("plate", "glass", "cup"),
    "stove": ("pan",),
}
"""What may be behind its doors."""
LIKE: Final[Mapping[str, frozenset[str]]] = {
    "book": frozenset({"books", "magazines"}),
    "bottle": frozenset({"toiletries", "detergent"}),
    "box": frozenset({"storage_box"}),
    "cup": frozenset({"glass", "toiletries", "dish_rack"}),
    "glass": frozenset({"cup", "jar"}),
    "handbag": frozenset({"backpack"}),
    "jar": frozenset({"glass", "bottle", "toiletries"}),
    "pan": frozenset({"pot"}),
    "plate": frozenset({"bowl", "dish_rack"}),
    "pot": frozenset({"pan", "potted_plant", "succulent"}),
    "shoe": frozenset({"shoes"}),
    "shoes": frozenset({"shoe"}),
    "storage_box": frozenset({"box", "basket"}),
    "table": frozenset({"coffee_table", "side_table"}),
    "towels": frozenset({"towel"}),
    "toy": frozenset({"teddy_bear"}),
}
"""Other categories to which people may apply the word for a category, or to a part of them."""
_WORDS: Final = {"towels": "a pile of towels", "shoes": "a pair of shoes", "storage_box": "a box"}


@dataclass(frozen=True, eq=False)
class House:
    """A house in which tasks are drawn."""

    scene: Scene

    @cached_property
    def floors(self) -> MultiFloorMap:
        return MultiFloorMap.of(self.scene)

    @cached_property
    def _bodies(self) -> tuple[SceneObject, ...]:
        return tuple(obj for obj in self.scene.objects if obj.joint is None)

    @cached_property
    def _counts(self) -> Counter[tuple[str, str]]:
        return Counter((obj.category, room) for obj in self._bodies for room in {"", obj.room})

    def _called(self, category: str, room: str) -> int:
        """Return how many objects the word for a category may mean. room: empty for the whole house."""
        return sum(self._counts[name, room] for name in {category, *LIKE.get(category, ())})

    def phrase(self, obj: SceneObject, noun: str = "") -> str:
        """Name an object as nothing else in the house; empty if category and room do not."""
        noun = noun or obj.category.replace("_", " ")
        if self._called(obj.category, "") == 1:
            return f"the {noun}"
        room = next((other for other in self.scene.rooms if other.name == obj.room), None)
        alone = room is not None and sum(other.kind == room.kind for other in self.scene.rooms) == 1
        if not alone or self._called(obj.category, obj.room) > 1:
            return ""
        assert room is not None
        return f"the {noun} in the {room.called}"

    def height(self, key: int) -> tuple[float, float]:
        """Return how high over its floor an object begins and ends, metres."""
        low, high = self.scene.aabb(key)
        floor = max((grid.floor for grid in self.floors.floors if grid.floor < low[1] + 0.1), default=0.0)
        return float(low[1] - floor), float(high[1] - floor)

    def near(self, key: int) -> Array:
        """Return (N, 3) places from which an arm reaches an object."""
        stands = viewpoints(self.floors, self.scene, key)
        return np.array([stand.place for stand in stands if stand.gap <= FAR]).reshape(-1, 3)

    def leaves(self, body: SceneObject) -> tuple[SceneObject, ...]:
        """Return the doors, drawers and lids of a piece of furniture."""
        # Grown by 10 cm: the middle of a front lies up to 5 cm before its piece of furniture.
        low, high = (corner + 0.1 * sign for corner, sign in zip(self.scene.aabb(body.id), (-1, 1), strict=True))
        hung = [obj for obj in self.scene.of_category(body.category) if obj.joint is not None]
        return tuple(obj for obj in hung if (np.mean(self.scene.aabb(obj.id), axis=0) > low).all()
                     and (np.mean(self.scene.aabb(obj.id), axis=0) < high).all())  # fmt: skip

    def holds(self, body: SceneObject) -> tuple[SceneObject, ...]:
        """Return what is inside a piece of furniture."""
        low, high = self.scene.aabb(body.id)
        middles = ((obj, np.mean(self.scene.aabb(obj.id), axis=0)) for obj in self._bodies if obj.id != body.id)
        return tuple(obj for obj, middle in middles if ((middle > low) & (middle < high)).all())


@dataclass(frozen=True)
class Task:
    """A task without its start."""

    family: Family
    words: str
    category: str
    goal: Goal
    also: tuple[int, ...] = ()
    """Further targets of the record: the furniture."""

    @property
    def targets(self) -> tuple[int, ...]:
        return tuple(dict.fromkeys((*self.goal.things, *self.also)))


def tasks(house: House, rng: np.random.Generator) -> Iterator[Task]:
    """Yield the tasks of a house in random order: a place for each thing, and questions for each piece of furniture."""
    for number in rng.permutation(len(house.scene.objects)).tolist():
        obj = house.scene.objects[number]
        if obj.movable and obj.joint is None and obj.mass and obj.category in _BRING | _TIDY:
            yield from _carrying(house, obj, rng)
        elif obj.category in _OPENS and obj.joint is None:
            yield from _opening(house, obj, rng)


def _carrying(house: House, thing: SceneObject, rng: np.random.Generator) -> Iterator[Task]:
    low, _ = house.height(thing.id)
    family: Family = "tidy" if low < 0.05 else "bring"
    high_enough = _HEIGHTS[0] < low < _HEIGHTS[1]
    fits = thing.category in (_TIDY if family == "tidy" else _BRING) and (family == "tidy" or high_enough)
    name = house.phrase(thing)
    if not (fits and name and len(house.near(thing.id))):
        return
    places = [obj for obj in house.scene.objects if _takes(house, obj) and not _over(house.scene, thing, obj)]
    if not places:
        return
    place = places[int(rng.integers(len(places)))]
    lies = f"{name} that lies on the floor" if family == "tidy" else name
    words = f"{'tidy up: ' * (family == 'tidy')}put {lies} on {house.phrase(place)}."
    yield Task(family, words, thing.category, Goal(things=(thing.id,), on=place.id), (place.id,))


def _takes(house: House, place: SceneObject) -> bool:
    if place.category not in _PLACES or place.joint is not None or not house.phrase(place):
        return False
    return _TOPS[0] < house.height(place.id)[1] < _TOPS[1] and len(house.near(place.id)) > 0


def _over(scene: Scene, thing: SceneObject, place: SceneObject) -> bool:
    """Tell whether a thing is over a piece of furniture."""
    middle, (low, high) = np.mean(scene.aabb(thing.id), axis=0), scene.aabb(place.id)
    return bool(((low <= middle) & (middle <= high))[[0, 2]].all())


def _opening(house: House, body: SceneObject, rng: np.random.Generator) -> Iterator[Task]:
    noun, leaves = _OPENS[body.category], house.leaves(body)
    name = house.phrase(body, noun)
    if not (name and leaves and all(leaf.state == 0 for leaf in leaves) and len(house.near(body.id))):
        return
    yield Task("open", f"open {name}.", body.category, _to_open(leaves), (body.id,))
    for what in rng.permutation(_INSIDE[body.category]).tolist():
        yield from _question(house, body, name, what)


def _question(house: House, body: SceneObject, name: str, what: str) -> Iterator[Task]:
    """Yield the question whether a thing is in a piece of furniture; none if only something like it is."""
    leaves, inside = house.leaves(body), house.holds(body)
    matching = [obj for obj in inside if obj.category == what]
    if not matching and any(obj.category in LIKE.get(what, ()) for obj in inside):
        return
    before = tuple(leaf for leaf in leaves if any(_hides(house.scene, leaf, obj) for obj in matching))
    goal = _to_open(before or leaves, "yes" if matching else "no")
    question = f"is there {_WORDS.get(what, f'a {what}')} in {name}? Open it, look inside, and answer yes or no."
    yield Task("look", question, body.category, goal, (body.id,))


def _to_open(leaves: Sequence[SceneObject], answer: str = "") -> Goal:
    ways = {leaf.id: (0.0, _wide(leaf)) for leaf in leaves}
    return Goal(things=tuple(ways), share=OPEN, ways=ways, answer=answer)


def _hides(scene: Scene, leaf: SceneObject, thing: SceneObject) -> bool:
    """Tell whether a shut door is before a thing: the thing's middle is beside it in one direction alone."""
    middle, (low, high) = np.mean(scene.aabb(thing.id), axis=0), scene.aabb(leaf.id)
    return int(((low <= middle) & (middle <= high)).sum()) == 2


def _wide(leaf: SceneObject) -> float:
    assert leaf.joint is not None
    return max(leaf.joint.low, leaf.joint.high, key=abs)


# -- episodes ----------------------------------------------------------------------------------------------------------
def episodes(scene: Scene, number: int, seed: int = 0) -> Iterator[EpisodeSpec]:
    """Yield an episode of each task of a house, three of things, from starts a metre away or more that lead there."""
    rng, house = np.random.default_rng([seed, number, 38]), House(scene)
    room = np.stack([roomy(grid) for grid in house.floors.grids])
    for task in tasks(house, rng):
        ways = DistanceField.of(house.floors, house.near(task.targets[0] if task.goal.on is not None else task.also[0]))
        if task.goal.on is not None and not np.isfinite(_way(house, task)):
            continue
        cells = np.argwhere(room & (ways.metres > NEAREST) & np.isfinite(ways.metres))
        for level, x, z in rng.permutation(cells)[: 3 if task.goal.on is not None else 1].tolist():
            grid = house.floors.grids[level]
            east, north = grid.point(np.array([x, z])).round(3).tolist()
            place, yaw = np.array([east, grid.floor, north]), round(float(rng.uniform(-np.pi, np.pi)), 3)
            yield EpisodeSpec(
                id=task.family, instruction=task.words, scene=scene.name, scene_digest=scene.digest,
                start=Pose2D(x=east, z=north, yaw=yaw, floor=grid.floor), target_category=task.category,
                target_ids=task.targets, goal=task.goal, max_steps=STEPS[task.family],
                difficulty=route_difficulty(scene, ways.path(place), float(ways.at(place))),
            )  # fmt: skip


def _way(house: House, task: Task) -> float:
    """Return the way from a thing to the place that it is put on, metres; infinite if there is none."""
    assert task.goal.on is not None
    field = DistanceField.of(house.floors, house.near(task.goal.on))
    return min((float(field.at(place)) for place in house.near(task.goal.things[0])), default=np.inf)


def choose(candidates: Iterable[EpisodeSpec]) -> dict[str, tuple[EpisodeSpec, ...]]:
    """Return the three splits: of each family one episode from every house in turn, until there are enough. Each split
    is part of the one before it. Of every question as many answers are yes as are no."""
    pools: dict[Family, dict[str, list[EpisodeSpec]]] = {family: defaultdict(list) for family in FAMILIES}
    for spec in candidates:
        pools[family_of(spec)][spec.scene].append(spec)
    turns = {family: _in_turn(pools[family]) for family in FAMILIES}
    taken = [spec for chosen in (turns | {"look": _balanced(turns["look"])}).values() for spec in chosen[:EACH]]
    hands = tuple(
        spec.model_copy(update={"id": f"{name_of(spec.scene)}-{spec.id}-{spec.target_category}-{k}", "seed": k})
        for k, spec in enumerate(taken)
    )
    each = {family: [spec for spec in hands if family_of(spec) == family] for family in FAMILIES}
    pairs = {family: [spec for k, spec in enumerate(specs) if k % 10 < 2] for family, specs in each.items()}
    mini = tuple(spec for family in FAMILIES for spec in pairs[family][:15])
    smoke = tuple(next(spec for spec in mini if family_of(spec) == family) for family in FAMILIES)
    return {"hands": hands, "mini-hands": mini, "smoke-hands": smoke}


def _in_turn(pool: Mapping[str, Sequence[EpisodeSpec]]) -> list[EpisodeSpec]:
    rounds = max(map(len, pool.values()), default=0)
    return [specs[k] for k in range(rounds) for specs in pool.values() if k < len(specs)]


def _balanced(looks: Sequence[EpisodeSpec]) -> list[EpisodeSpec]:
    """Return pairs of a question that is answered no, and the same one, about other furniture, that is answered yes."""
    yes: dict[tuple[str, str], list[EpisodeSpec]] = defaultdict(list)
    for spec in looks:
        if spec.goal and spec.goal.answer == "yes":
            yes[asked(spec)].append(spec)
    no = (spec for spec in looks if spec.goal and spec.goal.answer == "no")
    return [look for spec in no if yes[asked(spec)] for look in (spec, yes[asked(spec)].pop(0))]


def asked(spec: EpisodeSpec) -> tuple[str, str]:
    """Return the furniture and what is asked for in it."""
    return spec.target_category, spec.instruction.partition(" in the ")[0]
