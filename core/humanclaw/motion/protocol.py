"""What a motion generator is: five frames and a skill's parameters in, fifteen frames out (paper, section 3.3).

The motion is kinematic. The simulator computes the body's actual motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

from humanclaw.body.pose import Motion


class MotionGenerator(Protocol):
    """A motion prior with skill adapters (paper, section 3.3)."""

    def start(self) -> Motion:
        """Return the five frames of standing that every episode begins from, at the origin facing +Z."""

    def generate(self, history: Motion, adapter: Path, values: Mapping[str, float], key: Sequence[int]) -> Motion:
        """Return 15 frames that continue 5, in the frame of the history. The same key gives the same motion, bit for
        bit.

        values: each parameter that the adapter's header names, in SI, in any order.
        """

    @property
    def digest(self) -> str:
        """Digest of the prior's weights."""
