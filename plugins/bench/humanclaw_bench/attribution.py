"""Find the root cause of a failed episode: the first of the 18 rules of the paper's appendix B that matches.

All facts come from the record. Two of the paper's quantities are made exact:

* "Within 0.2 m" uses the distance of NavSR, from the nearest point of the body. The pelvis of a body that stands at a
  low bed is never that near.
* The last frame is the last view from which a decision was made, together with the agent's answer.

The order hides causes: a failure has second labels for the other rules that describe it, and for causes that the
paper does not name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from humanclaw import EpisodeRecord, RecordedEpisode, StepRecord
from humanclaw.body import Array
from humanclaw.records import REACHED, in_view
from humanclaw.skills import to_si
from humanclaw_bench.failure_modes import Cause, Rule, Stage, first_cause
from humanclaw_bench.hands.scores import cause_of, first_failed
from humanclaw_bench.path_metrics import gap_to, straight
from humanclaw_bench.scores import Scores, claims, is_sit, sat_down, score
from humanclaw_bench.two import scores as two

STAGES: Final[tuple[Stage, ...]] = ("find", "nav", "interact")

# Thresholds of the rules, in metres or steps: the paper's (its table of error types), but for JAMMED_BOX. Eight calls
# below 10 cm found 1 of 36 bodies that walk against things, since they rock by up to 30 cm; within 50 cm, 20.
NEAR: Final = 1.5
TOO_FAR: Final = 20.0
JAMMED_STEPS: Final = 8
JAMMED_MOVE: Final = 0.1
JAMMED_BOX: Final = 0.5
CONFINED_STEPS: Final = 25
CONFINED_BOX: Final = 2.0
GIVEN_UP: Final = (0.5, 0.6)
"""Shares of the first distance: the body came nearer than the first, and ended farther away than the second."""
TOO_LATE: Final = 0.7
"""Share of the maximum steps after which a first sight of the target is too late."""
_MOVES: Final = ("hips.left", "hips.forward", "hips.back")
_TURNS: Final = ("heading.left",)
_PELVIS: Final = ("pelvis",)
_THIGHS: Final = ("left_hip", "right_hip")


# -- features ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class EpisodeFeatures:
    """The facts of an episode that the rules use."""

    seen: bool
    """Whether a view showed enough of the target."""
    late: bool
    """Whether the first such view came too late."""
    unreachable: bool
    """Whether the steps after it could not cover the way, at the fastest step of the episode."""
    way: tuple[float, ...]
    """Remaining distance to the nearest target at the start and after each step, metres."""
    arrived: bool
    stopped: bool
    jammed: bool
    confined: bool
    seen_last: bool
    claimed_last: bool
    sits: bool
    sat: bool
    """Whether a sit ended on the target."""
    roamed: bool
    """Whether the last 25 steps, or all of fewer, left a box of 2 m."""
    turned: bool
    """Whether the body ended near a seat, with its back to it or after a sit."""
    touched: bool
    """Whether the pelvis ever touched anything, or a thigh did during a sit: thighs carry a body on an armrest."""

    @classmethod
    def of(cls, recorded: RecordedEpisode) -> EpisodeFeatures:
        record, steps = recorded.record, recorded.steps
        first = next((step.step for step in steps if in_view(step)), None)
        return cls(
            seen=first is not None,
            late=first is not None and first >= round(TOO_LATE * record.spec.max_steps),
            unreachable=first is not None and _way(record, steps)[first] > _reach(record, steps, first),
            way=_way(record, steps),
            arrived=any(s.target_distance is not None and s.target_distance <= REACHED for s in steps),
            stopped=record.outcome == "stopped",
            jammed=_jam(recorded) is not None,
            confined=_confinement(recorded) is not None,
            seen_last=bool(steps) and in_view(steps[-1]),
            claimed_last=bool(steps) and claims(steps[-1], record.spec.target_category),
            sits=any(is_sit(recorded, step) for step in steps),
            sat=sat_down(recorded),
            roamed=bool(steps) and _extent(steps[-CONFINED_STEPS:]) > CONFINED_BOX,
            turned=_turned(recorded),
            touched=any(s.pelvis_contacts or _touches(s, _PELVIS) for s in steps)
            or any(_touches(s, _THIGHS) for s in steps if is_sit(recorded, s)),
        )


def _way(record: EpisodeRecord, steps: Sequence[StepRecord]) -> tuple[float, ...]:
    """Return the remaining distances: geodesic if recorded, else straight over the floor, which is never longer."""
    floor = record.start.floor
    begin = (
        record.geodesic
        if record.geodesic is not None
        else straight(record.targets, (record.start.x, floor, record.start.z))
    )
    rest = (
        step.geodesic if step.geodesic is not None else straight(step.targets or record.targets, step.end)
        for step in steps
    )
    return (begin, *rest)


def _reach(record: EpisodeRecord, steps: Sequence[StepRecord], first: int) -> float:
    """Return how far the body could have come from a step on, at the fastest step of the episode, metres."""
    return (record.spec.max_steps - first) * max(map(_moved, steps))


def _asks(record: EpisodeRecord, step: StepRecord, measures: Sequence[str]) -> float | None:
    """Return how much of these measures a locomotion call commands, in SI units; None for any other step.

    A locomotion skill without a parameter for distance or turn counts as infinity: a jam would prevent it too.
    """
    info = record.skills.get(step.call.skill) if step.call else None
    if step.call is None or info is None or info.role != "locomotion":
        return None
    if not set(info.commands.values()) & {*_MOVES, *_TURNS}:
        return float("inf")
    keys = [key for key, measure in info.commands.items() if measure in measures]
    return float(np.linalg.norm([to_si(key, step.call.params.get(key, 0)) for key in keys]))


def _walks(record: EpisodeRecord, step: StepRecord) -> bool:
    """Return whether a step commands locomotion of at least JAMMED_MOVE: the rule must not call a pause a jam."""
    asked = _asks(record, step, _MOVES)
    # Centimetres turned into metres may fall short of .1 by a rounding.
    return asked is not None and asked >= JAMMED_MOVE - 1e-9


def _acts(record: EpisodeRecord, step: StepRecord) -> bool:
    return bool(_asks(record, step, (*_MOVES, *_TURNS)))


def _jam(recorded: RecordedEpisode) -> int | None:
    """Return the first of eight locomotion commands in a row in which the body was jammed, by one of two rules:

    * Each moved the body by less than 0.1 m. This is the paper's rule.
    * The body touched something other than the ground in each, and stayed in a box of 0.5 m. Bodies here rock by up to
      0.3 m per call against an obstacle, and are jammed all the same.
    """
    record, steps = recorded.record, recorded.steps
    walks = [_walks(record, step) for step in steps]
    still = [_moved(step) < JAMMED_MOVE for step in steps]
    held = [any(contact.object_id not in record.ground for contact in step.contacts) for step in steps]
    jams = (
        window.start for window in _windows(JAMMED_STEPS, len(steps))
        if all(walks[window]) and (all(still[window]) or (all(held[window]) and _extent(steps[window]) <= JAMMED_BOX))
    )  # fmt: skip
    return next(jams, None)


def _touches(step: StepRecord, joints: Sequence[str]) -> bool:
    return any(contact.joint in joints for contact in step.contacts)


def _moved(step: StepRecord) -> float:
    return float(np.linalg.norm(np.subtract(step.end, step.start)))


def _confinement(recorded: RecordedEpisode) -> int | None:
    """Return the first of 25 movement or turning commands in a row that stayed within a box of 2 m."""
    steps = recorded.steps
    acts = [_acts(recorded.record, step) for step in steps]
    windows = _windows(CONFINED_STEPS, len(steps))
    return next((w.start for w in windows if all(acts[w]) and _extent(steps[w]) <= CONFINED_BOX), None)


def _turned(recorded: RecordedEpisode) -> bool:
    """Return whether the body ended within NEAR of a target to sit on, with its back to it or after a sit."""
    record, steps = recorded.record, recorded.steps
    if not (record.spec.interact and steps):
        return False
    last = steps[-1]
    gap = gap_to(last.targets or record.targets, last.end)
    if float(np.linalg.norm(gap)) > NEAR:
        return False  # Far away, or infinitely far where there is no target: an infinite gap has no direction.
    back = float(gap @ (np.sin(last.yaw_end), np.cos(last.yaw_end))) < 0
    return back or any(is_sit(recorded, step) for step in steps)


def _windows(length: int, steps: int) -> Iterator[slice]:
    """Return all windows of a length in a number of steps."""
    return (slice(start, start + length) for start in range(steps - length + 1))


def _extent(steps: Sequence[StepRecord]) -> float:
    """Return the longer side of the floor-aligned box around the positions of the pelvis, metres."""
    places: Array = np.array([point for step in steps for point in (step.start, step.end)])[:, [0, 2]]
    return float(np.ptp(places, axis=0).max())


# -- the step at which a cause was decided -----------------------------------------------------------------------------
def _first(condition: Callable[[RecordedEpisode, StepRecord], bool]) -> Callable[[RecordedEpisode], int | None]:
    return lambda recorded: next((k for k, step in enumerate(recorded.steps) if condition(recorded, step)), None)


def _nearest(recorded: RecordedEpisode) -> int | None:
    """Return the step that ended nearest to the target."""
    return int(np.argmin(_way(recorded.record, recorded.steps)[1:])) if recorded.steps else None


_first_view = _first(lambda _, step: in_view(step))
_first_sit = _first(is_sit)
_arrival = _first(lambda _, step: step.target_distance is not None and step.target_distance <= REACHED)


# -- the rules ---------------------------------------------------------------------------------------------------------
def _gave_up(features: EpisodeFeatures) -> bool:
    nearer, farther = GIVEN_UP
    return min(features.way) < nearer * features.way[0] and features.way[-1] > farther * features.way[0] + 1e-9


CAUSES: Final[tuple[Rule[EpisodeFeatures], ...]] = (
    Rule("find", "target in view but not seen", "perception", lambda f: f.seen,
         "the target was in view and the agent never said so", step=_first_view),
    Rule("find", "near but not in view", "mid-level reasoning", lambda f: not f.seen and min(f.way) < NEAR,
         "the body came within 1.5 m and never looked at the target", step=_nearest),
    Rule("find", "too far", "task", lambda f: f.way[0] > TOO_FAR, "the way to the target is longer than 20 m",
         step=lambda recorded: None),
    Rule("find", "unaware jammed", "body awareness", lambda f: f.jammed,
         "in eight walking calls in a row the body hardly moved, or rocked against something within 50 cm",
         step=_jam),
    Rule("find", "ineffective actions", "action", lambda f: f.confined,
         "25 moving or turning calls in a row stayed within a box of 2 m", step=_confinement),
    Rule("find", "midpoint give up", "mid-level reasoning", _gave_up,
         "the way was more than halved, and then the body went back", step=_nearest),
    Rule("find", "ineffective exploration", "mid-level reasoning", lambda f: True, "the target never came into view",
         second=lambda f: f.roamed and not f.seen),
    Rule("nav", "unaware arrived/touch", "body awareness", lambda f: f.arrived and not f.stopped,
         "the body was within 0.2 m and the agent never stopped", step=_arrival),
    Rule("nav", "stop while far", "ego-spatial distance", lambda f: f.stopped and not f.arrived,
         "the agent stopped and was never within 0.2 m"),
    Rule("nav", "find too late", "mid-level reasoning", lambda f: f.late,
         "the target first came into view in the last 30 % of the steps", step=_first_view),
    Rule("nav", "unaware jammed", "body awareness", lambda f: f.seen_last and f.jammed,
         "the target was in view at the end and the body was stuck for eight walking calls in a row", step=_jam),
    Rule("nav", "ineffective actions", "action", lambda f: f.seen_last,
         "the target was in view at the end and the body, though free, did not get there",
         second=lambda f: f.seen_last and not (f.jammed or f.stopped or f.arrived)),
    Rule("nav", "target hallucination", "perception", lambda f: f.claimed_last,
         "the target was out of view at the end and the agent said it saw it",
         second=lambda f: f.claimed_last and not f.seen_last),
    Rule("nav", "lost target", "mid-level reasoning", lambda f: True,
         "the agent turned away from the target and did not find it again",
         second=lambda f: not (f.seen_last or f.claimed_last or f.turned)),
    Rule("interact", "stand after sit", "body awareness", lambda f: f.sat,
         "a sit reached the seat, and the body was off it at the end"),
    Rule("interact", "sit on air", "body awareness", lambda f: f.sits and not f.touched,
         "the agent sat down, and neither hips nor thighs came to rest on anything", step=_first_sit),
    Rule("interact", "sit wrong", "body awareness", lambda f: f.sits,
         "the agent sat down on something else, or beside the seat",
         second=lambda f: f.sits and f.touched and not f.sat, step=_first_sit),
    Rule("interact", "stop but never sit", "decision", lambda f: True,
         "the agent stopped at the seat and never sat down", second=lambda f: not f.sits),
)  # fmt: skip
"""The paper's root causes, in the order in which their rules are tried within each stage."""
FURTHER: Final[tuple[Rule[EpisodeFeatures], ...]] = (
    Rule("nav", "too late to reach", "mid-level reasoning", lambda f: f.unreachable,
         "after the first view of the target too few steps were left for the way, at the body's fastest"),
    Rule("nav", "turned to sit", "body awareness", lambda f: f.turned and not f.seen_last,
         "the body ended within 1.5 m of the seat, with its back to it or after a sit"),
)  # fmt: skip
"""Causes that the paper does not name, as second labels alone."""


NO_CALL: Final = Cause("call", "no usable call", "tool calling")
"""Not of the paper: most steps were lost because the agent named no call that could be executed."""


def _called_nothing(steps: Sequence[StepRecord]) -> bool:
    """Tell whether at least half of the steps held no usable call: then their way says little about the agent's."""
    return 2 * sum(step.status == "invalid" for step in steps) >= max(1, len(steps))


def failed_stage(scores: Scores) -> Stage | None:
    """Return the first stage that was not met.

    None for a success, a free instruction, an unfinished episode and a plugin's failure.
    """
    if not scores.finished or scores.outcome == "plugin_error" or scores.success is None or scores.success:
        return None
    if scores.of_two:
        return two.first_failed(scores.hands)
    if scores.hands:
        return first_failed(scores.hands)
    if not scores.find:
        return "find"
    return "interact" if scores.nav else "nav"


def attribute(recorded: RecordedEpisode, scores: Scores | None = None) -> Cause | None:
    """Return the root cause of a failed episode; None if it did not fail. scores: of the record, if known already."""
    stage = failed_stage(scores or score(recorded))
    if stage is None:
        return None
    if _called_nothing(recorded.steps):
        return NO_CALL
    if recorded.record.spec.partner is not None:
        return first_cause(two.CAUSES, stage, two.Together.of(recorded))
    if recorded.record.spec.goal is not None:
        return cause_of(recorded, stage)
    return first_cause(CAUSES, stage, EpisodeFeatures.of(recorded))


def also(recorded: RecordedEpisode, first: Cause | None, scores: Scores | None = None) -> tuple[Cause, ...]:
    """Return the other causes of a failed episode that its first one hides, in the order of the rules.

    After "no usable call" they are the paper's causes that describe the failure. scores: of the record, if known.
    """
    spec = recorded.record.spec
    if first is None or spec.goal is not None or spec.partner is not None:
        return ()
    features = EpisodeFeatures.of(recorded)
    stage = failed_stage(scores or score(recorded)) if first is NO_CALL else first.stage
    alike = (cause for cause in (*CAUSES, *FURTHER) if cause.stage == stage and cause is not first)
    return tuple(cause for cause in alike if cause.describes(features))


# -- the funnel --------------------------------------------------------------------------------------------------------
def funnel(scores: Sequence[Scores]) -> tuple[tuple[list[bool], tuple[Scores, ...]], ...]:
    """Return for each stage whether each episode passed, and the episodes: in view, found, reached of all, sat of the
    reached whose task includes sitting. An episode counts only if it passed all earlier stages."""
    asked = tuple(s for s in scores if s.finished and s.success is not None)
    to_sit = tuple(s for s in asked if s.find and s.nav and s.interact is not None)
    return (
        ([bool(s.geo_find) for s in asked], asked),
        ([bool(s.find) for s in asked], asked),
        ([bool(s.find and s.nav) for s in asked], asked),
        ([bool(s.interact) for s in to_sit], to_sit),
    )
