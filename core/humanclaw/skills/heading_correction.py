"""Correct heading errors in the next call.

Every generated chunk misses its command a little. A quarter of a degree a call is 25 degrees after a hundred calls, so
the next call makes up for it. Only generated motion counts: a turn by contact stays.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from typing import Final, Self

from humanclaw.body.pose import HISTORY, Motion, heading, wrap_angle
from humanclaw.skills.contract import Skill

HEADING: Final = "heading.left"
MOST: Final = 5 * pi / 180
"""Maximum correction in one call, radians, so that a failed motion does not whirl the body around."""


@dataclass(frozen=True)
class HeadingCorrection:
    """Left turn that is still owed to the calls so far, radians."""

    owed: float = 0.0

    def steer(self, skill: Skill, values: Mapping[str, float]) -> dict[str, float]:
        """Return a call's values (SI); a commanded turn is corrected by the heading error of earlier calls."""
        turn = skill.commands(HEADING)
        owed = {turn.name: values[turn.name] + self.owed} if turn is not None and turn.name in values else {}
        return dict(values) | owed

    def after(self, skill: Skill, values: Mapping[str, float], history: Motion, motion: Motion) -> Self:
        """Return the correction once the motion (15 frames) that followed the history (5) was generated for a call.

        values: the called ones, before steering. Heading changes of skills that are not locomotion are no error.
        """
        if skill.role != "locomotion":
            return self
        turn = skill.commands(HEADING)
        before, now = heading(history.then(motion).rotations[[HISTORY - 1, -1], 0])
        owed = self.owed + (values.get(turn.name, 0.0) if turn is not None else 0.0) - float(now - before)
        return type(self)(min(max(float(wrap_angle(owed)), -MOST), MOST))
