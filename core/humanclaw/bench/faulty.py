"""Decision makers that fail in known ways, and a verifier that knows better: what ablations and root causes are checked with.

Each is the oracle with something put in the way of it, so that whatever goes wrong is due to that alone. None of it speaks for
any model: it shows that the harness and the benchmark respond to a fault as they should.

Two kinds. A `fault` takes one faculty away, for every episode or for one drawn at random (`any`): root causes are to find it.
A `Bounded` mind keeps the faculties, but its memory, its attention and its sense of distance have limits, which the settings of
the harness (history, images, mid_level, a verifier) widen or narrow: the ablations of the paper's table 3 are to show.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from humanclaw.bench.agents import OracleAgent, ending
from humanclaw.bench.metrics import REACHED, acknowledges
from humanclaw.contract import Skill
from humanclaw.errors import HumanclawError
from humanclaw.geometry import distance_to_nearest
from humanclaw.interfaces import Answer as CheckAnswer
from humanclaw.interfaces import Call, Decision, EpisodeContext, Observation, Past, Verdict, WorldState
from humanclaw.pose import Frame

SITTING: Final = ("sit_in_place", "step_back")
"""Skills of the sitting routine, in which the body has its back to the seat."""
AT_HAND: Final = 1.5
"""Metres from the target within which the sitting routine takes place."""
LOOK_AROUND: Final = 45
"""Degrees that a searching body turns each step."""


# -- what every one of them can tell -------------------------------------------------------------------------------------
@dataclass
class Senses:
    """The true state of an episode, for those who are allowed to know it."""

    context: EpisodeContext

    def __post_init__(self) -> None:
        if self.context.scene is None or self.context.state is None:
            raise HumanclawError("a scripted decider needs the scene and the state.", "Run it through the loop.")
        self._scene, self._state = self.context.scene, self.context.state

    def state(self) -> WorldState:
        return self._state()

    def boxes(self) -> list[tuple[Any, Any]]:
        return [self._scene.aabb(key) for key in self.context.spec.target_ids]

    def reach(self) -> float:
        """From the nearest body point to the nearest target's bounding box, metres."""
        return distance_to_nearest(self._state().body.joints()[-1], self.boxes())

    def away(self) -> float:
        """From the pelvis to the nearest target over the floor, metres."""
        here = self._state().body.root[-1, [0, 2]]
        return distance_to_nearest(here, [(low[[0, 2]], high[[0, 2]]) for low, high in self.boxes()])

    def bearing(self) -> float:
        """Of the nearest target's middle, radians, left positive; 0 without a target."""
        body = self._state().body
        here = Frame(float(body.root[-1, 0]), float(body.root[-1, 2]), float(body.yaw()[-1]))
        middles = [here.point_to_local(np.array([*((low + high) / 2)])) for low, high in self.boxes()]
        nearest = min(middles, key=lambda point: float(np.hypot(point[0], point[2])), default=None)
        return 0.0 if nearest is None else float(np.arctan2(nearest[0], nearest[2]))


# -- faults ------------------------------------------------------------------------------------------------------------
@dataclass
class Moment:
    """What a fault may look at and alter: the oracle's decision, and a note pad of its own that lasts for the episode."""

    senses: Senses
    decision: Decision
    step: int
    seen: bool
    stop: str
    """Name of the skill that ends the episode."""
    begun: float
    """Distance to the nearest target at the start, metres."""
    notes: dict[str, int] = field(default_factory=dict)

    @property
    def stopping(self) -> bool:
        return self.decision.calls[0].skill == self.stop

    def but(self, skill: str, why: str, **params: int) -> Decision:
        """The same perception, another call."""
        return replace(self.decision, calls=(Call(skill, params),), reasoning=why)

    def count(self, what: str) -> int:
        """How often this was asked before."""
        self.notes[what] = self.notes.get(what, 0) + 1
        return self.notes[what] - 1


@dataclass(frozen=True)
class Fault:
    """A faculty that is missing. apply: the decision it leads to. seated: whether only sitting tasks show it.

    standing: the oracle behind it only walks up to the target, and the fault does the rest.
    """

    faculty: str
    apply: Callable[[Moment], Decision]
    meaning: str
    seated: bool = False
    standing: bool = False


def _blind(at: Moment) -> Decision:
    return replace(at.decision, visible_state="I am in a room.")


def _misjudges(at: Moment) -> Decision:
    if at.seen and 3 * REACHED < at.senses.away() < 3.0:
        return at.but(at.stop, "It looks close enough to touch, so I stop.")
    return at.decision


def _overlooks_arrival(at: Moment) -> Decision:
    if at.stopping or "arrived" in at.notes:
        side = 1 if at.count("arrived") % 2 else -1
        return at.but("turn_in_place", "I am not there yet and look where to go on.", yaw_deg=10 * side)
    return at.decision


def _overlooks_jam(at: Moment) -> Decision:
    if at.stopping:
        return at.decision
    angle = at.senses.bearing()
    if abs(angle) > np.radians(28):
        return at.but("turn_in_place", "It lies over there: I turn to it.", yaw_deg=_degrees(angle, 75))
    return at.but("walk", "It lies straight ahead: I walk on.", x_cm=0, z_cm=50, yaw_deg=_degrees(angle, 20))


def _wavers(at: Moment) -> Decision:
    if at.seen or "seen" in at.notes:
        side = 1 if at.count("seen") % 2 else -1
        return at.but("turn_in_place", "A little more this way.", yaw_deg=8 * side)
    return at.decision


def _turns_away(at: Moment) -> Decision:
    """Once half the way is done and the target was in view: back to where it came from."""
    if "gone" not in at.notes and not (at.seen and at.senses.away() < 0.5 * at.begun):
        return at.decision
    turns = at.count("gone")
    away = replace(at.decision, visible_state="I am in a room.")
    call = Call("turn_in_place", {"yaw_deg": 60}) if turns < 3 else Call("walk", {"x_cm": 0, "z_cm": 30, "yaw_deg": 0})
    return replace(away, calls=(call,), reasoning="There may be a better one elsewhere.")


def _imagines(at: Moment) -> Decision:
    gone = _turns_away(at)
    if "gone" not in at.notes:
        return gone
    noun = at.senses.context.spec.target_category.replace("_", " ")
    return replace(gone, visible_state=f"A {noun} is right in front of me.")


def _never_sits(at: Moment) -> Decision:
    return at.decision


def _sits_on_air(at: Moment) -> Decision:
    """Faces the seat and sits where it stands."""
    if at.stopping and not at.count("sat"):
        return at.but("sit_in_place", "I am at the seat: I sit down.", h_cm=50)
    return at.decision


def _rises(at: Moment) -> Decision:
    if at.stopping and not at.count("risen"):
        return at.but("walk", "I straighten up.", x_cm=0, z_cm=5, yaw_deg=0)
    if "risen" in at.notes:
        return at.but(at.stop, "The task is complete.")
    return at.decision


FAULTS: Final[Mapping[str, Fault]] = {
    "blindness": Fault("perception", _blind, "the target is in view and it does not say so"),
    "distance": Fault("ego-spatial distance", _misjudges, "stops as soon as the target is in view and within 3 m"),
    "arrival": Fault("body awareness", _overlooks_arrival, "does not notice that it has arrived, and never stops"),
    "jam": Fault("body awareness", _overlooks_jam, "walks straight at the target, whatever stands in between"),
    "wavering": Fault("action", _wavers, "turns to and fro once it sees the target"),
    "forgetting": Fault("mid-level reasoning", _turns_away, "turns back half-way"),
    "imagination": Fault("perception", _imagines, "turns back half-way and says that the target is before it"),
    "sitting": Fault("decision", _never_sits, "stops at the seat", seated=True, standing=True),
    "seat": Fault("body awareness", _sits_on_air, "sits down facing the seat", seated=True, standing=True),
    "rising": Fault("body awareness", _rises, "gets up again before it stops", seated=True),
}
"""By the name under which `--option fault=NAME` asks for them."""


def _degrees(angle: float, most: int) -> int:
    return int(np.clip(round(np.degrees(angle)), -most, most))


class Options(BaseModel):
    """Of `--agent faulty`. history, images and mid_level mean what they mean for a model."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    profile: str = "default"
    fault: str = "none"
    """A name of FAULTS, `any` for one drawn for each episode, `none`."""
    repair: str = ""
    """A faculty whose faults are put right: the check of a root cause."""
    history: int = Field(10, ge=0)
    images: int = Field(1, ge=1)
    mid_level: bool = True
    bounded: bool = False
    """Whether memory, attention and the sense of distance have limits."""
    misjudged: float = Field(0.2, ge=0, le=1)
    """How often, within 4 m of a target in view, a bounded mind takes it to be within reach."""
    confusion: float = Field(0.1, ge=0)
    """How strongly each further picture competes with the current one for a bounded mind's attention."""
    miss: float = Field(0.0, ge=0, le=1)
    """Of the verifier `oracle`: how often it lets pass what it should reject."""


def options(given: Mapping[str, Any]) -> Options:
    """Checked options. Raises HumanclawError that says which is wrong."""
    try:
        read = Options(**given)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "options"
        raise HumanclawError(
            f"--option {where}: {first['msg']}.", f"The options are {', '.join(Options.model_fields)}."
        ) from None
    if read.fault not in {*FAULTS, "any", "none"}:
        raise HumanclawError(f"there is no fault {read.fault!r}.", f"Choose from: {', '.join(FAULTS)}, any, none.")
    return read


class FaultyAgent:
    """The oracle with one faculty missing, or with a bounded mind, or both."""

    name = "faulty"
    privileged = True

    def __init__(self, given: Options) -> None:
        self.options = given
        self.settings = given.model_dump()

    def begin(self, context: EpisodeContext) -> None:
        self._senses = Senses(context)
        self._begun = self._senses.away()
        self._stop = ending(context.skills)
        self._fault = self._drawn(context)
        spec = context.spec
        if self._fault and self._fault.standing:
            spec = spec.model_copy(update={"interact": False})
        self._oracle = OracleAgent()
        self._oracle.begin(replace(context, spec=spec))
        self._notes: dict[str, int] = {}
        self._mind = Mind(self.options, self._senses, self._stop)

    def _drawn(self, context: EpisodeContext) -> Fault | None:
        """The fault of this episode: by the episode's seed, among those that its task can show."""
        fitting = [name for name, fault in FAULTS.items() if context.spec.interact or not fault.seated]
        name = self.options.fault
        if name == "any":
            name = fitting[int(np.random.default_rng([context.seed, 77]).integers(len(fitting)))]
        fault = FAULTS[name] if name in fitting else None
        return None if fault is None or fault.faculty == self.options.repair else fault

    def decide(self, observation: Observation, history: Sequence[Past]) -> Decision:
        decision = self._oracle.decide(observation, history)
        seen = acknowledges(decision.visible_state, self._senses.context.spec.target_category)
        if self._fault:
            moment = Moment(self._senses, decision, observation.step, seen, self._stop, self._begun, self._notes)
            decision = self._fault.apply(moment)
        return self._mind.think(decision, observation.step, seen, history) if self.options.bounded else decision


# -- a bounded mind ----------------------------------------------------------------------------------------------------
@dataclass
class Mind:
    """Decides as the oracle would, as long as it still knows what the oracle knows.

    Memory: where a target is that is out of view it knows for as many steps as the history reaches back; after that it looks
    around. Commitment: to turn one's back on a seat and sit down is a plan of several steps, which only a mid-level goal holds
    together; without one it is content to stand before the seat. Attention: among n pictures it may take an old one for the
    current one, and repeat what it did then. Distance: a target that is in view within 4 m may seem to be within reach.
    """

    options: Options
    senses: Senses
    stop: str
    last_seen: int = -1_000_000
    ever_seen: bool = False

    def think(self, decision: Decision, step: int, seen: bool, history: Sequence[Past]) -> Decision:
        if seen:
            self.last_seen, self.ever_seen = step, True
        rng = np.random.default_rng([self.senses.context.seed, step, 78])
        draws = rng.random(3)
        old = self._mistaken_for(draws[:2], history)
        if old is not None:
            return replace(decision, calls=(old,), reasoning="The view is as it was: I do the same again.")
        if seen and 3 * REACHED < self.senses.away() < 4.0 and draws[2] < self.options.misjudged:
            return replace(decision, calls=(Call(self.stop),), reasoning="It looks close enough to touch, so I stop.")
        if self.ever_seen and step - self.last_seen > self.options.history:
            around = Call("turn_in_place", {"yaw_deg": LOOK_AROUND})
            return replace(decision, calls=(around,), reasoning="I do not know where it is: I look around.")
        if not self.options.mid_level and self._in_routine(decision.calls[0]):
            return replace(decision, calls=(Call(self.stop),), reasoning="I stand before it, so I am done.")
        return decision

    def _mistaken_for(self, draws: Any, history: Sequence[Past]) -> Call | None:
        """The call of an older view that was taken for the current one."""
        others = min(self.options.images - 1, len(history))
        competing = self.options.confusion * others
        if not others or draws[0] >= competing / (1 + competing):
            return None
        return history[-1 - int(draws[1] * others)].executed

    def _in_routine(self, call: Call) -> bool:
        return (
            self.senses.context.spec.interact
            and self.ever_seen
            and self.senses.away() < AT_HAND
            and (call.skill in SITTING or (call.skill == "turn_in_place" and self.senses.reach() < 2 * REACHED))
        )


# -- a verifier --------------------------------------------------------------------------------------------------------
class OracleVerifier:
    """Rejects a stop out of reach of the target, and a stop of a sitting task that is not seated; puts the oracle's call there.

    Its option `miss` says how often it lets such a call pass all the same.
    """

    name = "oracle"
    privileged = True

    def __init__(self, given: Mapping[str, Any]) -> None:
        self._miss = float(given.get("miss", 0.0))
        self.settings = {"miss": self._miss}

    def begin(self, context: EpisodeContext) -> None:
        self._senses = Senses(context)
        self._oracle = OracleAgent()
        self._oracle.begin(context)
        self._history: list[Past] = []

    def verify(self, observation: Observation, call: Call, skill: Skill, goal: str) -> Verdict:
        advice = self._oracle.decide(observation, self._history)
        lets_pass = np.random.default_rng([self._senses.context.seed, observation.step, 79]).random() < self._miss
        accepted = not skill.ends_episode or self._senses.reach() <= REACHED or lets_pass
        done = call if accepted else advice.calls[0]
        self._history.append(Past(observation.step, advice, done, "", observation.rgb))
        answer = CheckAnswer("within_reach", accepted, "" if accepted else "The target is not within reach.")
        return Verdict(accepted, None if accepted else done, (answer,))
