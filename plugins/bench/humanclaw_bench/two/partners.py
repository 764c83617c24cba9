"""The scripted partner of an episode: it stands, walks a way, or asks for a thing, as long as the episode lasts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import cycle
from threading import Event
from typing import Any, Final, Self

import numpy as np

from humanclaw import (
    Body,
    Call,
    Decision,
    Episode,
    EpisodeContext,
    EpisodeSpec,
    HistoryEntry,
    Observation,
    Skill,
)
from humanclaw.body import Array, Pose2D
from humanclaw.skills import Role, Side, find_suited
from humanclaw.storage import Folder
from humanclaw_bench.hands.generate import House

PARTNER: Final = "partner"
"""Name of the partner, of its episode, and of its folder in that of the episode."""
PACE: Final = 0.3
"""Metres of a step at most: 0.6 m/s, a stroll, so that whoever follows can catch up."""
ARRIVED: Final = 0.3
"""Metres from a corner of the way at which the partner makes for the next one."""
_TURN_FIRST: Final = 0.6
"""Turn above which the partner turns on the spot, radians."""
_MOST_STEPS: Final = 10_000
"""Of a partner: more than any episode has, so that it never ends first."""
WITHIN: Final = (0.35, 0.7, 1.5, 0.2, 0.65)
"""Where a thing is held out: at most so far aside, between two heights, and so far ahead of the hips, metres."""
_NEAR: Final = 2.0
"""Metres from which one who asks turns to the thing."""
_AHEAD: Final = math.radians(20)
"""Turn up to which something is ahead, radians: one that turned for less would never stand still."""
_FINGERS: Final = 0.04
"""Metres from the knuckles to the middle of the fingers."""
_SIDES: Final[tuple[Side, Side]] = ("right", "left")
HAND: Final = ("hand.left", "hand.up", "hand.ahead")


@dataclass
class Ending:
    """Tells the partner when the episode is over, and after how many frames of motion."""

    frames: int = 0
    whole: bool = False
    """Whether the episode came to its own end."""
    alone: bool = False
    """Whether the partner has left: whatever is played then is in vain."""
    _over: Event = field(default_factory=Event)

    def met(self, episode: Episode) -> bool:
        """Whether the partner may end: half a second after the episode, however the threads take turns."""
        return self._over.is_set() and sum(step.motion_frames for step in episode.steps) > self.frames

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()


class Walker:
    """Walks from corner to corner of a way, and stands at its end."""

    name = PARTNER
    privileged = True
    settings: Mapping[str, Any] = {}

    def __init__(self, way: Sequence[tuple[float, float]]) -> None:
        self._way = list(way)

    def begin(self, context: EpisodeContext) -> None:
        assert context.scene is not None
        assert context.state is not None
        self._context, self._scene, self._state = context, context.scene, context.state

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

    def _asking(self, amounts: Mapping[str, float], role: Role = "locomotion", side: str = "") -> Call:
        return find_suited(self._context.skills.values(), *amounts, role=role).call(amounts, side)


class Asker(Walker):
    """Asks for a thing, says where it is whenever it is spoken to, turns to it as it is brought, and takes it.

    Once that is held out, it tries again and again to bring a palm to it and to close the hand.
    """

    def __init__(self) -> None:
        super().__init__(())
        self._script = self._play()

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        return Decision((self._say(self._answer) if observation.feedback.heard else next(self._script),))

    def _play(self) -> Iterator[Call]:
        (self._thing,) = self._context.spec.target_ids
        house = House(self._scene)
        thing, (low, _) = self._scene.by_id[self._thing], house.height(self._thing)
        room = next((room.told for room in self._scene.rooms if room.name == thing.room), "this house")
        name = house.phrase(thing)
        self._answer = f"I want {name}. It was in {room}, {100 * low:.0f} cm above the floor."
        yield self._say(f"Please bring me {name}.")
        for side in cycle(_SIDES):
            while not self._is_held_out:
                yield self._asking({"heading.left": self._turn})
            yield from self._take(side)
            if self._thing in self._state().held.values():
                break
        yield self._say("Thank you.")
        while True:
            yield self._asking({"heading.left": 0.0})

    def _say(self, words: str) -> Call:
        skill = speaking(self._context.skills.values())
        assert skill is not None  # require_skills() has seen to it.
        return Call(skill.name, {"text": words})

    def _box(self) -> tuple[Array, Array]:
        """Return the corners (3,) of the thing's box in the partner's frame."""
        state = self._state()
        points = Pose2D.of(state.body).point_to_local(self._scene.vertices(self._thing, state.objects.get(self._thing)))
        return points.min(0), points.max(0)

    @property
    def _is_held_out(self) -> bool:
        left, up, ahead = np.mean(self._box(), axis=0)
        return bool(abs(left) < WITHIN[0] and WITHIN[1] < up < WITHIN[2] and WITHIN[3] < ahead < WITHIN[4])

    @property
    def _turn(self) -> float:
        """How far to turn to the thing, if it is near and not ahead, radians."""
        left, _, ahead = np.mean(self._box(), axis=0).tolist()
        bearing = math.atan2(left, ahead)
        return max(-1.0, min(1.0, bearing)) if math.hypot(left, ahead) < _NEAR and abs(bearing) > _AHEAD else 0.0

    def _take(self, side: Side) -> Iterator[Call]:
        """Bring a palm beside the thing from outside, and close the hand."""
        out = 1.0 if side == "left" else -1.0
        for aside in (0.12, 0.03):
            low, high = self._box()
            edge = float(high[0] if out > 0 else low[0])
            at = (edge + aside * out, float(low[1] + high[1]) / 2, float(low[2] + high[2]) / 2 - _FINGERS)
            yield self._asking(dict(zip(HAND, at, strict=True)), "gesture", side)
        yield self._asking({}, "grasp", side)


def speaking(skills: Iterable[Skill]) -> Skill | None:
    """Return a skill that says what it is told, and does not end the episode."""
    spoken = (skill for skill in skills if skill.role != "stop" and skill.schema.get("required") == ["text"])
    return next(spoken, None)


def _stop(skills: Iterable[Skill]) -> Call | None:
    """Return the call that ends an episode; None if no skill does without an answer."""
    stops = (skill for skill in skills if skill.role == "stop" and not skill.schema.get("required"))
    return next((Call(skill.name) for skill in stops), None)


def part_of(spec: EpisodeSpec) -> EpisodeSpec:
    """Return the partner's part in an episode that has one, as an episode of its own."""
    assert spec.partner is not None
    return EpisodeSpec(
        id=PARTNER, instruction=f"{spec.partner.task}, as the partner", scene=spec.scene,
        scene_digest=spec.scene_digest, start=spec.partner.start, target_ids=spec.target_ids, max_steps=_MOST_STEPS,
        seed=spec.seed,
    )  # fmt: skip


def company_of(spec: EpisodeSpec) -> tuple[str, str]:
    """Return the names of the two records of an episode with a partner, from where they lie."""
    return spec.id, f"{spec.id}/{PARTNER}"


def accompany(spec: EpisodeSpec, folder: Folder, ending: Ending, body: Body) -> None:
    """Play the partner of an episode in a body until the ending is met."""
    assert spec.partner is not None
    part, company = part_of(spec), company_of(spec)
    agent = Asker() if spec.partner.task == "give" else Walker(spec.partner.way)
    try:
        with Episode(body, part, agent, folder=folder, company=company) as episode:
            while not (episode.done or ending.met(episode)):
                episode.ask()
            if ending.whole and not episode.done and (stop := _stop(body.skills.values())):
                episode.submit(Decision((stop,)))  # Its part is played, too.
        if episode.fault:  # What a broken partner lets fail is no failure of the agent's.
            raise episode.fault
    finally:
        ending.alone = True
