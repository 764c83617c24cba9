"""The resources for furnishing a house: style, random numbers, names of pieces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from humanclaw_houses.piece_builder import Piece
from humanclaw_houses.style import Style

Maker = Callable[[Style, str], Piece]
_COUCHES: Final = (0.3, 0.3, 0.25, 0.15)
"""Shares of households with one to four couches; fewer are placed if there is no room."""


@dataclass(eq=False)
class FurnishingContext:
    """The resources that furnishing rules use."""

    style: Style
    rng: np.random.Generator
    rooms: tuple[str, ...]
    """Kinds of room in this house."""
    left: dict[str, int] = field(default_factory=dict)
    """Number of chairs and couches of this household that are not placed yet."""
    _count: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        couches, chairs = self.rng.choice(4, p=_COUCHES) + 1, self.rng.integers(1, 15)
        self.left.update(couch=int(couches), chair=int(chairs))

    def name(self, word: str) -> str:
        self._count[word] = self._count.get(word, 0) + 1
        return f"{word}_{self._count[word]}"

    def make(self, maker: Callable[..., Piece], *args: object, **options: object) -> Piece:
        word = maker.__name__.rstrip("_")  # bin_ avoids the builtin bin.
        return maker(self.style, self.name(word), *args, **options)

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)
