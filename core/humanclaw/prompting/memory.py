"""What a model keeps of an episode beyond its recent steps: its own notes, and a sketch map (paper, section 6).

Both follow from the history of decisions and feedback alone, so a resumed episode has the same memory.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from humanclaw.body.pose import Array, wrap_angle, yaw_matrix
from humanclaw.plugins.agents import HistoryEntry
from humanclaw.skills.contract import Skill
from humanclaw.skills.measures import to_si

CELL: Final = 1.0
"""Edge of a cell of the map, metres; of each cell the last view is kept."""
MOST: Final = 12
"""Most places in the prompt; the latest are kept."""


@dataclass(frozen=True)
class Place:
    """Where the body was at a step, as seen from where it is now, and what the model said that it saw there."""

    step: int
    ahead: float
    """Metres; negative is behind."""
    left: float
    turned: int
    """Where it looked: degrees to the left of where it looks now."""
    saw: str


def last_note(history: Sequence[HistoryEntry]) -> str:
    """Return the last note that the model wrote; empty if there is none."""
    written = (past.decision.note_to_self for past in reversed(history))
    return next((words for words in written if words.strip()), "")


def sketch(history: Sequence[HistoryEntry], skills: Mapping[str, Skill]) -> list[Place]:
    """Return the places of the map, the earliest first.

    Positions are reckoned from what the body felt of its motion, or without that sense from what was called: a wall
    that stopped the body is not in them.
    """
    position, yaw = np.zeros(3), 0.0
    stood: list[tuple[Array, float]] = []
    for past in history:
        stood.append((position, yaw))
        left, ahead, turn = moved(past, skills)
        position, yaw = position + yaw_matrix(yaw) @ [left, 0.0, ahead], yaw + turn
    last = {_cell(there): index for index, (there, _) in enumerate(stood) if history[index].decision.visible_state}
    return [_place(history[index], *stood[index], position, yaw) for index in sorted(last.values())[-MOST:]]


def moved(past: HistoryEntry, skills: Mapping[str, Skill]) -> tuple[float, float, float]:
    """Return how far a step took the body to the left and ahead, metres, and how far it turned left, radians."""
    if felt := past.feedback.proprioception:
        return felt.moved.left, felt.moved.forward, felt.moved.turn
    call = past.executed
    if call is None or call.skill not in skills:
        return 0.0, 0.0, 0.0
    parameters = skills[call.skill].parameters
    asked = {part.measure: to_si(part.key, call.params.get(part.key, 0)) for part in parameters if part.measure}
    ahead = asked.get("hips.forward", 0.0) - asked.get("hips.back", 0.0)
    return asked.get("hips.left", 0.0), ahead, asked.get("heading.left", 0.0)


def _cell(position: Array) -> tuple[int, int]:
    return round(position[0] / CELL), round(position[2] / CELL)


def _place(past: HistoryEntry, there: Array, looked: float, here: Array, yaw: float) -> Place:
    left, _, ahead = np.round(yaw_matrix(-yaw) @ (there - here), 1) + 0.0  # No -0.0.
    turned = round(float(np.degrees(wrap_angle(looked - yaw))))
    return Place(past.step, float(ahead), float(left), turned, past.decision.visible_state)
