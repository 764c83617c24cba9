"""What the body touches and moves in an episode: collisions, and disturbed objects."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from humanclaw import RecordedEpisode, StepRecord
from humanclaw.body import BODY_GROUPS, FUTURE, Array
from humanclaw.records import touched_above_ground

MOVES: Final = 0.001
"""Smallest movement per frame that counts as moving, metres. Less is jitter of the physics."""
DISPLACED: Final = 0.01
"""Smallest displacement of an object that counts, metres; the paper gives none."""


def collisions(recorded: RecordedEpisode) -> dict[str, float]:
    """Return the share of half seconds of motion in which the body touches an object above the ground (Coll.).

    Keys: 'any', the body groups, and 'fixed' for objects that do not move; 'person' is the share in which it touches
    another body, which is no object: NaN if it is alone. A foot on stairs or on an upper floor stands on the ground
    (the paper's houses have one level). NaN without motion.
    """
    hit = [groups for step in recorded.steps for groups in _hit(recorded, step)]
    count = len(hit) or float("nan")
    shares = {group: sum(group in groups for groups in hit) / count for group in (*BODY_GROUPS, "fixed", "person")}
    alone = {} if recorded.record.company else {"person": float("nan")}
    return {"any": sum(bool(groups - {"person"}) for groups in hit) / count} | shares | alone


def _hit(recorded: RecordedEpisode, step: StepRecord) -> Iterator[set[str]]:
    """Yield for each chunk of a step the body groups that touch an object above the ground, 'fixed' if one of the
    objects is, and 'person' if the body touches another one."""
    touched = touched_above_ground(recorded, step)
    people = [contact for contact in step.contacts if contact.person]
    for chunk in range(step.chunks):
        met = [contact for contact in (*touched, *people) if any(frame // FUTURE == chunk for frame in contact.frames)]
        objects = [contact for contact in met if not contact.person]
        groups = {contact.group for contact in objects} | {"fixed" for contact in objects if not contact.movable}
        yield groups | ({"person"} if len(objects) < len(met) else set())


def disturbed(recorded: RecordedEpisode, moved: Mapping[int, Array]) -> dict[int, int]:
    """Return the objects touched by the body, or later by a disturbed object.

    moved: object paths of the record. Returns the first frame of the disturbance by object id, as motion() counts them.
    """
    movable = set(recorded.record.movable) | set(moved)
    hits: dict[int, set[int]] = defaultdict(set)
    pairs: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for step, (first, _) in zip(recorded.steps, recorded.spans, strict=True):
        for contact in step.contacts:
            if contact.movable:
                movable.add(contact.object_id)
                for frame in contact.frames:
                    hits[first + frame].add(contact.object_id)
        for frame, a, b in step.touches:
            pairs[first + frame].append((a, b))
    since: dict[int, int] = {}
    for frame in sorted(hits.keys() | pairs.keys()):
        since = dict.fromkeys(_reached(hits[frame] | since.keys(), pairs[frame], movable), frame) | since
    return since


def _reached(sources: set[int], pairs: Sequence[tuple[int, int]], movable: set[int]) -> set[int]:
    """Return the movable objects that contacts of one frame link to a source. Fixed objects pass nothing on."""
    links = [set(pair) for pair in pairs if set(pair) <= movable]
    reached, grown = set(sources), True
    while grown:
        more = set().union(*(link for link in links if link & reached)) - reached
        reached, grown = reached | more, bool(more)
    return reached


def displacements(since: Mapping[int, int], moved: Mapping[int, Array]) -> list[float]:
    """Return how far each displaced object lies at the end from where it was when it was disturbed, metres (#Dtb,
    dDtb).

    An object is displaced from DISPLACED on. since: as disturbed() returns it.
    """
    ways = [moved[key][-1, :3] - moved[key][max(first - 1, 0), :3] for key, first in since.items() if key in moved]
    return [length for way in ways if (length := float(np.linalg.norm(way))) >= DISPLACED]


def disturbed_path(since: Mapping[int, int], moved: Mapping[int, Array]) -> float:
    """Return the total path length of disturbed objects, metres.

    Each path begins with the first frame after the disturbance in which the object moves.
    """
    pieces = [moved[key][max(first - 1, 0) :, :3] for key, first in since.items() if key in moved]
    ways = [np.linalg.norm(np.diff(piece, axis=0), axis=1) for piece in pieces]
    return float(sum(way[int(np.argmax(way > MOVES)) :].sum() for way in ways if (way > MOVES).any()))
