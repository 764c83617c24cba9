"""The oracle's hands: it carries things, opens furniture and answers, from the true state of the scene.

A script is a generator of calls. Each call is worked out from the state as it is then.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import count
from typing import Final

import numpy as np

from humanclaw import Call, EpisodeContext
from humanclaw.body import Array, wrap_angle
from humanclaw.skills import Side
from humanclaw.world import MultiFloorMap, SceneObject, Viewpoint, WorldState, viewpoints
from humanclaw_scripted.calls import answering, gripping, reaching
from humanclaw_scripted.handles import GRIPS, HOOKS, Handle, Here, places_around, spot_on
from humanclaw_scripted.oracle import OracleAgent
from humanclaw_scripted.truth import PelvisPose, box

Script = Iterator[tuple[Call, str]]
Stands = Callable[[], list[Viewpoint]]
_SIDES: Final[tuple[Side, Side]] = ("right", "left")
_FARS: Final = (0.55, 0.75)
"""Metres from a place to stand to what an arm reaches from there; the second where there is no place as near."""
_BESIDE: Final = 0.16
"""Metres from the middle of the body to what a hand works on."""
_AT_HAND: Final = (0.4, 0.56)
"""Metres ahead of the hips between which hands work well; nearer, a forearm meets the edge of a table."""
_ABOVE: Final = 0.075
"""Metres from what a thing lies on to the knuckles, at least: fingers and forearm need room."""
_LOST: Final = 0.85
"""Metres away of a thing that has been knocked out of reach."""
_LOOK: Final = (1.2, 1.6)
"""The same of furniture to look into."""
_OVER_IT: Final = (0.36, 0.6)
"""The same of a place to lay something down."""
_CARRIED: Final = (0.1, 1.1, 0.16)
"""Aside, over the floor, and ahead of a thing's own half depth: where a hand carries it, metres."""
_RISE: Final = 0.24
"""Metres that a hand raises a thing by with a call: out of a crouch, more shakes it off."""
_KNEES: Final = 0.5
"""Metres over the floor below which bent knees are behind a thing: it is raised straight."""
_STRETCH: Final = 0.62
"""Metres ahead of them beyond which a hand at the floor takes the head down over what it raises."""
_CHIN: Final = 0.7
"""Metres over the floor to which a crouching body raises a thing: higher, its head meets the thing as it stands up."""
_SHINS: Final = 0.46
"""Metres ahead of the hips that bent knees need: what is raised from nearer meets them."""
_TRIES: Final = ((-0.02, 0.0), (-0.02, 0.05), (-0.02, -0.05), (0.01, 0.0), (-0.04, 0.03))
"""Metres outwards and ahead that a hand is elsewhere in one try after the other."""
_OFF: Final = 0.04
"""Metres farther from a thing of a hand that closes first: its palm does not meet the thing yet."""
_HOVER: Final = 0.14
_EASY: Final = float(np.radians(30))
_SLOW: Final = 0.45
"""Turn and step (metres) in a call that a full hand stands."""
_BEND: Final = 0.25
"""Turn (radians) above which a body with a full hand turns on the spot: what it carries swings wide."""
_BERTH: Final = 0.32
"""How far it keeps from corners, metres."""
_OPEN: Final = 0.1
"""Share of the way by which a door or a drawer is opened farther than it has to be; a lid comes up with a step back."""


class HandyOracle(OracleAgent):
    """The oracle, with hands for episodes that have a goal for them."""

    def begin(self, context: EpisodeContext) -> None:
        super().begin(context)
        # A script holds its agent, and so the house, until the garbage collector comes: not where none is played.
        self._script: Script = self._play() if self._spec.goal is not None else iter(())

    def _act(self, state: WorldState, pose: PelvisPose) -> tuple[Call, str]:
        return super()._act(state, pose) if self._spec.goal is None else next(self._script)

    def _play(self) -> Script:
        goal = self._spec.goal
        assert goal is not None
        if goal.on is not None:
            yield from self._carry(goal.things[0], goal.on)
        else:
            yield from self._open([self._scene.by_id[key] for key in goal.things], goal.share)
        if goal.answer:
            yield from self._look_inside()
            said = f"I have looked inside: the answer is {goal.answer}."
            yield answering(self._context.skills, goal.answer), said
        while True:
            yield Call(self._stop), "The task is complete."

    def _choose(self, pose: PelvisPose) -> bool:
        if super()._choose(pose):
            return True
        # What failed from all places may work from the first one now, and what was in the way may be gone.
        self._memory.given_up, self._memory.floors = set(), MultiFloorMap.of(self._scene, self._state().objects)
        return super()._choose(pose)

    # -- walking -------------------------------------------------------------------------------------------------------
    def _stands(self) -> list[Viewpoint]:
        return super()._stands() if self._spec.goal is None else self._wanted()

    def _walk_to(self, stands: Stands, goes_on: Callable[[], bool] = lambda: True) -> Script:
        """Walk to the place with the shortest way, as long as it makes sense."""
        memory = self._memory
        self._wanted, memory.way, memory.arrived, memory.blocked = stands, [], False, 0
        while goes_on() and not self._stands_there():
            call, why = self._go(self._state(), PelvisPose.of(self._state()))
            yield (self._back(0.25), "I see no way: I step back.") if call.skill == self._stop else (call, why)

    def _stands_there(self) -> bool:
        memory, pose = self._memory, PelvisPose.of(self._state())
        if len(memory.way) != 1 or memory.stand is None or memory.blocked >= 2:
            return False
        return self._arrived(pose, memory.stand, 0.12)

    def _at_stand(self, pose: PelvisPose) -> tuple[Call, str]:
        return super()._at_stand(pose) if self._spec.goal is None else self._follow(pose, self._last)

    def _give_up_stand(self, around: float = 0.01) -> None:
        """Go to no place so near to the last one again (metres), until all others have failed too."""
        last = self._memory.stand
        if last is not None:
            near = (s for s in self._wanted() if np.hypot(s.x - last.x, s.z - last.z) <= around)
            self._memory.given_up |= {(last.x, last.z), *((s.x, s.z) for s in near)}

    def _face(self, point: Callable[[], Array], aside: Callable[[], float], near: Sequence[float] = _AT_HAND) -> Script:
        """Turn and step until a point (3,) is at hand. aside: where it is to be to the left, metres."""
        low, high = near
        for _ in range(8):
            here = Here.of(self._state())
            left, _, ahead = here.local(point())
            far = max(float(np.hypot(left, ahead)), abs(aside()) + 0.01)
            error = float(np.arctan2(left, ahead)) - float(np.arcsin(np.clip(aside() / far, -1, 1)))
            if abs(error) > np.radians(10):
                yield self._turn(error), "I turn to what I want to take hold of."
            elif ahead > high and self._memory.blocked < 1:
                yield self._walk(0.0, min(0.25, max(0.1, ahead - high + 0.04)), 0.0), "I step closer."
            elif ahead < low:
                yield self._back(min(0.25, low - ahead + 0.06)), "I make room for my arm."
            else:
                return

    def _turn(self, angle: float) -> Call:
        return super()._turn(float(np.clip(angle, -_EASY, _EASY)) if self._state().held else angle)

    @property
    def _room(self) -> float:  # type: ignore[override]
        return _BERTH if self._state().held else super()._room

    def _walk(self, left: float, forward: float, turn: float) -> Call:
        if self._state().held and abs(turn) > _BEND:
            return self._turn(turn)
        share = min(1.0, _SLOW / max(forward, 1e-9)) if self._state().held else 1.0
        return super()._walk(share * left, share * forward, share * turn)

    # -- hands ---------------------------------------------------------------------------------------------------------
    def _to(self, side: Side, place: Array, why: str) -> tuple[Call, str]:
        """Return a call that brings a hand to a place (3,) in the body's frame."""
        return reaching(self._context.skills, side, place.tolist()), why

    def _close(self, side: Side) -> tuple[Call, str]:
        return gripping(self._context.skills, "grasp", side), "It is before my palm: I close my hand."

    def _let_go(self, side: Side) -> tuple[Call, str]:
        return gripping(self._context.skills, "release", side), "I let go."

    def _in_hand(self, key: int) -> bool:
        return key in self._state().held.values()

    # -- carrying ------------------------------------------------------------------------------------------------------
    def _carry(self, thing: int, place: int) -> Script:
        for attempt in count():
            side = _SIDES[attempt // 2 % 2]
            yield from self._walk_to(lambda: self._near(thing))
            yield from self._take(thing, side)
            if not self._in_hand(thing):
                self._give_up_stand(0.3)
                continue
            yield from self._lift(thing, side)
            self._memory.given_up = set()
            yield from self._walk_to(lambda: self._near(place), lambda: self._in_hand(thing))
            if self._in_hand(thing):
                yield from self._put(thing, place, side)
            if self._lies(thing, place):
                return
            self._memory.given_up = set()

    def _near(self, key: int) -> list[Viewpoint]:
        """Return places to stand at an object, where it is now."""
        low, high = box(self._scene, self._state(), key)
        if np.allclose(low, self._scene.aabb(key)[0], atol=0.05):
            found = viewpoints(self._memory.floors, self._scene, key)
            return [one for one in found if one.gap < _FARS[0]]
        grids = [grid for grid in self._memory.floors.floors if -0.1 < low[1] - grid.floor < 2.0]
        ways = (
            [one for grid in grids for one in places_around(self._scene, grid, key, low, high, far)] for far in _FARS
        )
        return next(filter(None, ways), [])

    def _extent(self, key: int) -> tuple[Here, Array, Array]:
        """Return the body's frame, and the corners (3,) of an object's box in it."""
        here = Here.of(self._state())
        points = here.local(self._scene.vertices(key, here.state.objects.get(key)))
        return here, points.min(0), points.max(0)

    def _middle(self, key: int) -> Array:
        low, high = box(self._scene, self._state(), key)
        return np.asarray((low + high) / 2)

    def _take(self, thing: int, side: Side) -> Script:
        """Close a hand on a thing."""
        out = 1.0 if side == "left" else -1.0
        _, low, high = self._extent(thing)
        wide, deep = (high - low)[[0, 2]].tolist()
        past_knees = min(_SHINS + deep / 2, _STRETCH)
        near = _AT_HAND if high[1] > _KNEES else (past_knees, past_knees + 0.08)
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
        below = Here.of(self._state()).hand(side)[1] < high[1]
        for _ in range(2 if below else 1):
            yield self._to(side, over, "I bring my hand over it.")
        for gap in (_OFF, 0.0):
            spot = at + [gap * out, 0.0, 0.0]
            yield self._to(side, spot, "I bring my palm to it.")
            if float(np.linalg.norm(Here.of(self._state()).hand(side) - spot)) > 0.04:
                yield self._to(side, spot, "I bring my palm to it.")
            yield self._close(side)
            if self._in_hand(thing):
                return

    def _lift(self, thing: int, side: Side) -> Script:
        """Raise what a hand holds, step back from what it lay on, and hold it before the body."""
        out = 1.0 if side == "left" else -1.0
        _, low, high = self._extent(thing)
        yield from self._raise(thing, side)
        yield self._back(0.25), "I step back with it."
        pose = PelvisPose.of(self._state())
        if self._plan(pose).at(self._plan(pose).clearance, pose.point) < 0.5:
            yield self._back(0.25), "I step back with it, to have room to turn."
        deep = float(high[2] - low[2]) / 2
        yield self._to(side, np.array([_CARRIED[0] * out, _CARRIED[1], _CARRIED[2] + deep]), "I hold it before me.")

    def _raise(self, thing: int, side: Side) -> Script:
        for _ in range(5):
            here = Here.of(self._state())
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
        here = Here.of(self._state())
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

    # -- opening -------------------------------------------------------------------------------------------------------
    def _open(self, leaves: Sequence[SceneObject], share: float) -> Script:
        floor = max(grid.floor for grid in self._memory.floors.floors if grid.floor < leaves[0].position[1] + 0.1)
        handles = [Handle.of(self._scene.hulls, leaf, floor) for leaf in leaves]
        while True:
            before = {(s.x, s.z): (handle, side) for handle in handles for s, side in self._before(handle)}
            yield from self._walk_to(lambda: [s for handle in handles for s, _ in self._before(handle)])
            assert self._memory.stand is not None
            stand = self._memory.stand
            handle, side = before[stand.x, stand.z]
            yield from self._pull(handle, side, share)
            if handle.share(self._state()) > share:
                return
            self._give_up_stand()
            yield self._back(0.3), "I try from another place."

    def _look_inside(self) -> Script:
        """Turn to the furniture behind what is open, and step back until it is in view."""
        (body,) = set(self._spec.target_ids) - set(self._spec.goal.things if self._spec.goal else ())
        yield from self._face(lambda: self._middle(body), lambda: 0.0, _LOOK)

    def _before(self, handle: Handle) -> list[tuple[Viewpoint, Side]]:
        """Return places from which a hand reaches a handle, with the hand; the best first."""
        found, ahead = [], handle.out
        yaw = float(np.arctan2(-ahead[0], -ahead[2]))
        left = np.array([np.cos(yaw), 0.0, -np.sin(yaw)])
        for far in (0.62, 0.72, 0.54):
            for side, out in (("left", 1.0), ("right", -1.0)):
                for more in (0.0, 0.1, -0.1):
                    place = handle.at(handle.obj.state) + far * ahead - left * out * (0.2 + more)
                    x, z = float(place[0]), float(place[2])
                    for grid in self._memory.floors.floors:
                        level = -0.1 < handle.at(handle.obj.state)[1] - grid.floor < 2.2
                        if level and grid.at(grid.clearance, np.array([x, z])) >= 0.2:
                            clash = handle.inside(place)
                            gap = abs(far - 0.62) + abs(more) + clash
                            found.append((Viewpoint(handle.obj.id, x, z, yaw, gap, floor=grid.floor), side))
        return found  # type: ignore[return-value]

    def _pull(self, handle: Handle, side: Side, share: float) -> Script:
        """Take a handle, and pull it until the thing is open."""
        out = 1.0 if side == "left" else -1.0
        key, wide = handle.obj.id, handle.wide
        for _ in range(3):
            yield from self._square(handle, out)
            yield from self._hold(handle, side)
            for _ in range(14):
                if not self._in_hand(key) or handle.share(self._state()) > share + _OPEN * (not handle.tilts):
                    break
                yield self._drawn(handle, side, wide)
            if self._in_hand(key):
                yield self._let_go(side)
            if not 0.05 < handle.share(self._state()) <= share:
                break
        here = Here.of(self._state())
        yield self._to(side, here.hand(side) + [0.1 * out, 0.05, -0.1], "I take my hand away.")

    def _square(self, handle: Handle, out: float) -> Script:
        """Stand square to a front, its handle at hand."""
        yaw = float(np.arctan2(-handle.out[0], -handle.out[2]))
        for _ in range(8):
            here = Here.of(self._state())
            left, _, ahead = here.local(handle.now(here.state))
            error = float(wrap_angle(yaw - here.frame.yaw))
            if abs(error) > np.radians(8):
                yield self._turn(error), "I square up to it."
            elif ahead > 0.7 and self._memory.blocked < 1:
                yield self._walk(0.0, min(0.25, max(0.1, ahead - 0.64)), 0.0), "I step closer."
            elif ahead < 0.45 + 0.13 * handle.tilts:
                yield self._back(max(0.1, 0.55 + 0.1 * handle.tilts - ahead)), "I make room for my arm."
            elif abs(left - 0.2 * out) > 0.14:
                yield self._side(float(left - 0.2 * out)), "I step in front of its handle."
            else:
                return

    def _hold(self, handle: Handle, side: Side) -> Script:
        for grip in HOOKS if handle.tilts and handle.share(self._state()) > 0.1 else GRIPS:
            for up, ahead in grip:
                here = Here.of(self._state())
                at = here.local(handle.now(here.state)) + [0.0, up, ahead]
                yield self._to(side, at, "I bring my hand to it.")
            yield self._close(side)
            if self._in_hand(handle.obj.id):
                return

    def _drawn(self, handle: Handle, side: Side, wide: float) -> tuple[Call, str]:
        """Return a call that takes a handle farther on its way."""
        here, now = Here.of(self._state()), handle.state(self._state())
        there = now + float(np.clip(wide - now, -handle.step, handle.step))
        due = here.hand(side) + here.local(handle.at(there)) - here.local(handle.at(now))
        if due[2] < handle.near:
            return self._back(0.12 if handle.tilts else 0.2), "I step back with it."
        return self._to(side, due, "I pull.")
