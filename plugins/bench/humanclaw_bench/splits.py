"""The fixed splits of the benchmark, and their generation from seeds (paper, section 4.1).

Many candidate episodes are drawn in each house, each with a route to its target. An integer program chooses among them
so that houses, distances and difficulty are distributed as in the paper.
"""

from __future__ import annotations

import difflib
import importlib.resources
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np
import scipy  # Its parts load when they are used.
from numpy.typing import NDArray

from humanclaw import EpisodeSpec, HumanclawError, Plugins, Scene
from humanclaw.body import Array, Pose2D
from humanclaw.records import SEATS, instruction, name_of, read_episodes, route_difficulty
from humanclaw.world import CELL, DistanceField, MultiFloorMap, OccupancyGrid, goals_at
from humanclaw_bench.difficulty import THRESHOLDS, TIERS, overall, tiers

SPLITS: Final = ("val", "val-400", "mini", "smoke", "dev")
HANDS: Final = ("hands", "mini-hands", "smoke-hands")
"""Splits of the extension for hands (humanclaw_bench.hands); no part of the paper's."""
SELF: Final = "self"
"""The split of questions about oneself (humanclaw_bench.oneself); no part of the paper's either."""
TWO: Final = "two"
"""The split with a partner in a second body (humanclaw_bench.two); no part of the paper's either."""
DATA: Final = Path(str(importlib.resources.files("humanclaw_bench"))) / "data"
"""Folder of the splits in the package."""
HOUSES: Final = tuple(f"house:{number}" for number in range(41))
DEV_HOUSES: Final = tuple(f"house:train-{500_000 + number}" for number in range(41))
"""Houses of the development split. No other split has them."""
HIDDEN_HOUSES: Final = 1_000_000
"""Number of the first training house that only hidden tests may have."""
EPISODES: Final = {"chair": 231, "couch": 231, "bed": 218, "potted_plant": 205, "tv": 185, "toilet": 148}
"""Episodes of each category in the validation split of the paper's release."""
CATEGORIES: Final = tuple(EPISODES)
TIER_SHARES: Final = dict(zip(TIERS, (0.23, 0.46, 0.31), strict=True))
DISTANCE_EDGES: Final = (3.5, 4.4, 8.0, 12.8)
DISTANCE_SHARES: Final = (0.40, 0.10, 0.24, 0.17, 0.09)
"""Share of the episodes in each range between DISTANCE_EDGES (metres).

From the paper's release: the tiers 40/34/25 %, the median of 4.4 m, and 90 % under 12.8 m.
"""
STARTS: Final = 8
"""Number of starts drawn in each house for each category and range of distances."""
ROOM: Final = 0.5
"""Free distance around a body that stands still, metres."""
TOLERANCE: Final = 0.01
"""Deviation of a share that costs nothing. Without it, the search for an exact solution would take forever."""
NEAREST: Final = 1.0
"""Smallest distance from start to target, metres: nearer, there is nothing to find."""
APART: Final = 1.0
"""Smallest distance between starts of the same house and category, metres: nearer, the episodes would be the same."""


# -- reading -----------------------------------------------------------------------------------------------------------
def load_split(name: str, plugins: Plugins | None = None) -> tuple[EpisodeSpec, ...]:
    """Return the episodes of a split in SPLITS or HANDS, of SELF or TWO, of a task of plugins, or of a file.

    Raises HumanclawError if there is none or it is malformed.
    """
    known = (*SPLITS, *HANDS, SELF, TWO)
    own = {item.name: item.value.episodes for item in (plugins.registered("splits") if plugins else ())}
    if name in own and name in known:
        raise HumanclawError(f"a plugin's task has the name of the split {name}.", "Rename its function.")
    if name in own:
        return tuple(own[name])
    if name not in known and not Path(name).exists():
        raise _unknown(name, (*known, *own))
    return read_episodes(DATA / f"{name}.jsonl" if name in known else Path(name))


def _unknown(name: str, known: Sequence[str]) -> HumanclawError:
    if Path(name).suffix or Path(name).name != name:
        return HumanclawError(f"there is no file {name}.", "Name a file of episodes, or a split.")
    near = difflib.get_close_matches(name, known, 1, 0.6)
    listed = f"Name one of {', '.join(known)}, a task of --plugin FILE, or a file."
    return HumanclawError(f"there is no split {name}.", f"Did you mean {near[0]}?" if near else listed)


# -- candidates --------------------------------------------------------------------------------------------------------
def candidates(
    scene: Scene, number: int, *, starts: int = STARTS, seed: int | Sequence[int] = 0
) -> Iterator[EpisodeSpec]:
    """Yield possible episodes of a house: for each category, up to `starts` starts in each range of distances.

    Each is solvable by construction: a body of the usual width can walk from the start to a place beside a target, and
    if the task includes sitting, to a place from which a target can be sat on. number: of the house, for the seed.
    """
    rng = np.random.default_rng([*np.atleast_1d(seed), number])
    floors = MultiFloorMap.of(scene)
    room = np.stack([roomy(grid) for grid in floors.grids])
    for category in CATEGORIES:
        ways, usable = DistanceField.of(floors, _goals(floors, scene, category)), room
        if category in SEATS:
            usable = room & np.isfinite(DistanceField.of(floors, _goals(floors, scene, category, sit=True)).metres)
        for place in _places(ways, usable, starts, rng):
            yield _candidate(scene, ways, category, place, round(float(rng.uniform(-np.pi, np.pi)), 3))


def roomy(grid: OccupancyGrid) -> NDArray[np.bool_]:
    """Return the cells of a floor where a body can stand still; none on stairs."""
    if grid.slope is not None:
        return np.zeros(grid.blocked.shape, bool)
    return np.asarray(grid.fits(ROOM) & (scipy.ndimage.distance_transform_edt(~grid.movable) * CELL >= ROOM))


def _goals(floors: MultiFloorMap, scene: Scene, category: str, *, sit: bool = False) -> Array:
    """Return (N, 3) places beside the targets of a category. sit: only places from which one can be sat on."""
    places = (goals_at(floors, scene, obj.id, sit=sit) for obj in scene.of_category(category))
    return np.concatenate([np.empty((0, 3)), *places])


def _places(ways: DistanceField, usable: NDArray[np.bool_], count: int, rng: np.random.Generator) -> Iterator[Array]:
    """Yield (3,) starts on the floor, up to `count` in each range of distances."""
    edges = (NEAREST, *DISTANCE_EDGES, np.inf)
    for low, high in pairwise(edges):
        cells = np.argwhere(usable & (ways.metres > low) & (ways.metres <= high) & np.isfinite(ways.metres))
        for level, x, z in rng.permutation(cells)[:count]:
            grid = ways.where.grids[level]
            east, north = grid.point(np.array([x, z])).round(3)
            yield np.array([east, grid.floor, north])


def _candidate(scene: Scene, ways: DistanceField, category: str, place: Array, yaw: float) -> EpisodeSpec:
    """Return the episode from a place to the nearest target."""
    x, floor, z = place.tolist()
    return EpisodeSpec(
        id=category,
        instruction=instruction(category),
        scene=scene.name,
        scene_digest=scene.digest,
        start=Pose2D(x=x, z=z, yaw=yaw, floor=floor),
        target_category=category,
        target_ids=tuple(obj.id for obj in scene.of_category(category)),
        interact=category in SEATS,
        difficulty=route_difficulty(scene, ways.path(place), float(ways.at(place))),
    )


# -- choosing ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Quota:
    """Numbers of episodes to choose."""

    categories: Mapping[str, int]
    """Exact number for each category."""
    houses: tuple[int, int]
    """Smallest and largest number in each house."""
    both: Mapping[str, tuple[int, int]]
    """Smallest and largest number of each category in each house."""

    @property
    def total(self) -> int:
        return sum(self.categories.values())


def choose(specs: Sequence[EpisodeSpec], quota: Quota) -> tuple[EpisodeSpec, ...]:
    """Return the candidates that meet the quota and come closest to the paper's distances and tiers.

    An integer program chooses the number of episodes in each cell: candidates with the same house, category, range of
    distance and tier. The first of a cell are taken. Raises HumanclawError if the quota cannot be met.
    """
    cells: dict[tuple[str, str, int, str], list[EpisodeSpec]] = defaultdict(list)
    for spec in specs:
        cells[_cell(spec)].append(spec)
    counts = _solve(list(cells), [len(alike) for alike in cells.values()], quota)
    chosen = [spec for alike, count in zip(cells.values(), counts, strict=True) for spec in alike[:count]]
    order = {id(spec): number for number, spec in enumerate(specs)}
    return tuple(sorted(chosen, key=lambda spec: order[id(spec)]))


def _cell(spec: EpisodeSpec) -> tuple[str, str, int, str]:
    assert spec.difficulty is not None
    return spec.scene, spec.target_category, bin_of(spec.difficulty.distance), overall(spec.difficulty)


def bin_of(distance: float) -> int:
    """Return the range between DISTANCE_EDGES of a distance, metres."""
    return int(np.searchsorted(DISTANCE_EDGES, distance, side="left"))


def _solve(cells: Sequence[tuple[str, str, int, str]], most: Sequence[int], quota: Quota) -> list[int]:
    """Return the number to take of each cell.

    Variables: one per cell, then the shortfall and the excess of each wanted share. Their sum is minimised.
    """
    (hard, soft), n = _wishes(cells, quota), len(cells)
    slack = np.concatenate([np.eye(len(soft)), -np.eye(len(soft))], 1)
    rows = np.array([row for row, *_ in hard] + [row for row, _ in soft], float)
    table = np.concatenate([rows, np.concatenate([np.zeros((len(hard), 2 * len(soft))), slack])], 1)
    wanted = [share * quota.total for _, share in soft]
    # Half an episode, because a share of them is rarely a whole number.
    slack_free = TOLERANCE * quota.total + 0.5
    limits = scipy.optimize.LinearConstraint(
        scipy.sparse.csr_array(table),
        [low for _, low, _ in hard] + [count - slack_free for count in wanted],
        [high for *_, high in hard] + [count + slack_free for count in wanted],
    )
    # A gap of 10 % and 500 nodes: a nearly optimal choice is as good as an optimal one, and found much sooner.
    result = scipy.optimize.milp(
        np.concatenate([np.zeros(n), np.ones(2 * len(soft))]),
        constraints=limits,
        integrality=np.concatenate([np.ones(n), np.zeros(2 * len(soft))]),
        bounds=scipy.optimize.Bounds(0, np.concatenate([most, np.full(2 * len(soft), np.inf)])),
        options={"mip_rel_gap": 0.1, "node_limit": 500},
    )
    if result.x is None:
        said = f"these houses have no {quota.total} episodes that meet the quota: {result.message}"
        raise HumanclawError(said, "Draw more starts with --starts.")
    return [round(value) for value in result.x[:n]]


def _wishes(
    cells: Sequence[tuple[str, str, int, str]], quota: Quota
) -> tuple[list[tuple[list[bool], int, int]], list[tuple[list[bool], float]]]:
    """Return the bounds as (of which cells, least, most), and the wanted shares as (of which cells, share)."""
    houses = sorted({house for house, *_ in cells})
    hard = [([cell[0] == house for cell in cells], *quota.houses) for house in houses]
    hard += [([cell[1] == name for cell in cells], count, count) for name, count in quota.categories.items()]
    hard += [
        ([cell[:2] == (house, name) for cell in cells], *quota.both[name])
        for house in houses
        for name in quota.categories
    ]
    soft = [([cell[2] == k for cell in cells], share) for k, share in enumerate(DISTANCE_SHARES)]
    soft += [([cell[3] == tier for cell in cells], share) for tier, share in TIER_SHARES.items()]
    return hard, soft


# -- the splits --------------------------------------------------------------------------------------------------------
def _each(low: int, high: int) -> dict[str, tuple[int, int]]:
    return dict.fromkeys(EPISODES, (low, high))


def _even(categories: Mapping[str, int]) -> dict[str, tuple[int, int]]:
    """Return bounds per house around the mean of all houses: 4 to 7 for frequent categories, 2 to 5 for rare ones.

    The lower bound is the mean minus 1, because a studio has room for only four starts a metre apart.
    """
    means = {name: count // len(HOUSES) for name, count in categories.items()}
    return {name: (mean - 1, mean + 2) for name, mean in means.items()}


VAL: Final = Quota(EPISODES, (28, 30), _even(EPISODES))
# A hundred episodes in the shares of EPISODES, and three hundred more.
MINI: Final = Quota(
    {"chair": 19, "couch": 19, "bed": 18, "potted_plant": 17, "tv": 15, "toilet": 12}, (1, 4), _each(0, 1)
)
BETWEEN: Final = Quota(
    {"chair": 57, "couch": 57, "bed": 53, "potted_plant": 50, "tv": 46, "toilet": 37}, (6, 9), _each(0, 3)
)
"""Episodes of val-400 besides those of mini."""
SMOKE: Final = Quota({"chair": 1, "couch": 1, "bed": 1, "tv": 1, "toilet": 1}, (0, 1), _each(0, 1))


def spaced(specs: Sequence[EpisodeSpec]) -> tuple[EpisodeSpec, ...]:
    """Leave out episodes that start within APART of an earlier one of the same house, category and floor."""
    kept: dict[tuple[str, str], list[Pose2D]] = defaultdict(list)
    result = []
    for spec in specs:
        start, others = spec.start, kept[spec.scene, spec.target_category]
        assert start is not None
        if all(_apart(start, other) for other in others):
            others.append(start)
            result.append(spec)
    return tuple(result)


def _apart(first: Pose2D, other: Pose2D) -> bool:
    return float(np.hypot(first.x - other.x, first.z - other.z)) >= APART or abs(first.floor - other.floor) > 1.0


def make(specs: Sequence[EpisodeSpec]) -> dict[str, tuple[EpisodeSpec, ...]]:
    """Return all splits from the candidates of HOUSES and DEV_HOUSES.

    Of val, val-400, mini and smoke, each is part of the one before it. dev is as large as mini.
    """
    dev = named(choose(spaced([spec for spec in specs if spec.scene in DEV_HOUSES]), MINI))
    val = named(choose(spaced([spec for spec in specs if spec.scene not in DEV_HOUSES]), VAL))
    mini = choose(val, MINI)
    smoke = choose([spec for spec in mini if not _long(spec)], SMOKE)
    return {"val": val, "val-400": between(val, mini), "mini": mini, "smoke": smoke, "dev": dev}


def between(val: Sequence[EpisodeSpec], mini: Sequence[EpisodeSpec]) -> tuple[EpisodeSpec, ...]:
    """Return val-400: mini and 300 more of val."""
    chosen = {spec.id for spec in mini}
    chosen |= {spec.id for spec in choose([spec for spec in val if spec.id not in chosen], BETWEEN)}
    return tuple(spec for spec in val if spec.id in chosen)


def secret_houses(secret: int) -> tuple[str, ...]:
    """Return the houses of a hidden test, which only the secret leads to: as many as val has, and none of val's.

    They are training houses with numbers of a million and more, so that nobody trains in them by chance.
    """
    rng = np.random.default_rng([secret, 1])
    # Up to house 999,999,999: numbers of houses have nine digits at most.
    numbers = rng.choice(999_000_000, len(HOUSES), replace=False) + HIDDEN_HOUSES
    return tuple(f"house:train-{number}" for number in sorted(numbers.tolist()))


def hidden(specs: Sequence[EpisodeSpec]) -> dict[str, tuple[EpisodeSpec, ...]]:
    """Return the hidden test from the candidates of secret houses, with the quota of val."""
    return {"test": named(choose(spaced(specs), VAL))}


def _long(spec: EpisodeSpec) -> bool:
    return spec.difficulty is None or spec.difficulty.distance > 8.0


def named(specs: Sequence[EpisodeSpec]) -> tuple[EpisodeSpec, ...]:
    """Give each episode a unique id, such as house-3-couch-2, and a unique seed."""
    counts: Counter[tuple[str, str]] = Counter()
    result = []
    for seed, spec in enumerate(specs):
        key = (spec.scene, spec.target_category)
        name = f"{name_of(spec.scene)}-{spec.target_category}-{counts[key]}"
        counts[key] += 1
        result.append(spec.model_copy(update={"id": name, "seed": seed}))
    return tuple(result)


def summary(specs: Sequence[EpisodeSpec]) -> dict[str, str]:
    """Return the composition of a split as text, for a person to check."""
    known = [spec.difficulty for spec in specs if spec.difficulty]
    metres = np.array([difficulty.distance for difficulty in known])
    houses = Counter(spec.scene for spec in specs).values()
    categories = Counter(spec.target_category for spec in specs)
    by_tier = {name: Counter(tiers(difficulty)[name] for difficulty in known) for name in THRESHOLDS}
    by_tier["overall"] = Counter(overall(difficulty) for difficulty in known)
    return {
        "episodes": f"{len(specs)}, {sum(spec.interact for spec in specs)} to sit",
        "houses": f"{len(houses)}, {min(houses)} to {max(houses)} episodes in each",
        "categories": ", ".join(f"{name} {count}" for name, count in categories.most_common()),
        "distance (m)": "median {:.2f}, nine tenths under {:.2f}".format(*np.quantile(metres, (0.5, 0.9))),
    } | {
        name: " / ".join(f"{count[tier] / len(known):.1%} {tier}" for tier in TIERS) for name, count in by_tier.items()
    }
