"""Result of a call: its chunks, what the body felt, and the parts that were played."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from humanclaw.records.feedback import Feedback, HandAim, Proprioception, Touch
from humanclaw.records.steps import PlayedPart
from humanclaw.skills.call import Call
from humanclaw.skills.plan import Control
from humanclaw.skills.posing import Part, about, kind_of
from humanclaw.world.simulator import Chunk

Watcher = Callable[[Chunk], bool]
"""Called with each chunk once it has been played. Returns False to leave out the rest of the call."""


@dataclass(frozen=True)
class SkillExecution:
    """Result of one executed call: at least one chunk, and the wall time of generating and simulating, seconds."""

    call: Call
    chunks: tuple[Chunk, ...]
    seconds: Mapping[str, float]
    proprioception: Proprioception | None = None
    tactile: tuple[Touch, ...] | None = None
    """Readings of the senses beside vision; None for a sense that is off."""
    parts: tuple[PlayedPart, ...] = ()
    """The parts of a sequence that were played, in order; empty for a call of one part."""
    rise_frames: int = 0
    """Frames in which the body first rose from a low pose; they are among those of `chunks`."""
    cancelled: bool = False
    """Whether a part of the call was left out."""
    limits: tuple[str, ...] = ()
    """What the body could not do of the call, in words."""
    aims: tuple[HandAim, ...] = ()
    """Where hands were to go, and how far they are from there."""
    fall: float = 0.0
    """How deep the body fell, metres; 0 if it did not."""
    falling: bool = False
    """Whether it was still falling when the call ended."""

    @property
    def feedback(self) -> Feedback:
        """The feedback that the agent gets for the call."""
        return Feedback(
            self.call,
            proprioception=self.proprioception,
            tactile=self.tactile,
            cancelled=self.cancelled,
            limits=self.limits,
            fell=self.fall,
            falling=self.falling,
        )


def played_parts(plan: Sequence[Part], numbers: Sequence[int]) -> tuple[PlayedPart, ...]:
    """Return the parts that were played. numbers: for each chunk, the number of its part."""
    return tuple(
        PlayedPart("control", numbers.count(number), part.adapter.parent.name, dict(part.values))
        if isinstance(part, Control)
        else PlayedPart(kind_of(part), numbers.count(number), about(part))
        for number, part in enumerate(plan)
        if number in numbers
    )


def working() -> float:
    """Return the time of time.perf_counter() on a clock that stands still while numba compiles, seconds.

    Code is compiled once on a machine, and no step is slow because of it.
    """
    # An extra: only engines and renderers that are compiled have loaded it, and another thread may be about to.
    now, module = time.perf_counter(), sys.modules.get("humanclaw.world.compiling")
    spent = getattr(module, "compiling_seconds", None)
    return now - float(spent(now)) if spent else now
