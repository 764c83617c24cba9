"""Falls of the body, measured from call to call: a call lasts half a second, and a fall of 3 m eight tenths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from humanclaw.world.simulator import Chunk

FALL: Final = 0.5
"""A drop through the air of so much counts as a fall, metres: a person steps down no further than that."""


@dataclass(frozen=True)
class Descent:
    """How the body has come down through the air."""

    left: float
    """Height of the pelvis when the body last touched anything, metres."""
    fall: float = 0.0
    """The deepest fall of the last call, from where it began in an earlier one; metres, 0 below FALL."""
    falling: bool = False
    """Whether that fall was still going on when the call ended."""

    def after(self, chunks: Sequence[Chunk]) -> Descent:
        """Return the descent after one more call. Nothing that the body holds bears it."""
        left, sunk, deepest = self.left, 0.0, 0.0
        for execution in (chunk.execution for chunk in chunks):
            met = [contact for contact in execution.contacts if contact.object_id not in execution.held.values()]
            touched = {frame for contact in met for frame in contact.frames}
            for frame, height in enumerate(execution.simulated.root[:, 1].tolist()):
                deepest = max(deepest, left - height)
                left = height if frame in touched else left
                sunk = left - height
        fell = deepest >= FALL
        return Descent(left, round(deepest, 2) if fell else 0.0, fell and sunk == deepest)
