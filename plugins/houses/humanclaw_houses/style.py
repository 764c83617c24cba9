"""The style of one house: its woods, cloths and paints, drawn once so that its furniture matches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from humanclaw_houses import textures as t
from humanclaw_houses.textures import Texture


@dataclass(frozen=True, eq=False)
class Style:
    """The textures that the furniture of a house shares."""

    rng: np.random.Generator
    wood: Texture
    second_wood: Texture
    cloth: Texture
    second_cloth: Texture
    white: Texture
    black: Texture
    steel: Texture
    chrome: Texture
    brass: Texture
    ceramic: Texture
    stone: Texture
    linen: Texture

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Style:
        first, second = rng.permutation(len(t.WOODS))[:2]
        cloths = rng.permutation(len(t.COVERS))[:2]
        return cls(
            rng,
            wood=t.wood(t.WOODS[first], rng),
            second_wood=t.wood(t.WOODS[second], rng),
            cloth=t.cloth(t.COVERS[cloths[0]], rng),
            second_cloth=t.cloth(t.COVERS[cloths[1]], rng),
            white=t.plain((240, 240, 238), rng),
            black=t.plain((34, 34, 37), rng, 0.03),
            steel=t.plain((176, 180, 184), rng, 0.02),
            chrome=t.plain((206, 210, 214), rng, 0.02),
            brass=t.plain((190, 152, 86), rng, 0.02),
            ceramic=t.plain((250, 250, 252), rng, 0.006),
            stone=t.marble(t.pick(rng, ((214, 210, 204), (72, 72, 76), (170, 160, 148))), rng),
            linen=t.cloth(t.pick(rng, ((244, 242, 238), (226, 232, 238), (240, 232, 220))), rng, 0.02),
        )

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def between(self, low: float, high: float) -> float:
        """Draw a length between two lengths, rounded to the centimetre."""
        return round(float(self.rng.uniform(low, high)), 2)

    def choice(self, *things: Texture) -> Texture:
        return things[int(self.rng.integers(len(things)))]

    def paint(self) -> Texture:
        """Return a coloured lacquer."""
        return t.plain(t.pick(self.rng, t.ACCENTS), self.rng)

    def fabric(self) -> Texture:
        """Draw a new cloth: plain, striped or checked."""
        colour = t.pick(self.rng, t.FABRICS)
        kind = self.rng.random()
        if kind < 0.6:
            return t.cloth(colour, self.rng)
        if kind < 0.8:
            return t.stripes(colour, (232, 226, 214), self.rng)
        return self.checked()

    def checked(self) -> Texture:
        """Draw a cloth in checks."""
        return t.checks(t.pick(self.rng, t.FABRICS), (232, 226, 214), self.rng)
