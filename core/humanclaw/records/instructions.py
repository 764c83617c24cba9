"""Instructions: target words, and the episode that an instruction means."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

from humanclaw.errors import HumanclawError, SceneError
from humanclaw.records.specification import EpisodeSpec
from humanclaw.world.scene import Scene

SEATS: Final = ("bed", "couch", "toilet")
"""Categories that a body sits on: furniture that stays in place under its weight."""
ALIASES: Final[Mapping[str, tuple[str, ...]]] = {
    "chair": ("chair", "armchair", "seat", "stool"),
    "couch": ("couch", "sofa", "settee", "loveseat", "sectional"),
    "bed": ("bed", "mattress"),
    "potted_plant": ("potted plant", "plant", "houseplant", "flowerpot"),
    "tv": ("tv", "television", "tv screen", "screen", "flatscreen", "monitor"),
    "toilet": ("toilet", "lavatory", "wc", "commode"),
}
"""Words for each target category. A category without an entry is its own word."""
_ALIAS: Final = "|".join(sorted((alias for words in ALIASES.values() for alias in words), key=len, reverse=True))
_THE: Final = r"(?:(?:the|a|an|your|that|this)\s+)?"
_RELATION: Final = (
    "behind|beyond|past|passing|beside|near|by|under|above|below|over|around|opposite|facing|between|with|without|"
    r"from|leave|skip|ignore|(?:next|close)\s+to|(?:front|top|left|right|side|instead)\s+of|rather\s+than|"
    r"not(?:\s+(?:go|walk)\s+to)?"
)
# Up to three adjectives stand before a noun, and none is "to": "past the door to the bed" means the bed.
_LANDMARK: Final = re.compile(
    rf"\b(?:{_RELATION})\s+{_THE}(?:(?!to\b)\w+\s+){{0,3}}?(?:{_ALIAS})s?\b(?:\s+and\s+{_THE}(?:{_ALIAS})s?\b)?"
)
_SIT: Final = r"(?:sit|sitting(?!\s+room)|(?:be|get)\s+seated|(?:take|taking|have)\s+a\s+seat)\b"
# "Do not forget to sit", "do not stop and sit" and "do not sit until you are there" ask to.
_REFUSED_SEAT: Final = re.compile(
    r"(?:\b(?:can)?not|n['\u2019]t|\bdont|\bnever|\bwithout|\bavoid|\brefuse|\brefrain|\brather\s+than|\bno(?:\s+need)?)\s+"
    rf"(?:(?!forget|fail|hesitate|until|before|while|when|and|then|but)\w+\s+){{0,5}}?{_SIT}"
    r"(?!(?:\s+\w+){0,4}?\s+(?:until|before)\b)"
)


def category_of(instruction: str) -> str:
    """Return the target category that an instruction names first; empty if it names none.

    A thing that only says where another one is, or that is passed or left, is the target only if there is no other:
    "the tv behind the plant" means a tv.
    """
    words = re.sub(_SIT, " ", instruction.lower())  # Who takes a seat on the bed looks for no chair.
    return _named_in(_LANDMARK.sub(" ", words)) or _named_in(words)


def _named_in(words: str) -> str:
    first = re.search(rf"\b({_ALIAS})s?\b", words)
    return next((category for category, aliases in ALIASES.items() if first and first[1] in aliases), "")


def require_words(instruction: str) -> None:
    """Raise HumanclawError for an empty instruction."""
    if not instruction.strip():
        raise HumanclawError("the instruction is empty.", "Say what the body is to do: 'find a couch and sit on it'.")


def wants_to_sit(instruction: str) -> bool:
    """Tell whether an instruction asks to sit down: "do not sit" does not."""
    return bool(re.search(rf"\b{_SIT}", _REFUSED_SEAT.sub(" ", instruction.lower())))


def free_episode(instruction: str, scene: Scene, *, seed: int = 0, max_steps: int = 100, name: str = "") -> EpisodeSpec:
    """Return an episode for a free instruction in a scene. Without a target category it is not scored.

    Raises HumanclawError for an empty instruction.
    """
    require_words(instruction)
    category = category_of(instruction)
    return EpisodeSpec(
        id=name or f"free-{seed}",
        instruction=instruction,
        scene=scene.name,
        scene_digest=scene.digest,
        start=scene.start,
        target_category=category,
        target_ids=tuple(obj.id for obj in scene.of_category(category)) if category else (),
        interact=category in SEATS and wants_to_sit(instruction),
        max_steps=max_steps,
        seed=seed,
    )


def targeted(spec: EpisodeSpec, scene: Scene) -> EpisodeSpec:
    """Return an episode with its targets filled in: its category as the scene calls it, or that of its ids or its
    words, and without ids all objects of that category.

    An episode with a goal or a partner, or whose words name nothing, is returned as it is. Raises SceneError for ids
    and categories that the scene lacks, for ids or words of something else than the category, and for things to sit on
    that are no seats.
    """
    require_objects(spec, scene)
    owned = [scene.by_id[key].category for key in spec.target_ids[:1]]
    named = spec.target_category or category_of(spec.instruction)
    asked = spec.target_category or (owned or [named])[0]
    if not asked or spec.goal is not None or spec.partner is not None:
        return spec
    objects = scene.of_category(asked) or scene.of_category(category_of(asked))
    if not objects:
        here = ", ".join(sorted({obj.category for obj in scene.objects}))
        raise SceneError(f"episode {spec.id!r} looks for a {asked}; {scene.name} has none.", f"Choose from: {here}.")
    category = objects[0].category
    _require_agreement(spec, named, scene)
    _require_words_of(spec, asked)
    stated = spec.target_category or "interact" in spec.model_fields_set
    sits = spec.interact if stated else category in SEATS and wants_to_sit(spec.instruction)
    targets = spec.target_ids or tuple(obj.id for obj in objects)
    seats = [scene.assets[scene.by_id[key].asset].seat_height for key in targets]
    if sits and category not in SEATS and not any(seats):
        raise SceneError(f"episode {spec.id!r} asks to sit on a {category}, which is no seat.", "Leave out interact.")
    return spec.model_copy(update={"target_category": category, "target_ids": targets, "interact": sits})


def _require_agreement(spec: EpisodeSpec, named: str, scene: Scene) -> None:
    """Raise SceneError if a target is of another category than the episode names."""
    alike = {obj.id for word in (named, category_of(named)) for obj in scene.of_category(word)}
    for key in spec.target_ids:
        if named and key not in alike:
            category = scene.by_id[key].category
            message = f"episode {spec.id!r} names a {named}; its target {key} is a {category}."
            raise SceneError(message, "Mend target_ids, or say in target_category what they are.")


def _require_words_of(spec: EpisodeSpec, asked: str) -> None:
    """Raise SceneError if the words name another category and not this one, unless ids settle what is meant."""
    words, meant = spec.instruction.lower(), category_of(asked) or asked
    named = category_of(_LANDMARK.sub(" ", re.sub(r"\bseats?\b", " ", words)))  # A couch is a seat too.
    spoken = any(alias in words for alias in ALIASES.get(meant, (meant.replace("_", " "),)))
    if named and named != meant and not (spoken or spec.target_ids):
        message = f"episode {spec.id!r} asks for a {named} in {spec.instruction!r}; its target_category is {asked!r}."
        raise SceneError(message, "Mend one of them, or list the targets in target_ids: they decide.")


def require_objects(spec: EpisodeSpec, scene: Scene) -> None:
    """Raise SceneError for target ids that a scene lacks."""
    if absent := sorted(set(spec.target_ids) - set(scene.by_id)):
        raise SceneError(
            f"{scene.name} has no object {absent[0]}, a target of episode {spec.id!r}.",
            "Leave out target_ids: then all objects of target_category are targets.",
        )


def instruction(category: str) -> str:
    """Return the instruction for a target category, in the words of the paper (section 4.1)."""
    noun = ALIASES.get(category, (category.replace("_", " "),))[0]
    if category in SEATS:
        return f"find a {noun}, navigate to it with zero distance, and finally sit on it."
    return f"find a {noun} and navigate to it with zero distance."
