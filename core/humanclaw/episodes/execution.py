"""Result of a call: its chunks, what the body felt, and the parts that were played."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from humanclaw.records.feedback import Feedback, HandAim
from humanclaw.records.steps import PlayedPart
from humanclaw.skills.call import Call
from humanclaw.skills.plan import Control
from humanclaw.skills.plan_motion import Part, about, kind_of
from humanclaw.world.simulator import Chunk, WorldState

Watcher = Callable[[Chunk], bool]
"""Called with each chunk once it has been played. Returns False to leave out the rest of the call."""


@dataclass(frozen=True)
class SkillExecution:
    """Result of one executed call: its chunks (speech has none), and the wall time of generating and simulating,
    seconds."""

    call: Call
    before: WorldState
    chunks: tuple[Chunk, ...]
    seconds: Mapping[str, float]
    feedback: Feedback
    """What the body felt of the call, as the agent gets it."""
    parts: tuple[PlayedPart, ...] = ()
    """The parts of a sequence that were played, in order; empty for a call of one part."""
    rise_frames: int = 0
    """Frames in which the body first rose from a low pose; they are among those of `chunks`."""
    aims: tuple[HandAim, ...] = ()
    """Where hands were to go, and how far they are from there."""


def played_parts(plan: Sequence[Part], numbers: Sequence[int]) -> tuple[PlayedPart, ...]:
    """Return the parts that were played. numbers: for each chunk, the number of its part."""
    return tuple(
        PlayedPart("control", numbers.count(number), part.adapter.parent.name, dict(part.values))
        if isinstance(part, Control)
        else PlayedPart(kind_of(part), numbers.count(number), about(part))
        for number, part in enumerate(plan)
        if number in numbers
    )
