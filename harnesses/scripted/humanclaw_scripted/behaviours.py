"""How each fault alters the oracle's decisions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from humanclaw import Call, Decision
from humanclaw.body import Array
from humanclaw.records import REACHED
from humanclaw_scripted.actions import BACK, SIDE, SIT, TURN, WALK, asking
from humanclaw_scripted.ground_truth import Perception

LOOK_AROUND: Final = 45
"""Turn of each step of a search, degrees."""
LATE: Final = 12
"""Steps that the fault `lateness` leaves for the way to the target."""
TURNING_POINT: Final = 3.2
"""Distance after which the fault `aimless_search` turns back, metres."""


@dataclass
class Snapshot:
    """Input of a fault at one step: the oracle's decision, the episode, and the fault's own notes of the episode."""

    perception: Perception
    decision: Decision
    left: int
    """Steps left, this one included."""
    seen: bool
    """Whether the oracle says that the target is in view."""
    seen_before: bool
    """Whether it has said so at an earlier step."""
    stop: str
    """Name of the skill that ends the episode."""
    begun: float
    """Length of the way to the nearest target at the start, metres; the straight line if the way was not measured."""
    notes: dict[str, int]
    trail: list[Array]
    """Earlier places of the body, (3,) each; part of the notes."""

    @property
    def stopping(self) -> bool:
        return self.decision.calls[0].skill == self.stop

    def but(self, call: Call, why: str) -> Decision:
        """Return the oracle's decision with another call."""
        return replace(self.decision, calls=(call,), reasoning=why)

    def asks(self, measures: Sequence[str], *amounts: float) -> Call:
        """Return a call of the skill that commands these measures, SI units."""
        return asking(self.perception.context.skills, measures, amounts)

    def stops(self, why: str) -> Decision:
        """Return the oracle's decision with an active stop."""
        return self.but(Call(self.stop), why)

    def turns(self, degrees: float, why: str) -> Decision:
        """Return the oracle's decision with a turn on the spot; left is positive."""
        return self.but(self.asks(TURN, np.radians(degrees)), why)

    def walks(self, cm: float, why: str, degrees: float = 0.0) -> Decision:
        """Return the oracle's decision with a step ahead."""
        return self.but(self.asks(WALK, 0.0, cm / 100, np.radians(degrees)), why)

    @property
    def has_seen(self) -> bool:
        """Whether the target is or was in view."""
        return self.seen or self.seen_before

    def walked(self) -> float:
        """Return the length of the trail up to here, over the floor, metres."""
        steps = np.diff([*self.trail, self.perception.here()], axis=0)
        return float(np.linalg.norm(steps[:, [0, 2]], axis=1).sum())

    def to_and_fro(self, degrees: int, why: str) -> Decision:
        """Return a turn to the right, at the next call to the left, and so on."""
        side = 1 if self.count("turned") % 2 else -1
        return self.turns(degrees * side, why)

    def count(self, what: str) -> int:
        """Return how often this was counted before, and count it."""
        self.notes[what] = self.notes.get(what, 0) + 1
        return self.notes[what] - 1


def _blind(at: Snapshot) -> Decision:
    """Keep searching with the target in view."""
    blind = replace(at.decision, visible_state="I am in a room.")
    if not at.has_seen:
        return blind
    around = at.asks(TURN, np.radians(LOOK_AROUND))
    return replace(blind, calls=(around,), reasoning="I do not see it yet: I look around.")


def _misjudges(at: Snapshot) -> Decision:
    if at.seen and 3 * REACHED < at.perception.away() < 3.0:
        return at.stops("It looks close enough to touch, so I stop.")
    return at.decision


def _overlooks_arrival(at: Snapshot) -> Decision:
    if at.stopping or "turned" in at.notes:
        return at.to_and_fro(10, "I am not there yet and look where to go on.")
    return at.decision


def _straight_on(at: Snapshot) -> Decision:
    if at.stopping:
        return at.decision
    angle = at.perception.bearing()
    if abs(angle) > np.radians(28):
        return at.turns(_degrees(angle, 75), "It lies over there: I turn to it.")
    return at.walks(50, "It lies straight ahead: I walk on.", _degrees(angle, 20))


def _wavers(at: Snapshot) -> Decision:
    if not at.has_seen:
        return at.decision
    angle, wavering = at.perception.bearing(), at.to_and_fro(8, "A little more this way.")
    if abs(angle) < np.radians(28):
        return wavering
    return at.turns(_degrees(angle, 75), wavering.reasoning)


def _turns_away(at: Snapshot) -> Decision:
    """Turn back after half the way, once the target has been reported."""
    if "gone" not in at.notes and not (at.seen_before and at.perception.away() < 0.5 * at.begun):
        return at.decision
    turns = at.count("gone")
    away = replace(at.decision, visible_state="I am in a room.")
    call = at.asks(TURN, np.radians(60)) if turns < 3 else at.asks(WALK, 0.0, 0.3, 0.0)
    return replace(away, calls=(call,), reasoning="There may be a better one elsewhere.")


def _imagines(at: Snapshot) -> Decision:
    gone = _turns_away(at)
    if "gone" not in at.notes:
        return gone
    noun = at.perception.context.spec.target_category.replace("_", " ")
    return replace(gone, visible_state=f"A {noun} is right in front of me.")


def _never_sits(at: Snapshot) -> Decision:
    return at.decision


def _sits_on_air(at: Snapshot) -> Decision:
    """Sit down facing the seat."""
    if at.stopping and not at.count("sat"):
        return at.but(at.asks(SIT, 0.5), "I am at the seat: I sit down.")
    return at.decision


def _rises(at: Snapshot) -> Decision:
    if at.stopping and not at.count("risen"):
        return at.walks(5, "I straighten up.")
    if "risen" in at.notes:
        return at.stops("The task is complete.")
    return at.decision


def _fidgets(at: Snapshot) -> Decision:
    return at.to_and_fro(8, "A little more this way.")


def _searches_aimlessly(at: Snapshot) -> Decision:
    """Walk to the turning point and back to the start, repeatedly, until the target happens to come into view."""
    if at.has_seen:
        return at.decision
    if "gone" not in at.notes and at.walked() < TURNING_POINT:
        at.trail.append(at.perception.here())
        return at.decision
    at.count("gone")
    back = _back_along(at, at.trail)
    # The trail is used up: the body is at the start again, and the search begins anew.
    if back.calls[0].skill == at.stop:
        del at.notes["gone"]
        return at.decision
    return back


def _dawdles(at: Snapshot) -> Decision:
    return at.decision if at.left <= LATE or at.has_seen else _fidgets(at)


def _approaches_blindly(at: Snapshot) -> Decision:
    return at.decision if at.has_seen else _straight_on(at)


def _overlooks_jam(at: Snapshot) -> Decision:
    """Step aside repeatedly while the target is in view, whatever stands there."""
    if not (at.seen and at.perception.away() < 2.5):
        return at.decision
    angle = at.perception.bearing()
    if abs(angle) > np.radians(35):
        return at.turns(_degrees(angle, 75), "It lies over there: I turn to it.")
    return at.but(at.asks(SIDE, 0.3), "I see it: I go round what stands before it.")


def _gives_up(at: Snapshot) -> Decision:
    """Go back to the start half-way, unless the target has come into view."""
    if "gone" not in at.notes and at.has_seen:
        return at.decision
    if "gone" not in at.notes and at.walked() < 0.6 * at.begun:
        at.trail.append(at.perception.here())
        return at.decision
    at.count("gone")
    return _back_along(at, at.trail)


def _back_along(at: Snapshot, trail: list[Array]) -> Decision:
    """Take a step back along the trail; stop at its beginning."""
    # Places that the body has come back to are done.
    while trail and np.hypot(*(trail[-1] - at.perception.here())[[0, 2]]) < 0.35:
        trail.pop()
    if not trail:
        return at.stops("I cannot find it.")
    angle = at.perception.bearing_of(trail[-1])
    if abs(angle) > np.radians(28):
        return at.turns(_degrees(angle, 75), "This leads nowhere: I go back.")
    return at.walks(45, "I go back.", _degrees(angle, 20))


def _backs_up(at: Snapshot) -> Decision:
    """Go to the target backwards, unless it happens to come into view, and stop beside it."""
    if at.has_seen:
        return at.decision
    angle, here = at.perception.bearing(), at.perception.here()
    if at.perception.away() < 1.0 or (at.trail and np.linalg.norm(at.trail.pop() - here) < 0.08):
        return at.stops("There is nothing here.")
    if abs(angle) < np.radians(150):
        return at.turns(-45 if angle > 0 else 45, "I look at the other side.")
    at.trail.append(here)
    return at.but(at.asks(BACK, 0.25), "I make room for myself.")


BEHAVIOURS: Final[Mapping[str, Callable[[Snapshot], Decision]]] = {
    "blindness": _blind,
    "backing": _backs_up,
    "blind_approach": _approaches_blindly,
    "fidgeting": _fidgets,
    "give_up": _gives_up,
    "aimless_search": _searches_aimlessly,
    "arrival": _overlooks_arrival,
    "distance": _misjudges,
    "lateness": _dawdles,
    "jam": _overlooks_jam,
    "wavering": _wavers,
    "imagination": _imagines,
    "forgetting": _turns_away,
    "rising": _rises,
    "seat": _sits_on_air,
    "confusion": _never_sits,
    "sitting": _never_sits,
}
"""Name of a fault to the function that alters the decision."""


def _degrees(angle: float, most: int) -> int:
    return int(np.clip(round(np.degrees(angle)), -most, most))
