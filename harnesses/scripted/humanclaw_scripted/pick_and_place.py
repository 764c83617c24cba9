"""The oracle carries things: it takes one, walks with it, and lays it down."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import count
from typing import Final

import numpy as np

from humanclaw import Call
from humanclaw.body import STANDING_HEIGHT, Array
from humanclaw.skills import Side
from humanclaw.world import Viewpoint, viewpoints
from humanclaw_scripted.actions import SIT, asking
from humanclaw_scripted.arms import AT_HAND, ArmedOracle, Script, Stands
from humanclaw_scripted.ground_truth import BodyView, box
from humanclaw_scripted.handles import free_sides, places_around, spot_on

_SIDES: Final[tuple[Side, Side]] = ("right", "left")
_CRAMPED: Final = 0.5
"""Price of a place without room for a hand, metres."""
_FARS: Final = (0.55, 0.75)
"""Metres from a place to stand to what an arm reaches from there; the second where there is no place as near."""
_BESIDE: Final = 0.16
"""Metres from the middle of the body to what a hand works on."""
_ABOVE: Final = 0.075
"""Metres from what a thing lies on to the knuckles, at least: fingers and forearm need room."""
_LOST: Final = 0.85
"""Metres away of a thing that has been knocked out of reach."""
_OVER_IT: Final = (0.36, 0.6)
"""Metres ahead of the hips between which a hand lays something down."""
_CARRIED: Final = (0.1, 1.1, 0.16)
"""Aside, over the floor, and ahead of a thing's own half depth: where a hand carries it, metres."""
_RISE: Final = 0.24
"""Metres that a hand raises a thing by with a call: out of a crouch, more shakes it off."""
_KNEES: Final = 0.5
"""Metres over the floor below which bent knees are behind a thing: it is raised straight."""
_STRETCH: Final = 0.62
"""Metres ahead of the hips beyond which a hand at the floor takes the head down over what it raises."""
_CHIN: Final = 0.7
"""Metres over the floor to which a crouching body raises a thing: higher, its head meets the thing as it stands up."""
_SHINS: Final = 0.46
"""Metres ahead of the hips that bent knees need: what is raised from nearer meets them."""
_ELBOWS: Final = 1.0
"""Metres over the floor of a shelf that a hand comes to from above: it is raised before it, so from farther back."""
_RAISED: Final = (0.54, 0.63)
"""Metres ahead of the hips of what lies there."""
_TRIES: Final = ((-0.02, 0.0), (-0.02, 0.05), (-0.02, -0.05), (0.01, 0.0), (-0.04, 0.03))
"""Metres outwards and ahead that a hand is elsewhere in one try after the other."""
_OFF: Final = 0.04
"""Metres farther from a thing of a hand that closes first: its palm does not meet the thing yet."""
_HOVER: Final = 0.14
"""Metres of a hand above where it takes a thing, and of a thing above where it lays it down."""


class PickAndPlaceOracle(ArmedOracle):
    """Carries a thing to a piece of furniture, or elsewhere."""

    def _carry(self, thing: int, place: int) -> Script:
        return self._bring(
            thing, self._scene.by_id[place].category.replace("_", " "), lambda: self._near(place),
            lambda side: self._put(thing, place, side), lambda: self._lies(thing, place),
        )  # fmt: skip

    def _bring(
        self, thing: int, there: str, stands: Stands, hand_over: Callable[[Side], Script], done: Callable[[], bool]
    ) -> Script:
        """Take a thing, and walk with it to a place to stand, until what is done there has worked."""
        for attempt in count():
            self._bound_for = self._noun
            yield from self._walk_to(lambda: self._around(thing))
            side = self._hand_for(thing, attempt)
            yield from self._take(thing, side)
            if not self._in_hand(thing):
                self._give_up_stand(0.3)
                continue
            yield from self._lift(thing, side)
            self._memory.given_up = set()
            self._bound_for = there
            yield from self._walk_to(stands, lambda: self._in_hand(thing))
            if self._in_hand(thing):
                yield from hand_over(side)
            if done():
                return
            self._memory.given_up = set()

    def _hand_for(self, thing: int, attempt: int) -> Side:
        """Return the hand that has room beside a thing; of two, one in every other pair of attempts."""
        (free,) = free_sides(self._scene, self._state(), thing, BodyView(self._state()).point[None])
        sides = [side for side, is_free in zip(_SIDES, free, strict=True) if is_free] or _SIDES
        return sides[attempt // 2 % len(sides)]

    def _around(self, thing: int) -> list[Viewpoint]:
        """Return places to stand at a thing; those from which no hand has room are expensive."""
        stands = self._near(thing)
        places = np.array([(stand.x, stand.z) for stand in stands]).reshape(-1, 2)
        free = free_sides(self._scene, self._state(), thing, places)
        return [
            stand if room.any() else replace(stand, gap=stand.gap + _CRAMPED)
            for stand, room in zip(stands, free, strict=True)
        ]

    def _near(self, key: int) -> list[Viewpoint]:
        """Return places to stand at an object, where it is now."""
        low, high = box(self._scene, self._state(), key)
        if np.allclose(low, self._scene.aabb(key)[0], atol=0.05):
            stands = viewpoints(self._memory.floors, self._scene, key)
            return [stand for stand in stands if stand.gap < _FARS[0]]
        middle = (low + high) / 2
        grid = self._memory.floors.grids[int(self._memory.floors.level(np.array([middle[0], low[1], middle[2]])))]
        ways = ([*places_around(self._scene, grid, key, low, high, far)] for far in _FARS)
        return next(filter(None, ways), [])

    def _take(self, thing: int, side: Side) -> Script:
        """Close a hand on a thing."""
        out = 1.0 if side == "left" else -1.0
        _, low, high = self._extent(thing)
        wide, deep = (high - low)[[0, 2]].tolist()
        past_knees = min(_SHINS + deep / 2, _STRETCH)
        near = AT_HAND if high[1] > _KNEES else (past_knees, past_knees + 0.08)
        near = _RAISED if low[1] > _ELBOWS else near
        yield from self._face(lambda: self._middle(thing), lambda: out * max(0.05, _BESIDE - wide / 4), near)
        for outwards, ahead in _TRIES:
            _, low, high = self._extent(thing)
            if np.hypot(low[0] + high[0], low[2] + high[2]) / 2 > _LOST:
                return
            yield from self._close_on(thing, low, high, side, outwards, ahead)
            if self._in_hand(thing):
                return

    def _close_on(self, thing: int, low: Array, high: Array, side: Side, outwards: float, ahead: float) -> Script:
        """Bring a palm over a box, corners (3,) in the body's frame, down beside it, and close; nearer if it misses.

        A palm that meets a thing before it closes knocks it over.
        """
        out = 1.0 if side == "left" else -1.0
        beside = (high[0] if out > 0 else low[0]) + out * (0.03 + outwards)
        height = max(low[1] + _ABOVE, min((low[1] + high[1]) / 2, low[1] + 0.25), 0.1)
        at = np.array([beside, height, (low[2] + high[2]) / 2 - 0.04 + ahead])
        over = at + [0.06 * out, max(_HOVER, high[1] + 0.1 - height), -0.08]
        if BodyView(self._state()).hand(side)[1] < high[1]:
            # From below, a hand meets the edge of what the thing lies on.
            yield self._to(side, np.array([0.3 * out, over[1], 0.15]), "I raise my hand.")
        yield self._to(side, over, "I bring my hand over it.")
        for gap in (_OFF, 0.0):
            spot = at + [gap * out, 0.0, 0.0]
            yield self._to(side, spot, "I bring my palm to it.")
            if float(np.linalg.norm(BodyView(self._state()).hand(side) - spot)) > 0.04:
                yield self._to(side, spot, "I bring my palm to it.")
            yield self._close(side)
            if self._in_hand(thing):
                return

    def _lift(self, thing: int, side: Side) -> Script:
        """Raise what a hand holds, step back from what it lay on, and hold it before the body."""
        out = 1.0 if side == "left" else -1.0
        _, low, high = self._extent(thing)
        yield from self._raise(thing, side)
        if BodyView(self._state()).crouches:
            yield asking(self._context.skills, SIT, (STANDING_HEIGHT,), "posture"), "I rise with it."
        yield self._back(0.25), "I step back with it."
        pose = BodyView(self._state())
        if self._plan(pose).at(self._plan(pose).clearance, pose.point) < 0.5:
            yield self._back(0.25), "I step back with it, to have room to turn."
        deep = float(high[2] - low[2]) / 2
        yield self._to(side, np.array([_CARRIED[0] * out, _CARRIED[1], _CARRIED[2] + deep]), "I hold it before me.")

    def _raise(self, thing: int, side: Side) -> Script:
        for _ in range(5):
            here = BodyView(self._state())
            hand, top = here.hand(side), _CHIN if here.crouches else _CARRIED[1]
            if not self._in_hand(thing) or hand[1] > top - 0.1:
                break
            back = 0.05 if hand[1] > _KNEES else 0.0
            yield self._to(side, hand + [0.0, min(_RISE, top - hand[1]), -back], "I lift it.")

    def _put(self, thing: int, place: int, side: Side) -> Script:
        """Lay what a hand holds on a piece of furniture."""
        spot = spot_on(self._scene, self._state(), thing, place)

        def aside() -> float:
            _, low, high = self._extent(thing)
            return float(low[0] + high[0]) / 2

        yield from self._face(lambda: spot, aside, _OVER_IT)
        for above in (_HOVER, _HOVER, 0.03, 0.01):
            if self._in_hand(thing):
                yield self._over(thing, spot, side, above)
        for _ in range(2):
            low, _ = box(self._scene, self._state(), thing)
            if self._in_hand(thing) and (low[1] - spot[1] > 0.04 or not self._above(thing, place)):
                yield self._over(thing, spot, side, 0.005)
        yield self._let_go(side)
        here = BodyView(self._state())
        out = 1.0 if side == "left" else -1.0
        yield self._to(side, here.hand(side) + [0.08 * out, 0.05, -0.05], "I take my hand away.")
        yield self._to(side, here.hand(side) + [0.08 * out, 0.25, -0.15], "I take my hand away.")

    def _over(self, thing: int, spot: Array, side: Side, above: float) -> tuple[Call, str]:
        """Return a call that brings what a hand holds so far above a spot (3,)."""
        here, low, high = self._extent(thing)
        held = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
        due = here.local(spot) + [0.0, above, 0.0]
        return self._to(side, here.hand(side) + due - held, "I bring it to its place.")

    def _above(self, thing: int, place: int) -> bool:
        middle, (low, high) = self._middle(thing), box(self._scene, self._state(), place)
        return bool(((low < middle) & (middle < high))[[0, 2]].all())

    def _lies(self, thing: int, place: int) -> bool:
        low, top = box(self._scene, self._state(), thing)[0], box(self._scene, self._state(), place)[1]
        return self._above(thing, place) and abs(float(low[1] - top[1])) < 0.05
