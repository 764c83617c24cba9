"""Translate the category names of datasets to those of this project."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Final

_SAME: Final[Mapping[str, tuple[str, ...]]] = {
    "chair": ("chair", "armchair", "dining_chair", "office_chair", "desk_chair", "swivel_chair", "rocking_chair"),
    "couch": ("couch", "sofa", "settee", "loveseat", "sectional", "chaise_longue", "daybed"),
    "bed": ("bed", "double_bed", "single_bed", "bunk_bed", "crib"),
    "potted_plant": ("potted_plant", "plant", "houseplant", "flowerpot", "pot_plant", "indoor_plant"),
    "tv": ("tv", "television", "tv_monitor", "tv_screen", "television_set", "television_receiver",
           "flat_screen_television"),
    "toilet": ("toilet", "toilet_bowl", "wc", "lavatory"),
    "door": ("door", "doors"),
    "window": ("window", "windows"),
    "stairs": ("stairs", "staircase", "stair", "steps"),
}  # fmt: skip
_CATEGORY: Final[Mapping[str, str]] = {word: name for name, words in _SAME.items() for word in words}
SEATS: Final = frozenset({"chair", "couch", "bed", "toilet", "stool", "bench", "ottoman"})
"""Categories with a surface to sit on."""

MOVABLE: Final = frozenset({
    "backpack", "bag", "ball", "basket", "bin", "blanket", "board_game", "book", "bottle", "bowl", "box", "candle",
    "chair", "clock", "cup", "cushion", "drinkware", "file_sorter", "food", "foot_stool", "footstool", "fruit",
    "hamper", "handbag", "headphones", "kettle", "laptop", "laundry_basket", "magazine", "mug", "ottoman", "pan",
    "pillow", "plate", "plush_toy", "pot", "shoe", "shoes", "stool", "stuffed_animal", "suitcase", "tray", "teddy_bear",
    "toy", "toys", "trash_can", "trashcan", "umbrella", "vase", "waste_basket", "wastebasket",
})  # fmt: skip
"""Categories that people pick up or push aside if the object is small."""

GOALS: Final = ("chair", "couch", "bed", "potted_plant", "tv", "toilet")
"""The six goal categories of ObjectNav, as this project names them."""


def category_of(words: Iterable[str]) -> str:
    """Return the category that the first non-empty word names, or that word itself; 'object' if all are empty.

    "unknown", "undefined", "none" and "nan" count as empty: annotators write them for objects that they did not name.
    """
    for word in words:
        name = re.sub(r"[^a-z0-9]+", "_", word.lower()).strip("_")
        if name and name not in ("unknown", "undefined", "none", "nan"):
            return _CATEGORY.get(name, name)
    return "object"
