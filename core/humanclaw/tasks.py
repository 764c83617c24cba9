"""What can be asked for: target categories, the words that name them, and the episode that an instruction means."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

from humanclaw.records import EpisodeSpec
from humanclaw.scene import Scene

TARGET_CATEGORIES: Final = ("chair", "couch", "bed", "potted_plant", "tv", "toilet")
SIT_CATEGORIES: Final = ("bed", "couch", "toilet")
ALIASES: Final[Mapping[str, tuple[str, ...]]] = {
    "chair": ("chair", "armchair", "seat", "stool"),
    "couch": ("couch", "sofa", "settee", "loveseat"),
    "bed": ("bed", "mattress"),
    "potted_plant": ("potted plant", "plant", "flowerpot"),
    "tv": ("tv", "television", "tv screen", "monitor"),
    "toilet": ("toilet", "lavatory", "wc"),
}
"""Words by which a sentence names a target category."""


def category_of(instruction: str) -> str:
    """The target category that an instruction names, by the longest alias in it; empty if it names none."""
    words = instruction.lower()
    found = [
        (len(alias), category)
        for category, aliases in ALIASES.items()
        for alias in aliases
        if re.search(rf"\b{re.escape(alias)}s?\b", words)
    ]
    return max(found)[1] if found else ""


def wants_to_sit(instruction: str) -> bool:
    return bool(re.search(r"\b(sit|seat|sit down|take a seat)\b", instruction.lower()))


def free_episode(instruction: str, scene: Scene, *, seed: int = 0, max_steps: int = 100, name: str = "") -> EpisodeSpec:
    """An episode for an instruction of one's own, in a scene as it stands. Not scored if it names no target category."""
    category = category_of(instruction)
    return EpisodeSpec(
        id=name or f"free-{seed}",
        instruction=instruction,
        scene=scene.name,
        scene_digest=scene.digest,
        start=scene.start,
        target_category=category,
        target_ids=tuple(thing.id for thing in scene.of_category(category)) if category else (),
        interact=category in SIT_CATEGORIES and wants_to_sit(instruction),
        max_steps=max_steps,
        seed=seed,
    )
