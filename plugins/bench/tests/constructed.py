"""Construct rollouts with a known root cause: facts in the paper's rule (appendix B) are fixed, all others are random.

Each rollout is drawn from a seed. With miss=True, the same seed gives the same rollout with the deciding fact on the
other side of its threshold. The label follows from the facts of construction; nothing here reads a finished record.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np
from rollouts import LAMP, TABLE, rollout, step, touch

from humanclaw import Decision, RecordedEpisode, StepRecord
from humanclaw.body import Pose2D
from humanclaw.records import Attempt

FIND: Final = (
    "target in view but not seen", "near but not in view", "too far", "unaware jammed", "ineffective actions",
    "midpoint give up", "ineffective exploration",
)  # fmt: skip
NAV: Final = (
    "unaware arrived/touch", "stop while far", "find too late", "unaware jammed", "ineffective actions",
    "target hallucination", "lost target",
)  # fmt: skip
INTERACT: Final = ("stand after sit", "sit on air", "sit wrong", "stop but never sit")
LABELS: Final = tuple(
    f"{stage}: {name}" for stage, names in (("find", FIND), ("nav", NAV), ("interact", INTERACT)) for name in names
)
SUCCESS: Final = ""
UNKNOWN: Final = "?"
T = TypeVar("T")

SEEN, NEAR, FAR, JAMMED, CONFINED, GAVE_UP, UNSEEN = range(7)
"""Name of each find rule to its position."""
ARRIVED, STOPPED, LATE, LODGED, FREE, CLAIMED, LOST = range(7)
"""Name of each nav rule to its position."""
STOOD, AIR, WRONG, NEVER = range(4)
"""Name of each interact rule to its position."""
FLOOR: Final = 1

NAMES: Final = {
    "chair": ("chair", "armchair", "stool"), "couch": ("couch", "sofa"), "bed": ("bed", "mattress"),
    "potted_plant": ("potted plant", "potted_plant", "flowerpot"), "tv": ("tv", "television"), "toilet": ("toilet",
    "lavatory"),
}  # fmt: skip
_SAYING: Final = (
    "A {} is 2 m ahead.",
    "I see the {} on my left. There is no door.",
    "Two {}s; a wall behind.",
    "TARGET in view: {}",
)
_DENYING: Final = (
    "No {} is visible.",
    "I can't see the {} any more.",
    "The {} is out of sight.",
    "Neither {} nor lamp.",
)
CLAIMS: Final = {key: [s.format(name) for s in _SAYING for name in names] for key, names in NAMES.items()}
"""Sentences that acknowledge a target of the category."""
SILENCE: Final = {
    key: ["", "A wall.", "A door, and a lamp beside it.", *(s.format(name) for s in _DENYING for name in names)]
    for key, names in NAMES.items()
}
"""Sentences that do not acknowledge it."""


# -- the body's ways ---------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Move:
    """What a step does: its call ("" for none that is usable), how far the body gets ahead (towards the target) and
    aside, and by how much the way that is left changes, metres."""

    skill: str
    params: dict[str, int] = field(default_factory=dict)
    ahead: float = 0.0
    aside: float = 0.0
    way: float = 0.0


@dataclass
class Mover:
    """Draws pieces of a rollout. Between pieces that stay in place the body goes on sideways, so that they never add
    up."""

    rng: np.random.Generator
    measured: bool
    """Whether the record holds geodesic ways. If not, the straight line counts, and pieces in place leave it as it
    is."""
    sits: bool = True
    """Whether sits may occur as noise."""

    def walk(self, ahead: float, aside: float, way: float = 0.0) -> Move:
        skill = _pick(self.rng, ["walk", "walk", "side_step", "step_back", "climb_upstairs"])
        cm = int(self.rng.integers(10, 41))
        params = {
            "walk": {"z_cm": 2 * cm, "x_cm": int(self.rng.integers(-30, 31))}, "side_step": {"x_cm": -cm},
            "step_back": {"z_cm": cm}, "climb_upstairs": {"d_cm": cm, "h_cm": 15},
        }  # fmt: skip
        return Move(skill, params[skill], ahead, aside, way)

    def turn(self) -> Move:
        return Move("turn_in_place", {"yaw_deg": int(self.rng.integers(1, 76))})

    def pause(self) -> Move:
        """A step that asks for neither way nor turn."""
        sit = self.sits and self.rng.random() < 0.5
        return Move("sit_in_place", {"h_cm": 45}) if sit else Move("")

    def roam(self, strides: int = 5) -> list[Move]:
        """Move on by more than 2 m, always to the same side, with up to two steps of noise."""
        moves = [self.walk(0.0, self.rng.uniform(0.5, 0.8)) for _ in range(strides)]
        for _ in range(self.rng.integers(3)):
            noise = self.turn() if self.rng.random() < 0.5 else self.pause()
            moves.insert(int(self.rng.integers(len(moves) + 1)), noise)
        return moves

    def go(self, way: float, detour: float) -> list[Move]:
        """Nearer by so much of the way (farther if negative)."""
        count = max(1, round(abs(way) / max(self.rng.uniform(0.5, 0.9), abs(way) / 12)))
        ahead = way / detour / count
        aside = 0.0 if abs(ahead) > 0.4 else self.rng.uniform(0.4, 0.5)
        return [self.walk(ahead, aside, -way / count) for _ in range(count)]

    def stuck(self, hit: bool) -> list[Move]:
        """8 to 15 walking calls of less than 10 cm each; a miss has one other step in it, so that at most 7 are in a
        row."""
        count = int(self.rng.integers(8, 16))
        angles = self.rng.uniform(0, 2 * np.pi, count) if self.measured else np.full(count, np.pi / 2)
        lengths = self.rng.uniform(0.01, 0.0999, count)
        moves = [self.walk(r * np.cos(a), r * np.sin(a)) for r, a in zip(lengths, angles, strict=True)]
        place, over = _between(self.rng, count, 7), self.rng.uniform(0.1001, 0.2)
        angle = angles[place]
        others = [self.walk(over * np.cos(angle), over * np.sin(angle)), self.turn(), self.pause()]
        other = others[self.rng.integers(3)]
        return moves if hit else [*moves[:place], other, *moves[place + 1 :]]

    def pacing(self, hit: bool) -> list[Move]:
        """25 and more moving or turning calls to and fro within 2 m; a miss is too wide, or pauses after at most 24."""
        along, too_wide, width = (
            self.measured and self.rng.random() < 0.5,
            self.rng.random() < 0.5,
            self.rng.uniform(0.5, 1.999),
        )
        other_width, count = self.rng.uniform(2.001, 2.3), self.rng.integers(25, 41)
        parts, moves, sign = int(self.rng.integers(1, 4)), list[Move](), 1
        stride = (width if hit or not too_wide else other_width) / parts
        while len(moves) < count:
            moves += [self.walk(*((sign * stride, 0.0) if along else (0.0, sign * stride))) for _ in range(parts)]
            moves += [self.turn()] if self.rng.random() < 0.5 else []
            sign = -sign
        place, other, ends = _between(self.rng, len(moves), 24), self.pause(), (self.pause(), self.pause())
        if not (hit or too_wide):
            moves[place] = other
        return [ends[0], *moves, ends[1]]

    def journey(self, ways: Sequence[float], pieces: list[list[Move]]) -> list[list[Move]]:
        """From the first way left to the second and on to the third, with these pieces at random points in between."""
        detour = self.rng.uniform(1.0, 1.5) if self.measured else 1.0
        legs = [self.go(a - b, detour) for a, b in pairwise(ways) if a != b]
        for piece in pieces:
            legs.insert(int(self.rng.integers(len(legs) + 1)), piece)
        return [part for leg in legs for part in (leg, self.roam())][: None if self.rng.random() < 0.5 else -1]


def _pick(rng: np.random.Generator, items: Sequence[T]) -> T:
    return items[int(rng.integers(len(items)))]


def _between(rng: np.random.Generator, count: int, longest: int) -> int:
    """Return an index with at most so many elements on either side."""
    return int(rng.integers(max(0, count - 1 - longest), min(longest, count - 1) + 1))


# -- writing a rollout down --------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Built:
    """A rollout and its expected label, "" for a success."""

    label: str
    steps: list[StepRecord]
    episode: dict[str, Any]

    def write(self, folder: Path, name: str = "one") -> RecordedEpisode:
        return rollout(folder, self.steps, name=name, **self.episode)


@dataclass
class Tale:
    """A rollout in the making: its moves, and for each of them what was in view, what the agent said and where the hips
    were."""

    rng: np.random.Generator
    moves: list[Move]
    stops: bool
    interact: bool
    max_steps: int
    start: float
    """Way left at the start."""
    measured: bool

    def __post_init__(self) -> None:
        count = len(self.moves)
        if self.stops:
            self.moves[-1] = Move("stop")
        self.category = _pick(self.rng, list(NAMES))
        self.targets = list(range(20, 20 + int(self.rng.integers(1, 4))))
        self.pixels = [self.dim() for _ in range(count)]
        self.says = [bool(x) for x in self.rng.random(count) < 0.3]
        self.away = list(self.rng.uniform(0.2001, 5.0, count))
        self.hips: list[tuple[int, ...]] = [()] * count
        self.brushed: list[tuple[int, ...]] = [()] * count
        """What the hips touch on the way through a step, not at its end."""

    def dim(self) -> int:
        return _pick(self.rng, [0, self.rng.integers(100), 99])

    def bright(self) -> int:
        return _pick(self.rng, [100, 101, self.rng.integers(100, 20_000)])

    def executed(self) -> list[int]:
        return [k for k, move in enumerate(self.moves) if move.skill not in ("", "stop")]

    def built(self, label: str) -> Built:
        rng, *each = self.rng.spawn(1 + len(self.moves))
        swap, sign = rng.random() < 0.5, rng.choice([-1, 1])
        level, offset = rng.uniform(0.8, 1.0), rng.uniform(-20, 20)

        def world(ahead: float, aside: float, height: float = level) -> tuple[float, float, float]:
            first, second = (aside, sign * ahead) if swap else (sign * ahead, aside)
            return float(first), float(height), float(second)

        # The first target is so wide that the straight line to it is the way straight ahead.
        corners = [(world(3.0 * k, -900, 0.0), world(3.0 * k + 1, 900, 0.8)) for k in range(len(self.targets))]
        boxes = {key: tuple(zip(*map(sorted, zip(*pair)))) for key, pair in zip(self.targets, corners)}  # noqa: B905
        ahead, aside, way, steps = -self.start, offset, self.start, []
        x, _, z = world(ahead, aside)
        for k, move in enumerate(self.moves):
            begin = world(ahead, aside)
            ahead, aside, way = ahead + move.ahead, aside + move.aside, way + move.way
            end = world(ahead, aside)
            steps.append(self._step(each[k], k, start=begin, end=end, geodesic=way if self.measured else None))
        return Built(label, steps, {
            "category": self.category, "targets": boxes, "interact": self.interact, "max_steps": self.max_steps,
            "start": Pose2D(x=x, z=z, yaw=0), "geodesic": self.start if self.measured else None,
        })  # fmt: skip

    def _step(self, rng: np.random.Generator, k: int, **where: Any) -> StepRecord:
        """rng: of this step alone, so that one fact that differs leaves the other steps as they are."""
        parts = rng.multinomial(self.pixels[k], np.full(len(self.targets), 1 / len(self.targets)))
        knees = (touch(_pick(rng, [TABLE, LAMP]), 3),) if rng.random() < 0.2 else ()
        hips = tuple(touch(obj, 1, 2, joint="pelvis", group="torso") for obj in (*self.brushed[k], *self.hips[k]))
        return step(
            self.moves[k].skill, away=float(self.away[k]), params=self.moves[k].params, motion_frames=0,
            target_pixels=dict(zip(self.targets, map(int, parts), strict=True)), contacts=(*knees, *hips),
            pelvis_contacts=self.hips[k], attempts=self._attempts(rng, k), **where,
        )  # fmt: skip

    def _attempts(self, rng: np.random.Generator, k: int) -> tuple[Attempt, ...]:
        """Sometimes an answer that was handed back comes first; what it says does not count."""
        text = _pick(rng, (CLAIMS if self.says[k] else SILENCE)[self.category])
        other = _pick(rng, (SILENCE if self.says[k] else CLAIMS)[self.category])
        first = (Attempt(Decision(visible_state=other), "no such skill"),) if rng.random() < 0.15 else ()
        return (*first, Attempt(Decision(visible_state=text), "" if self.moves[k].skill else "no call"))


# -- failures to find --------------------------------------------------------------------------------------------------
def find(rng: np.random.Generator, rule: int, miss: bool) -> Built:
    """No rule before this one applies; those after it may. The last rule's near miss has any one of the other facts."""
    other, drawn = int(rng.integers(UNSEEN)), rng.random(7) < 0.5
    facts = [*[False] * rule, not miss, *map(bool, drawn[rule + 1 :])]
    key = rule
    if rule == UNSEEN:
        facts, key = [*[miss and k == other for k in range(UNSEEN)], True], other
    facts[UNSEEN] = True
    ways = _ways(rng, key, facts)
    mover = Mover(rng, measured=bool(rng.random() < 0.6))
    pieces = [
        piece(facts[k]) for k, piece in ((JAMMED, mover.stuck), (CONFINED, mover.pacing))
        if k == key or facts[k] or rng.random() < 0.2
    ]  # fmt: skip
    moves = [move for part in mover.journey(ways, pieces) for move in part] + [mover.turn()]
    tale = Tale(rng, moves, bool(rng.random() < 0.5), bool(rng.random() < 0.5), len(moves), ways[0], mover.measured)
    if tale.stops:
        tale.max_steps += int(rng.integers(100))
    left = ways[0] + np.cumsum([move.way for move in moves])
    tale.away = list(np.maximum(0.21, left * rng.uniform(0.7, 1.0, len(moves))))
    _never_found(tale, in_view=facts[SEEN], watched=key == SEEN or facts[SEEN])
    return tale.built(f"find: {FIND[facts.index(True)]}")


def _ways(rng: np.random.Generator, key: int, facts: list[bool]) -> tuple[float, float, float]:
    """Way left at the start, at the turning point and at the end. key: the rule whose threshold is to be close."""
    over, any_start, close = rng.uniform(0.001, 4), rng.uniform(3.4, 20), rng.uniform(0.001, 0.19)
    share, back, ended_near, at_home, later = (
        *rng.uniform(0.01, 1, 2),
        *(rng.random(2) < (0.5, 0.2)),
        rng.uniform(0, 3),
    )
    start = 20 + over if facts[FAR] else 20 - over if key == FAR else any_start
    if key == NEAR and at_home:
        facts[FAR] = facts[GAVE_UP] = False
        start = 1.5 + close * (-1 if facts[NEAR] else 1)
        return start, start, start + later
    halved = facts[GAVE_UP] or ended_near
    closest = 0.5 * start + share * (0.5 * start - 1.501) * (-1 if halved else 1)
    if key == NEAR or facts[NEAR]:
        closest, ended_near = 1.5 + close * (-1 if facts[NEAR] else 1), True
    returned = facts[GAVE_UP] or not ended_near
    return start, closest, (0.6 * start + back * 0.0999 * start * (1 if returned else -1))


def _never_found(tale: Tale, *, in_view: bool, watched: bool) -> None:
    """Views that were never acknowledged. watched: one or more were looked at by an agent that says it sees nothing."""
    rng, count = tale.rng, len(tale.moves)
    places = rng.choice(count, min(count, int(rng.integers(1, 4))), replace=False)
    for k, dark, light in [(k, 99 - int(rng.integers(3)), tale.bright()) for k in places] if watched else []:
        tale.pixels[k] = light if in_view else dark
        tale.says[k] = False
    if watched:
        tale.says = [False] * count
    if not tale.stops:
        tale.hips = [(tale.targets[0],) if x < 0.05 else (TABLE,) if x < 0.1 else () for x in rng.random(count)]


# -- failures to get there ---------------------------------------------------------------------------------------------
def nav(rng: np.random.Generator, rule: int, miss: bool) -> Built:
    """The target was found. No rule before this one applies; those after it may."""
    by_stopping, which, arrived_too, late, jam, claimed = rng.random(6) < 0.5
    arrived, stops = (bool(arrived_too), bool(arrived_too))
    if rule == ARRIVED:
        arrived, stops = (True, miss) if by_stopping else (not miss, False)
    if rule == STOPPED:
        arrived, stops = (False, not miss) if by_stopping else (miss, True)
    late, jam = bool(late and rule < LATE), bool(jam and rule != FREE)
    late, jam = (not miss if rule == LATE else late), (True if rule == LODGED else jam)
    seen_last, claimed = bool(rule in (LODGED, FREE) or (rule < LODGED and which)), bool(claimed)
    if rule in (CLAIMED, LOST):
        claimed = (rule == CLAIMED) != (miss and by_stopping)
        seen_last = miss and not by_stopping
    if rule in (LODGED, FREE) and miss:
        seen_last, jam = (False, jam) if by_stopping else (True, rule == FREE)
    moves, max_steps, mover, start = _nav_moves(rng, rule, jam, stops)
    tale = Tale(rng, moves, stops, bool(rng.random() < 0.5), max_steps, start, mover.measured)
    _arrive(tale, arrived)
    _found(tale, late=late, watched=rule == LATE, seen_last=seen_last, claimed=claimed)
    facts = (arrived and not stops, stops and not arrived, late, seen_last and jam, seen_last, claimed, True)
    return tale.built(f"nav: {NAV[facts.index(True)]}")


def _nav_moves(rng: np.random.Generator, rule: int, jam: bool, stops: bool) -> tuple[list[Move], int, Mover, float]:
    """As many moves as the budget has, which is a multiple of ten: 70 % of it is then a whole number of steps."""
    mover, ways = Mover(rng, measured=bool(rng.random() < 0.6)), rng.uniform(1.0, 9.0, 3)
    pieces = [mover.stuck(jam)] if jam or rule in (LODGED, FREE) or rng.random() < 0.3 else []
    pieces += [mover.pacing(bool(rng.random() < 0.5))] if rng.random() < 0.15 else []
    parts = mover.journey(ways, pieces)
    count = sum(map(len, parts)) + 2
    max_steps = 10 * int(np.ceil(count / 10) + rng.integers(2))
    end = [mover.walk(0.0, rng.uniform(0.5, 0.8))]
    for _ in range(max_steps - count + 1):
        parts.insert(int(rng.integers(len(parts) + 1)), [mover.walk(0.0, rng.uniform(0.5, 0.8))])
    return [move for part in parts for move in part] + end, max_steps, mover, float(ways[0])


def _arrive(tale: Tale, arrived: bool) -> None:
    """Within 0.2 m once or more, or never; one who stops has gone away again."""
    places = [k for k in tale.executed() if k < len(tale.moves) - 1]
    for k in tale.rng.choice(places, int(tale.rng.integers(1, 4))):
        near, far = tale.rng.uniform(0.0, 0.2), tale.rng.uniform(0.2001, 0.22)
        tale.away[k] = near if arrived else far


def _found(tale: Tale, *, late: bool, watched: bool, seen_last: bool, claimed: bool) -> None:
    """First in view at the latest in 70 % of the steps or later, and acknowledged. watched: the early view is just too
    dim."""
    rng, last, limit = tale.rng, len(tale.moves) - 1, 7 * tale.max_steps // 10
    for k in limit + np.flatnonzero(rng.random(last + 1 - limit) < 0.3):
        tale.pixels[k] = tale.bright()
    early, found = (_pick(rng, [limit - 1, rng.integers(limit)]), _pick(rng, [limit, rng.integers(limit, last)]))
    dark, light, soon = 99 - int(rng.integers(3)), tale.bright(), rng.random() < 0.5
    tale.pixels[found], tale.says[found] = tale.bright(), True
    if not late or watched:
        tale.pixels[early] = dark if late else light
    if not (late or watched) and soon:
        tale.says[early] = True
        tale.pixels[found] = tale.dim()
    bright, dark = tale.bright(), 99 - int(rng.integers(3))
    tale.pixels[last], tale.says[last] = (bright if seen_last else dark), claimed


# -- failures to sit ---------------------------------------------------------------------------------------------------
def interact(rng: np.random.Generator, rule: int, miss: bool) -> Built:
    """Found, reached and stopped; what differs is the sits and what the hips touched."""
    mover, ways = Mover(rng, measured=bool(rng.random() < 0.6), sits=False), rng.uniform(0.1, 9.0, 3)
    pieces = [mover.stuck(bool(rng.random() < 0.5))] if rng.random() < 0.3 else []
    moves = [move for part in mover.journey(ways, pieces) for move in part]
    moves += [mover.turn(), mover.turn(), Move("stop")]
    tale = Tale(rng, moves, True, True, len(moves) + int(rng.integers(60)), float(ways[0]), mover.measured)
    tale.away[-1] = float(rng.uniform(0.0, 0.2))
    seen = int(rng.integers(len(moves)))
    tale.pixels[seen], tale.says[seen] = tale.bright(), True
    return tale.built((_stood, _air, _wrong, _never)[rule](tale, miss))


def _sit(tale: Tale, places: Sequence[int]) -> None:
    for k in places:
        tale.moves[k] = Move("sit_in_place", {"h_cm": 45})


def _places(tale: Tale, last: bool) -> list[int]:
    """Some executed steps, in order; last: the last of them may be one."""
    candidates = tale.executed()[: None if last else -1]
    return sorted(int(k) for k in tale.rng.choice(candidates, int(tale.rng.integers(1, 4)), replace=False))


def _brush(tale: Tale, objects: Sequence[int], share: float = 0.1) -> bool:
    """Let the hips touch something now and then, but never at the end of a sit or of the rollout."""
    kept = {k for k, move in enumerate(tale.moves) if "sit" in move.skill} | {tale.executed()[-1], len(tale.moves) - 1}
    places = [k for k in tale.executed() if k not in kept and tale.rng.random() < share]
    for k in places:
        obj = (_pick(tale.rng, objects),)
        tale.hips[k], tale.brushed[k] = ((), obj) if tale.rng.random() < 0.5 else (obj, ())
    return bool(places)


def _end(tale: Tale, *objects: int) -> None:
    """What the hips rest on when the last call before the stop is done, and through the stop."""
    tale.hips[tale.executed()[-1]] = tale.hips[-1] = objects


def _stood(tale: Tale, miss: bool) -> str:
    """A sit on the target, and the hips elsewhere at the end. A miss stays on it, or had sat on something else or on
    nothing."""
    target, places = _pick(tale.rng, tale.targets), _places(tale, last=False)
    stays, rests, other = tale.rng.random() < 0.5, tale.rng.random() < 0.5, tale.rng.random() < 0.5
    _sit(tale, places)
    touched = _brush(tale, [*tale.targets, TABLE, FLOOR])
    _end(tale, *((TABLE,) if rests else ()))
    if miss and not stays:
        tale.hips[places[0]] = (TABLE,) if other else ()
        return f"interact: {INTERACT[WRONG if touched or rests or other else AIR]}"
    tale.hips[places[0]] = (target,)
    if miss:
        _end(tale, target)
        return SUCCESS
    return f"interact: {INTERACT[STOOD]}"


def _air(tale: Tale, miss: bool) -> str:
    """Sits, and the hips touch nothing. A miss brushed something once, or never sat."""
    places, brushes, obj = (_places(tale, last=True), tale.rng.random() < 0.5, _pick(tale.rng, [TABLE, FLOOR, LAMP]))
    place, at_end = _pick(tale.rng, tale.executed()), tale.rng.random() < 0.5
    if not miss or brushes:
        _sit(tale, places)
    if miss and brushes:
        tale.hips[place], tale.brushed[place] = ((obj,), ()) if at_end else ((), (obj,))
    return f"interact: {INTERACT[AIR if not miss else WRONG if brushes else NEVER]}"


def _wrong(tale: Tale, miss: bool) -> str:
    """A sit, and the hips end on something else. A miss ends on nothing, or had sat on the target before."""
    places, nothing = _places(tale, last=True), tale.rng.random() < 0.5
    nothing = nothing or places[0] == tale.executed()[-1]
    obj, target = _pick(tale.rng, [TABLE, FLOOR, LAMP]), _pick(tale.rng, tale.targets)
    _sit(tale, places)
    if miss and nothing:
        return f"interact: {INTERACT[AIR]}"
    _brush(tale, [*tale.targets, TABLE, FLOOR], share=0.0 if nothing else 0.1)
    _end(tale, obj)
    if miss:
        tale.hips[places[0]] = (target,)
    return f"interact: {INTERACT[STOOD if miss else WRONG]}"


def _never(tale: Tale, miss: bool) -> str:
    """No sit, whatever the hips touch. A miss has one, on the target, on something else or on nothing."""
    place, rests = _places(tale, last=False)[0], tale.rng.random() < 0.5
    obj = _pick(tale.rng, [tale.targets[0], TABLE, -1])
    _brush(tale, [*tale.targets, TABLE, FLOOR])
    _end(tale, *((tale.targets[0],) if rests else ()))
    if not miss:
        return f"interact: {INTERACT[NEVER]}"
    _sit(tale, [place])
    tale.brushed[place], tale.hips[place] = (), (obj,) if obj >= 0 else ()
    touched = any(tale.brushed) or any(tale.hips)
    if rests:
        return SUCCESS
    return f"interact: {INTERACT[STOOD if obj == tale.targets[0] else WRONG if touched else AIR]}"


def construct(label: str, case: int, *, miss: bool = False) -> Built:
    """A rollout that must have the label; with miss the same one but for the deciding fact, and what it is then."""
    stage, name = label.split(": ")
    make, names = {"find": (find, FIND), "nav": (nav, NAV), "interact": (interact, INTERACT)}[stage]
    return make(np.random.default_rng([LABELS.index(label), case]), names.index(name), miss)


# -- anything at all ---------------------------------------------------------------------------------------------------
def anything(case: int) -> Built:
    """Return a fully random rollout, whose label is not known beforehand."""
    rng = np.random.default_rng(case)
    mover, ways = Mover(rng, measured=bool(rng.random() < 0.5)), rng.uniform(0.5, 25.0, 3)
    pieces = [piece(bool(rng.random() < 0.5)) for piece in (mover.stuck, mover.pacing) if rng.random() < 0.4]
    moves = [move for part in mover.journey(ways, pieces) for move in part]
    max_steps = 10 * int(np.ceil(len(moves) / 10))
    tale = Tale(
        rng, moves, bool(rng.random() < 0.6), bool(rng.random() < 0.6), max_steps, float(ways[0]), mover.measured
    )
    bright, arrives, touches = rng.choice([0.0, 0.05, 0.5]), rng.choice([0.0, 0.05, 1.0]), rng.choice([0.0, 0.1])
    for k in range(len(moves)):
        tale.pixels[k] = tale.bright() if rng.random() < bright else tale.dim()
        tale.away[k] = rng.uniform(0.0, 0.2) if rng.random() < arrives else tale.away[k]
        obj = (_pick(rng, [*tale.targets, TABLE, FLOOR]),)
        tale.hips[k], tale.brushed[k] = (obj if x < touches else () for x in rng.random(2))
    return tale.built(UNKNOWN)
