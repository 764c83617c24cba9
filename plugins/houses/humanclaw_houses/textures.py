"""Procedural textures: wood, cloth, ceramic, plaster, screens, pictures.

A texture is a small picture that covers a surface. All randomness comes from the generator that is passed in. Noise is
blurred in whole numbers, so that a texture is the same on every machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

Colour = tuple[int, int, int]
Pixels = NDArray[np.uint8]
Field = NDArray[np.float64]

SIZE: Final = 64
"""Pixels along a side of most tiles."""


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture that covers a surface."""

    pixels: Pixels
    """(H, H, 3), first row at the top."""
    metres: float = 1.0
    """Length that the texture covers, metres."""
    grain: bool = False
    """Whether the pattern runs from bottom to top; it is then laid along the longer side of a face."""
    fit: bool = False
    """Whether the texture is a picture of the whole face and is stretched over it; otherwise a part is cut from it."""


def _noise(rng: np.random.Generator, blur: tuple[int, int] = (1, 1), size: int = SIZE) -> Field:
    """Return (size, size) periodic noise with mean 0 and standard deviation 1. blur: over so many rows and columns."""
    field = _blur(blur[0], size) @ rng.integers(0, 256, (size, size)) @ _blur(blur[1], size).T
    away = field - field.mean()
    return np.asarray(away / np.sqrt((away * away).mean()))


@cache
def _blur(reach: int, size: int) -> Field:
    """Return (size, size) the matrix that sums up `reach` rows, twice. Floats are as exact here, and faster."""
    once = np.array(sum(np.roll(np.eye(size), k, 0) for k in range(reach)))
    return np.asarray(once @ once)


def _shade(colour: Colour, field: Field) -> Pixels:
    """Return a colour that a field makes lighter and darker: 0.1 is 10 %."""
    picture = np.asarray(colour, float) * (1.0 + field[..., None])
    return np.asarray(np.clip(np.round(picture), 0, 255), np.uint8)


def plain(colour: Colour, rng: np.random.Generator, noise: float = 0.007) -> Texture:
    """Paint, plastic, ceramic or metal."""
    return Texture(_shade(colour, noise * _noise(rng, (4, 4))))


def shaded(texture: Texture, share: float) -> Texture:
    """Return a texture at a share of its brightness: the same material in a seam, a fold or in better light."""
    return replace(texture, pixels=np.asarray(np.clip(np.round(texture.pixels * share), 0, 255), np.uint8))


def pastel(texture: Texture) -> Texture:
    """Return a nearly white texture with a tenth of its colour and a third of its contrast: a cloth as bed linen."""
    pixels = np.maximum(texture.pixels.astype(float), 1.0)
    mean = pixels.mean(axis=(0, 1))
    picture = (240 - 0.1 * (240 - mean)) * (pixels / mean) ** 0.35
    return replace(texture, pixels=np.asarray(np.clip(np.round(picture), 0, 255), np.uint8))


def wood(colour: Colour, rng: np.random.Generator) -> Texture:
    """Grain along the texture: long streaks, a little fine fibre, and slow changes of tone."""
    field = 0.6 * _noise(rng, (24, 2)) + 0.25 * _noise(rng, (8, 1)) + 0.5 * _noise(rng, (32, 8))
    return Texture(_shade(colour, 0.09 * field), metres=0.8, grain=True)


def cloth(colour: Colour, rng: np.random.Generator, contrast: float = 0.045) -> Texture:
    """Woven cloth: threads both ways under soft blotches."""
    field = 0.6 * _noise(rng, (5, 1)) + 0.6 * _noise(rng, (1, 5)) + 0.7 * _noise(rng, (12, 12))
    return Texture(_shade(colour, contrast * field), metres=0.9)


def leather(colour: Colour, rng: np.random.Generator) -> Texture:
    return Texture(_shade(colour, 0.06 * _noise(rng, (3, 3)) + 0.05 * _noise(rng, (14, 14))), metres=0.9)


def stripes(first: Colour, second: Colour, rng: np.random.Generator, count: int = 4) -> Texture:
    """Stripes along the texture, on cloth or wallpaper."""
    column = (np.arange(SIZE) * 2 * count // SIZE) % 2
    picture = np.where(column[None, :, None] == 1, np.array(first), np.array(second)) * np.ones((SIZE, 1, 1))
    return Texture(_grade(picture, 0.02 * _noise(rng, (3, 3))), metres=0.9, grain=True)


def checks(first: Colour, second: Colour, rng: np.random.Generator, count: int = 4) -> Texture:
    """Return a tartan of two colours that mix where they cross."""
    band = ((np.arange(SIZE) * 2 * count // SIZE) % 2).astype(float)
    share = ((band[:, None] + band[None, :]) / 2)[..., None]
    picture = np.array(first) * share + np.array(second) * (1 - share)
    return Texture(_grade(picture, 0.02 * _noise(rng, (2, 2))), metres=0.9)


def _grade(picture: NDArray[np.floating], field: Field) -> Pixels:
    return np.asarray(np.clip(np.round(picture * (1.0 + field[..., None])), 0, 255), np.uint8)


def ceramic(colour: Colour, rng: np.random.Generator, across: int = 4) -> Texture:
    """Square tiles with joints, each in its own shade."""
    size = 128
    cell = size // across
    shade = np.kron(0.02 * rng.standard_normal((across, across)), np.ones((cell, cell)))
    row = np.arange(size) % cell == 0
    joint = row[:, None] | row[None, :]
    return Texture(_shade(colour, np.where(joint, -0.16, shade)), metres=1.2)


def planks(colour: Colour, rng: np.random.Generator) -> Texture:
    """Eight floor boards, each with its own tone and its own end joint."""
    size, boards, width = 128, 8, 16
    tone = np.repeat(0.05 * rng.standard_normal(boards), width)[None, :] * np.ones((size, 1))
    field = tone + 0.035 * _noise(rng, (32, 2), size)
    field[:, np.arange(size) % width == 0] = -0.2
    for board, row in enumerate(rng.integers(0, size, boards)):
        field[row, board * width : (board + 1) * width] = -0.2
    return Texture(_shade(colour, field), metres=1.2)


def carpet(colour: Colour, rng: np.random.Generator) -> Texture:
    return Texture(_shade(colour, 0.03 * _noise(rng, (2, 2)) + 0.025 * _noise(rng, (10, 10))), metres=1.2)


def marble(colour: Colour, rng: np.random.Generator) -> Texture:
    field = _noise(rng, (10, 10))
    veins = np.exp(-((field / 0.12) ** 2))
    return Texture(_shade(colour, 0.02 * _noise(rng, (6, 6)) - 0.13 * veins), metres=1.0)


def sky(rng: np.random.Generator) -> Texture:
    """Return the view of a window: a bright sky with clouds over a line of green."""
    height = np.linspace(0.0, 1.0, SIZE)[:, None, None]
    picture = (1 - height) * np.array([150, 195, 240]) + height * np.array([225, 238, 248])
    clouds = np.clip(_noise(rng, (6, 14)), 0, 1.5)[..., None] / 1.5
    picture = picture * (1 - 0.6 * clouds) + 255 * 0.6 * clouds
    line = 50 + np.round(2.0 * _noise(rng, (1, 9))[0]).astype(int)
    garden = np.arange(SIZE)[:, None] > line[None, :]
    picture[garden] = np.array([128, 165, 110])
    return Texture(_grade(picture, np.zeros((SIZE, SIZE))), fit=True)


def glass(rng: np.random.Generator) -> Texture:
    """Return a mirror: a pale blurred room with two slanting highlights."""
    across, down = np.meshgrid(np.linspace(0, 1, SIZE), np.linspace(0, 1, SIZE))
    slant = across + 0.7 * down
    gleam = np.clip(1 - np.abs(slant - 0.6) / 0.1, 0, 1) + np.clip(1 - np.abs(slant - 0.85) / 0.04, 0, 1)
    picture = np.array([176.0, 192.0, 200.0]) * (1 - 0.15 * down[..., None]) + 50 * gleam[..., None]
    return Texture(_grade(picture, 0.01 * _noise(rng, (14, 14))), fit=True)


def screen(rng: np.random.Generator, on: bool) -> Texture:
    """Return a television picture; if it is off, dark glass that reflects a window."""
    across, down = np.meshgrid(np.linspace(0, 1, SIZE), np.linspace(0, 1, SIZE))
    if not on:
        glare = np.clip(1 - np.abs(across + 0.6 * down - 0.75) / 0.22, 0, 1) * (1 - down)
        return Texture(_grade(np.array([22.0, 24.0, 28.0]) + 55.0 * glare[..., None], 0 * across), fit=True)
    return Texture(_valley(rng.uniform(0.3, 0.7), _noise(rng, (1, 9))), fit=True)


def _valley(sun: float, noise: Field) -> Pixels:
    """Return a landscape at twice the resolution of other tiles: a low sun in a clear sky, rows of hills, a lake."""
    size = 2 * SIZE
    across, down = np.meshgrid(np.linspace(0, 1, size), np.linspace(0, 1, size))
    picture = np.array([88.0, 150.0, 226.0]) + (down / 0.55)[..., None] * np.array([140.0, 70.0, -20.0])
    picture += np.exp(-((np.hypot(across - sun, (down - 0.36) * 0.6) / 0.16) ** 2))[..., None] * [120, 90, 40]
    for row, (level, colour) in enumerate(_RIDGES):
        ridge = level + 0.045 * np.interp(across[0] * (SIZE - 1), np.arange(SIZE), noise[7 * row])
        inside = np.clip((down - ridge) * size / 2 + 0.5, 0, 1)[..., None]
        picture = picture * (1 - inside) + inside * (np.array(colour, float) * (1.25 - 0.6 * (down - ridge))[..., None])
    lake = np.clip((down - 0.78) * size / 2, 0, 1)[..., None]
    shine = np.exp(-(((across - sun) / 0.12) ** 2))[..., None] * [110.0, 90.0, 50.0]
    picture = picture * (1 - lake) + lake * (np.array([66.0, 118.0, 168.0]) * (1.5 - down)[..., None] + shine)
    return np.asarray(np.clip(np.round(picture), 0, 255), np.uint8)


_RIDGES: Final = ((0.5, (120, 150, 180)), (0.6, (92, 132, 92)), (0.7, (54, 96, 48)))
"""Top and colour of the hills on a television screen, from far to near."""


def painting(rng: np.random.Generator) -> Texture:
    """Return an abstract or a landscape inside a pale mount."""
    picture = _landscape(rng) if rng.random() < 0.5 else _abstract(rng)
    picture[:6], picture[-6:], picture[:, :6], picture[:, -6:] = (240.0,) * 4
    return Texture(_grade(picture, 0.02 * _noise(rng, (2, 2))), fit=True)


def _landscape(rng: np.random.Generator) -> Field:
    picture = np.ones((SIZE, SIZE, 1)) * np.asarray(pick(rng, SKIES), float)
    for level, shade in zip((26, 36, 47), (0.75, 0.6, 0.42), strict=True):
        line = level + np.round(4 * _noise(rng, (1, 12))[0])
        picture[np.arange(SIZE)[:, None] > line[None, :]] = shade * np.asarray(pick(rng, HILLS), float)
    return np.asarray(picture)


def _abstract(rng: np.random.Generator) -> Field:
    picture = np.ones((SIZE, SIZE, 1)) * np.array([236.0, 228.0, 214.0])
    for _ in range(7):
        row, column = rng.integers(4, 44, 2)
        high, wide = rng.integers(8, 30, 2)
        picture[row : row + high, column : column + wide] = pick(rng, ACCENTS)
    return np.asarray(picture)


def books(rng: np.random.Generator) -> Texture:
    """Return a row of spines that fills a shelf."""
    picture = np.zeros((SIZE, SIZE, 3))
    column = 0
    while column < SIZE:
        wide = int(rng.integers(3, 8))
        top = int(rng.integers(0, 16))
        picture[:, column : column + wide] = [48, 38, 30]
        picture[top:, column : column + wide] = pick(rng, ACCENTS)
        picture[top + 8 : top + 12, column : column + wide] *= 1.25
        picture[:, column] *= 0.5
        column += wide
    return Texture(_grade(picture, 0 * picture[..., 0]), fit=True)


def leaf(colour: Colour, rng: np.random.Generator) -> Texture:
    """Return a leaf with its rib, from stalk to tip."""
    rib = np.exp(-(((np.arange(SIZE) - SIZE / 2) / 2.5) ** 2))[None, :] * np.ones((SIZE, 1))
    tone = np.linspace(0.12, -0.12, SIZE)[:, None]
    return Texture(_shade(colour, 0.22 * rib + tone + 0.05 * _noise(rng, (6, 6))), fit=True)


def panel_door(colour: Colour, rng: np.random.Generator) -> Texture:
    """Return a door leaf or cupboard front with two sunken panels."""
    field = 0.02 * _noise(rng, (16, 2))
    for low, high in ((5, 28), (34, 59)):
        field[low:high, [10, 11]] = field[[low, low + 1], 10:54] = -0.22
        field[low:high, [52, 53]] = field[[high - 1, high], 10:54] = 0.1
    return Texture(_shade(colour, field), fit=True)


def oriental(colour: Colour, accent: Colour, rng: np.random.Generator) -> Texture:
    """Return a rug: borders, and a lozenge in the middle."""
    ring = np.minimum(np.arange(SIZE), np.arange(SIZE)[::-1])
    edge = np.minimum(ring[:, None], ring[None, :])
    lozenge = (SIZE - ring[:, None] - ring[None, :]) // 5
    pick = (edge // 3 == 1) | (edge // 2 == 5) | ((edge > 14) & (lozenge % 3 == 0))
    picture = np.where(pick[..., None], np.array(accent, float), np.array(colour, float))
    return Texture(_grade(picture, 0.04 * _noise(rng, (2, 2))), fit=True)


def burner(rng: np.random.Generator) -> Texture:
    """Return a glass hob seen from above: four rings."""
    picture = np.ones((SIZE, SIZE, 1)) * np.array([28.0, 28.0, 31.0])
    rows, columns = np.meshgrid(np.arange(SIZE), np.arange(SIZE), indexing="ij")
    for row, column, radius in ((17, 17, 11), (17, 47, 9), (47, 17, 9), (47, 47, 11)):
        distance = np.hypot(rows - row, columns - column)
        picture[(distance < radius) & (distance > radius - 2.2)] = [150, 60, 50]
    return Texture(_grade(picture, 0 * picture[..., 0]), fit=True)


def porthole(rng: np.random.Generator) -> Texture:
    """Return the front of a washing machine."""
    picture = np.ones((SIZE, SIZE, 1)) * np.array([238.0, 239.0, 241.0])
    rows, columns = np.meshgrid(np.arange(SIZE), np.arange(SIZE), indexing="ij")
    distance = np.hypot(rows - 37, columns - 32)
    picture[distance < 22] = [165, 168, 172]
    picture[distance < 17] = [45, 52, 62]
    picture[6:11, 6:24] = [205, 207, 210]
    picture[5:12, 44:56] = [60, 62, 66]
    return Texture(_grade(picture, 0 * picture[..., 0]), fit=True)


def pick(rng: np.random.Generator, colours: Sequence[Colour]) -> Colour:
    return colours[int(rng.integers(len(colours)))]


SKIES: Final[tuple[Colour, ...]] = ((160, 200, 232), (244, 205, 160), (200, 214, 224))
HILLS: Final[tuple[Colour, ...]] = ((130, 170, 120), (120, 140, 190), (196, 150, 96), (96, 150, 140))
ACCENTS: Final[tuple[Colour, ...]] = (
    (172, 62, 54), (46, 96, 138), (218, 168, 62), (70, 120, 88), (116, 78, 120), (206, 110, 70), (60, 66, 78),
    (226, 214, 190), (150, 172, 184), (120, 42, 48),
)  # fmt: skip
WOODS: Final[tuple[Colour, ...]] = ((176, 128, 82), (124, 82, 52), (206, 172, 128), (92, 62, 44), (150, 104, 66))
FABRICS: Final[tuple[Colour, ...]] = (
    (92, 104, 120), (150, 66, 58), (74, 108, 96), (138, 150, 158), (58, 74, 110), (64, 118, 122), (112, 112, 116),
    (128, 92, 118),
)  # fmt: skip
COVERS: Final[tuple[Colour, ...]] = (
    (190, 178, 160), (168, 164, 158), (150, 150, 152), (206, 196, 178), (134, 140, 144), (182, 156, 130),
    (156, 164, 152), (140, 152, 164),
)  # fmt: skip
"""Colours of upholstery and curtains: light and muted, so that their folds and seams show."""
LEATHERS: Final[tuple[Colour, ...]] = ((58, 88, 80), (62, 80, 108), (150, 74, 58))
PAINTS: Final[tuple[Colour, ...]] = (
    (236, 230, 218), (216, 224, 220), (226, 214, 196), (208, 218, 228), (232, 222, 200), (214, 220, 204),
    (228, 216, 214), (222, 222, 222), (196, 210, 206), (238, 226, 204),
)  # fmt: skip
