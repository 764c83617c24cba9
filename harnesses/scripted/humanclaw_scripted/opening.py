"""The oracle opens doors, drawers and lids, looks inside, and plays every task of hands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from humanclaw import Call
from humanclaw.body import wrap_angle
from humanclaw.skills import Side
from humanclaw.world import SceneObject, Viewpoint
from humanclaw_scripted.actions import answering
from humanclaw_scripted.arms import Script
from humanclaw_scripted.ground_truth import BodyView
from humanclaw_scripted.handles import GRIPS, HOOKS, Handle
from humanclaw_scripted.pick_and_place import PickAndPlaceOracle

_LOOK: Final = (1.2, 1.6)
"""Metres from the hips to the middle of furniture to look into."""
_OPEN: Final = 0.1
"""Share of the way by which a door or a drawer is opened farther than it has to be; a lid comes up with a step back."""


class HandyOracle(PickAndPlaceOracle):
    """The oracle, with hands for episodes that have a goal for them: it carries, opens and answers."""

    def _play(self) -> Script:
        goal = self._spec.goal
        assert goal is not None
        if goal.on is not None:
            yield from self._carry(goal.things[0], goal.on)
        elif goal.things:
            yield from self._open([self._scene.by_id[key] for key in goal.things], goal.share)
            if goal.answer:
                yield from self._look_inside()
        if goal.answer:
            yield answering(self._context.skills, goal.answer), f"I know that the answer is {goal.answer}."
        while True:
            yield Call(self._stop), "The task is complete."

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
        places, ahead = [], handle.out
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
                            places.append((Viewpoint(handle.obj.id, x, z, yaw, gap, floor=grid.floor), side))
        return places  # type: ignore[return-value]  # Both sides are literals.

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
        here = BodyView(self._state())
        yield self._to(side, here.hand(side) + [0.1 * out, 0.05, -0.1], "I take my hand away.")

    def _square(self, handle: Handle, out: float) -> Script:
        """Stand square to a front, its handle at hand."""
        yaw = float(np.arctan2(-handle.out[0], -handle.out[2]))
        for _ in range(8):
            here = BodyView(self._state())
            left, _, ahead = here.local(handle.now(here.state))
            error = float(wrap_angle(yaw - here.yaw))
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
                here = BodyView(self._state())
                at = here.local(handle.now(here.state)) + [0.0, up, ahead]
                yield self._to(side, at, "I bring my hand to it.")
            yield self._close(side)
            if self._in_hand(handle.obj.id):
                return

    def _drawn(self, handle: Handle, side: Side, wide: float) -> tuple[Call, str]:
        """Return a call that takes a handle farther on its way."""
        here, now = BodyView(self._state()), handle.state(self._state())
        there = now + float(np.clip(wide - now, -handle.step, handle.step))
        due = here.hand(side) + here.local(handle.at(there)) - here.local(handle.at(now))
        if due[2] < handle.near:
            return self._back(0.12 if handle.tilts else 0.2), "I step back with it."
        return self._to(side, due, "I pull.")
