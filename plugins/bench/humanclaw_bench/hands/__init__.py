"""Tasks for hands: an extension of the benchmark, apart from the paper's split. Needs the extra `hands`.

They are of four families.
"""

from __future__ import annotations

from typing import Final, Literal

from humanclaw import EpisodeSpec

Family = Literal["bring", "tidy", "open", "look"]
FAMILIES: Final[tuple[Family, ...]] = ("bring", "tidy", "open", "look")


def family_of(spec: EpisodeSpec) -> Family:
    """Return the family of an episode, from its goal."""
    assert spec.goal is not None
    if spec.goal.on is None:
        return "look" if spec.goal.answer else "open"
    return "tidy" if spec.instruction.startswith("tidy") else "bring"
