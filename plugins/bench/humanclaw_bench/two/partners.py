"""The scripted partner of an episode: it stands, or walks a way, as long as the episode lasts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from threading import Event
from typing import Any, Final, Self

import numpy as np

from humanclaw import Body, Call, Decision, Episode, EpisodeContext, EpisodeSpec, HistoryEntry, Observation
from humanclaw.body import Pose2D
from humanclaw.skills import find_suited
from humanclaw.storage import Folder

PARTNER: Final = "partner"
"""Name of the partner, of its episode, and of its folder in that of the episode."""
PACE: Final = 0.3
"""Metres of a step at most: 0.6 m/s, a stroll, so that whoever follows can catch up."""
ARRIVED: Final = 0.3
"""Metres from a corner of the way at which the partner makes for the next one."""
_TURN_FIRST: Final = 0.6
"""Turn above which the partner turns on the spot, radians."""
_MOST_STEPS: Final = 10_000


@dataclass
class Ending:
    """Tells the partner when the episode is over, and after how many frames of motion."""

    frames: int = 0
    _over: Event = field(default_factory=Event)

    def met(self, episode: Episode) -> bool:
        """Whether the partner may end: half a second after the episode, however the threads take turns."""
        return self._over.is_set() and sum(step.motion_frames for step in episode.steps) > self.frames

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()


class Partner:
    """Walks from corner to corner of a way, and stands at its end."""

    name = PARTNER
    privileged = True
    settings: Mapping[str, Any] = {}

    def __init__(self, way: Sequence[tuple[float, float]]) -> None:
        self._way = list(way)

    def begin(self, context: EpisodeContext) -> None:
        assert context.state is not None
        self._context, self._state = context, context.state

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        here = Pose2D.of(self._state().body)
        while self._way and math.dist(self._way[0], (here.x, here.z)) <= ARRIVED:
            self._way.pop(0)
        return Decision((self._call(here),))

    def _call(self, here: Pose2D) -> Call:
        if not self._way:
            return self._asking({"heading.left": 0.0})
        x, z = self._way[0]
        left, _, ahead = here.point_to_local(np.array([x, here.floor, z])).tolist()
        turn = math.atan2(left, ahead)
        if abs(turn) > _TURN_FIRST:
            return self._asking({"heading.left": max(-1.0, min(1.0, turn))})
        return self._asking({"hips.forward": min(PACE, math.hypot(left, ahead)), "heading.left": turn / 2})

    def _asking(self, amounts: Mapping[str, float]) -> Call:
        skill = find_suited(self._context.skills.values(), *amounts)
        return Call(skill.name, skill.commanding(amounts))


def accompany(spec: EpisodeSpec, folder: Folder, ending: Ending, body: Body) -> None:
    """Play the partner of an episode in a body until the ending is met."""
    assert spec.partner is not None
    part = EpisodeSpec(
        id=PARTNER, instruction=f"{spec.partner.task}, as the partner", scene=spec.scene,
        scene_digest=spec.scene_digest, start=spec.partner.start, max_steps=_MOST_STEPS, seed=spec.seed,
    )  # fmt: skip
    with Episode(body, part, Partner(spec.partner.way), folder=folder) as episode:
        while not (episode.done or ending.met(episode)):
            episode.ask()
