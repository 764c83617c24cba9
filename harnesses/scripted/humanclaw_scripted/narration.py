"""The words of a privileged agent, written from its eyes alone: its call, its view, and what it said before.

An agent that knows the map would tell it: rooms, ways, targets behind walls. A model that learns from such words learns
to claim what it cannot see. Nothing here gets the scene, the state or the agent's plan.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from humanclaw import Call, Decision, EpisodeContext, HistoryEntry, PluginError, Skill
from humanclaw.records import SEEN_PIXELS
from humanclaw.skills import to_si
from humanclaw_scripted.depth_mapping import LEVEL, Sight

AHEAD: Final = float(np.radians(15))
"""Largest bearing that is told as ahead, radians."""
SHOULDERS: Final = 0.25
"""Half the width of the strip of floor that is told as free, metres."""
CLOSE: Final = 0.5
"""Distance of a target from the pelvis at which it is told as at hand, metres."""
_CALLS: Final[Mapping[str, tuple[str, str]]] = {
    "hips.forward": ("go {:.0f} cm ahead", ""),
    "hips.back": ("step {:.0f} cm back", ""),
    "hips.left": ("go {:.0f} cm to the left", "go {:.0f} cm to the right"),
    "heading.left": ("turn {:.0f} degrees to the left", "turn {:.0f} degrees to the right"),
}
"""Measure to the words for a positive and for a negative amount."""


@dataclass(frozen=True)
class Seen:
    """What a view shows: bearing (radians, left positive) and distance (metres) of the target, None if it is not in
    view; free floor ahead, metres."""

    target: tuple[float, float] | None
    free: float

    @classmethod
    def of(cls, sight: Sight) -> Seen:
        points, target = sight.points, None
        if sight.pixels >= SEEN_PIXELS and sight.mine.any():
            mine = points[sight.mine]
            target = float(np.arctan2(*mine[:, [0, 2]].mean(0))), float(np.hypot(mine[:, 0], mine[:, 2]).min())
        strip = (
            (np.abs(points[:, 0]) < SHOULDERS) & (points[:, 1] > LEVEL) & (points[:, 1] < 1.8) & (points[:, 2] > 0.3)
        )
        return cls(target, float(points[strip, 2].min()) if strip.any() else np.inf)


class Narrator:
    """Writes the words of an episode's decisions."""

    def begin(self, context: EpisodeContext) -> None:
        """Begin an episode. Raises PluginError without the view."""
        if context.view is None:
            raise PluginError("words from the eyes need the view.", "Run the agent through the loop.")
        self._view, self._context = context.view, context
        self._noun = context.spec.target_category.replace("_", " ") or "target"

    def __call__(self, decision: Decision, past: Sequence[HistoryEntry]) -> Decision:
        """Return the decision with the words of the current view."""
        sight = Sight.of(self._view(), self._context.spec.target_ids, self._context.gaze)
        return narrated(decision, Seen.of(sight), self._noun, self._context.skills, past)


def narrated(
    decision: Decision, seen: Seen, noun: str, skills: Mapping[str, Skill], past: Sequence[HistoryEntry]
) -> Decision:
    """Return a decision with its words replaced. past: the steps before, with words of this module."""
    before = [entry.decision.mid_level_goal for entry in past]
    known = seen.target is not None or any(goal.startswith("Get to") for goal in before)
    goal = f"Get to the {noun} that I have seen." if known else f"Find a {noun}."
    return replace(
        decision,
        visible_state=_view(seen, noun),
        progress=_progress(seen, past, known),
        mid_level_goal=goal,
        mid_level_change="keep" if before and before[-1] == goal else "revise",
        reasoning=_reason(decision.calls[0], seen, noun, skills, known),
    )


def _view(seen: Seen, noun: str) -> str:
    free = f"{seen.free:.1f} m of floor ahead are free." if seen.free < 4 else "The floor ahead is free."
    if seen.target is None:
        return f"No {noun} is in view. {free}"
    bearing, metres = seen.target
    return f"A {noun} is in view, {_side(bearing)}, about {metres:.1f} m away. {free}"


def _side(bearing: float) -> str:
    return "ahead" if abs(bearing) < AHEAD else f"on the {'left' if bearing > 0 else 'right'}"


def _progress(seen: Seen, past: Sequence[HistoryEntry], known: bool) -> str:
    did = f"My last call was {past[-1].executed}." if past and past[-1].executed else "I begin."
    if not known:
        return f"{did} Search."
    near = seen.target is not None and seen.target[1] < CLOSE
    return f"{did} {'Complete.' if near else 'Approach.' if seen.target else 'Align.'}"


def _reason(call: Call, seen: Seen, noun: str, skills: Mapping[str, Skill], known: bool) -> str:
    skill = skills[call.skill]
    if skill.role == "stop":
        return "I take the goal to be reached: I stop."
    if skill.role == "sit":
        return f"I sit down where I take the {noun} to be, behind my legs."
    why = (
        f"the {noun} is {_side(seen.target[0])}"
        if seen.target
        else f"I {'have seen' if known else 'look for'} the {noun}"
    )
    return f"I {_motion(call, skill) or 'move'}: {why}."


def _motion(call: Call, skill: Skill) -> str:
    amounts = [
        (parameter, call.params.get(parameter.key, 0)) for parameter in skill.parameters if parameter.measure in _CALLS
    ]
    parts = [
        _CALLS[parameter.measure][value < 0].format(abs(value))
        for parameter, value in amounts
        if to_si(parameter.key, value)
    ]
    return " and ".join(parts)
