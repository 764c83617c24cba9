"""What the oracle's hands need whatever they do: the body walks to places, faces things, and moves and closes a hand.

A script is a generator of calls. Each call is worked out from the state as it is then.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from typing import Final

import numpy as np

from humanclaw import Call, EpisodeContext
from humanclaw.body import Array
from humanclaw.skills import Side
from humanclaw.world import MultiFloorMap, Viewpoint, WorldState
from humanclaw_scripted.actions import HAND, asking
from humanclaw_scripted.ground_truth import BodyView, box
from humanclaw_scripted.oracle import OracleAgent

Script = Iterator[tuple[Call, str]]
Stands = Callable[[], list[Viewpoint]]
AT_HAND: Final = (0.4, 0.56)
"""Metres ahead of the hips between which hands work well; nearer, a forearm meets the edge of a table."""
_EASY: Final = float(np.radians(30))
"""Turn of a call with something in the hand, radians: a wider one swings it against what stands beside."""
_SLOW: Final = 0.45
"""Turn and step (metres) in a call that a full hand stands."""
_BEND: Final = 0.25
"""Turn (radians) above which a body with a full hand turns on the spot: what it carries swings wide."""
_BERTH: Final = 0.32
"""How far it keeps from corners, metres."""


class ArmedOracle(OracleAgent):
    """The oracle, with hands for episodes that have a goal for them."""

    def begin(self, context: EpisodeContext) -> None:
        super().begin(context)
        # A script holds its agent, and so the house, until the garbage collector comes: not where none is played.
        self._script: Script = self._play() if self._spec.goal is not None else iter(())

    def _act(self, state: WorldState, pose: BodyView) -> tuple[Call, str]:
        return super()._act(state, pose) if self._spec.goal is None else next(self._script)

    def _choose(self, pose: BodyView) -> bool:
        if super()._choose(pose):
            return True
        # What failed from all places may work from the first one now, and what was in the way may be gone.
        places = self._state().objects
        self._memory.given_up, self._memory.floors = set(), MultiFloorMap.of(self._scene, places, keep=False)
        return super()._choose(pose)

    @abstractmethod
    def _play(self) -> Script:
        """Yield the calls of a task of hands, without end."""

    # -- walking -------------------------------------------------------------------------------------------------------
    def _stands(self) -> list[Viewpoint]:
        return super()._stands() if self._spec.goal is None else self._wanted()

    def _walk_to(self, stands: Stands, goes_on: Callable[[], bool] = lambda: True) -> Script:
        """Walk to the place with the shortest way, as long as it makes sense."""
        memory = self._memory
        self._wanted, memory.way, memory.arrived, memory.blocked = stands, [], False, 0
        while goes_on() and not self._stands_there():
            call, why = self._go(self._state(), BodyView(self._state()))
            yield (self._back(0.25), "I see no way: I step back.") if call.skill == self._stop else (call, why)

    def _stands_there(self) -> bool:
        memory, pose = self._memory, BodyView(self._state())
        if len(memory.way) != 1 or memory.stand is None or memory.blocked >= 2:
            return False
        return self._arrived(pose, memory.stand, 0.12)

    def _at_stand(self, pose: BodyView) -> tuple[Call, str]:
        return super()._at_stand(pose) if self._spec.goal is None else self._follow(pose, self._last)

    def _give_up_stand(self, around: float = 0.01) -> None:
        """Go to no place so near to the last one again (metres), until all others have failed too."""
        last = self._memory.stand
        if last is not None:
            near = (s for s in self._wanted() if np.hypot(s.x - last.x, s.z - last.z) <= around)
            self._memory.given_up |= {(last.x, last.z), *((s.x, s.z) for s in near)}

    def _face(self, point: Callable[[], Array], aside: Callable[[], float], near: Sequence[float] = AT_HAND) -> Script:
        """Turn and step until a point (3,) is at hand. aside: where it is to be to the left, metres."""
        low, high = near
        for _ in range(8):
            here = BodyView(self._state())
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
    def _room(self) -> float:
        return _BERTH if self._state().held else super()._room

    def _walk(self, left: float, forward: float, turn: float) -> Call:
        if self._state().held and abs(turn) > _BEND:
            return self._turn(turn)
        share = min(1.0, _SLOW / max(forward, 1e-9)) if self._state().held else 1.0
        return super()._walk(share * left, share * forward, share * turn)

    # -- hands ---------------------------------------------------------------------------------------------------------
    def _to(self, side: Side, place: Array, why: str) -> tuple[Call, str]:
        """Return a call that brings a hand to a place (3,) in the body's frame."""
        return asking(self._context.skills, HAND, place.tolist(), "gesture", side), why

    def _close(self, side: Side) -> tuple[Call, str]:
        return asking(self._context.skills, (), (), "grasp", side), "It is before my palm: I close my hand."

    def _let_go(self, side: Side) -> tuple[Call, str]:
        return asking(self._context.skills, (), (), "release", side), "I let go."

    def _in_hand(self, key: int) -> bool:
        return key in self._state().held.values()

    def _extent(self, key: int) -> tuple[BodyView, Array, Array]:
        """Return the body's frame, and the corners (3,) of an object's box in it."""
        here = BodyView(self._state())
        points = here.local(self._scene.vertices(key, here.state.objects.get(key)))
        return here, points.min(0), points.max(0)

    def _middle(self, key: int) -> Array:
        low, high = box(self._scene, self._state(), key)
        return np.asarray((low + high) / 2)
