"""The table of faults: missing capabilities of known effect, against which root causes are checked.

Every command loads this table, so it imports no agent; humanclaw_scripted.behaviours implements the faults.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from humanclaw import EpisodeSpec


@dataclass(frozen=True)
class Fault:
    """A missing capability, its effect, and the episodes that show it."""

    name: str
    capability: str
    cause: str
    """Label of HumanCLAW-Bench for the root cause that the fault should lead to."""
    description: str
    seated: bool = False
    """Whether only sitting tasks show it."""
    standing: bool = False
    """Whether the oracle only walks up to the target, and the fault does the rest."""
    elsewhere: bool = False
    """Whether the oracle first sits down on another seat."""
    ways: tuple[float, float] = (0.0, float("inf"))
    """Least and greatest length of the way in the episodes that show it, metres."""
    rooms: int = 1
    """Least number of rooms on the way in the episodes that show it."""

    @property
    def agent(self) -> str:
        """Name of the agent that can have this fault."""
        return "faulty"

    @property
    def options(self) -> Mapping[str, Any]:
        """Options of the agent for this fault."""
        return {"fault": self.name}

    def goes_with(self, other: Fault) -> bool:
        """Tell whether one agent can have both: their capabilities differ, and at most one is `standing`."""
        return self.capability != other.capability and not (self.standing and other.standing)

    def with_another(self, other: Fault) -> Mapping[str, Any]:
        """Return the options of the agent for both faults."""
        return {"fault": f"{self.name}+{other.name}"}

    def fits(self, spec: EpisodeSpec) -> bool:
        """Tell whether an episode can show this fault; True if the length of its way is unknown."""
        if self.seated and not spec.interact:
            return False
        way, (least, most) = spec.difficulty, self.ways
        return way is None or (least <= way.distance <= most and way.rooms >= self.rooms)


_MID_LEVEL, _BODY = "mid-level reasoning", "body awareness"
_FAR = (4.0, float("inf"))
FAULTS: Final[Mapping[str, Fault]] = {
    fault.name: fault
    for fault in (
        Fault(
            "blindness",
            "perception",
            "find: target in view but not seen",
            "does not notice the target that is in view, and searches on",
        ),
        Fault(
            "backing",
            _MID_LEVEL,
            "find: near but not in view",
            "goes to the target with its back to it",
            ways=(1.5, 3.0),
        ),
        Fault(
            "blind_approach",
            _BODY,
            "find: unaware jammed",
            "walks straight at a target that it has not seen, whatever stands in between",
            ways=_FAR,
            rooms=2,
        ),
        Fault(
            "fidgeting", "action", "find: ineffective actions", "turns to and fro from the start", ways=_FAR, rooms=2
        ),
        Fault(
            "give_up",
            _MID_LEVEL,
            "find: midpoint give up",
            "goes back before the target is in view",
            ways=(8.0, float("inf")),
            rooms=3,
        ),
        Fault(
            "aimless_search",
            _MID_LEVEL,
            "find: ineffective exploration",
            "turns back to the start after a few metres, again and again",
            ways=(8.0, float("inf")),
            rooms=3,
        ),
        Fault("arrival", _BODY, "nav: unaware arrived/touch", "does not notice that it has arrived, and never stops"),
        Fault(
            "distance",
            "ego-spatial distance",
            "nav: stop while far",
            "stops as soon as the target is in view and within 3 m",
        ),
        Fault(
            "lateness",
            "exploration timing",
            "nav: find too late",
            "turns to and fro until few steps are left",
            ways=(4.0, 8.0),
            rooms=2,
        ),
        Fault(
            "jam",
            _BODY,
            "nav: unaware jammed",
            "steps aside with its eyes on the target, on and on, whatever stands there",
        ),
        Fault("wavering", "action", "nav: ineffective actions", "turns to and fro once it sees the target"),
        Fault(
            "imagination",
            "perception",
            "nav: target hallucination",
            "turns back half-way and says that the target is before it",
            ways=_FAR,
        ),
        Fault("forgetting", _MID_LEVEL, "nav: lost target", "turns back half-way", ways=_FAR),
        Fault("rising", _BODY, "interact: stand after sit", "gets up again before it stops", seated=True),
        Fault("seat", _BODY, "interact: sit on air", "sits down facing the seat", seated=True, standing=True),
        Fault(
            "confusion",
            _BODY,
            "interact: sit wrong",
            "sits down on another seat before it goes to the target",
            seated=True,
            standing=True,
            elsewhere=True,
        ),
        Fault("sitting", "decision", "interact: stop but never sit", "stops at the seat", seated=True, standing=True),
    )
}
"""Faults by the name for `--option fault=NAME`, in the order of the root causes. None leads to "too far": that cause
lies in the task."""
