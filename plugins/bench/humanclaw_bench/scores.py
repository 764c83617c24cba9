"""The facts of one episode from which metrics are computed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, Final

import numpy as np

from humanclaw import EpisodeSpec, Motion, RecordedEpisode, StepRecord, Verdict
from humanclaw.body import FPS, FUTURE, Pose2D, heading, pelvis_jerk, rest_pose, root_jerk, wrap_angle
from humanclaw.records import (
    Outcome,
    Usage,
    acknowledges,
    end_distance,
    ever_reached,
    in_view,
    is_met,
    on_target,
    reached,
    role_of,
    sits_of,
    stopped_seated,
    stopped_within_reach,
)
from humanclaw_bench.conditions import Conditions, conditions_of
from humanclaw_bench.difficulty import overall
from humanclaw_bench.disturbance import collisions, displacements, disturbed, disturbed_path
from humanclaw_bench.hands.scores import HandFacts, stages_of
from humanclaw_bench.path_metrics import arrived, pace, path_weighted
from humanclaw_bench.two.scores import Together

TURNS: Final = float(np.radians(5.0))
"""Smallest turn of a step that counts, radians; the paper gives none."""
NEARBY: Final = 1.0
"""The looser threshold of NavSR@1m, metres."""
LONGEST: Final = FUTURE / FPS
"""Most seconds of motion of a decision at the paper's pace: its skills play one chunk (paper, section 3.2)."""
FARTHEST: Final = 1.0
"""Most metres of the pelvis in a chunk at this pace. The paper gives none: `walk` is asked for at most 0.8 m here."""
FINISHED: Final = ("stopped", "out_of_steps", "plugin_error")


def ended(outcome: str, limit: str) -> bool:
    """Tell whether an episode ended, failures included: its own, a plugin's, or a limit of an episode or call."""
    return outcome in FINISHED or (outcome == "limit_reached" and limit != "run")


# -- the agent's answers -----------------------------------------------------------------------------------------------
def claims(step: StepRecord, category: str) -> bool:
    """Tell whether the answer of a step acknowledges the target."""
    return acknowledges(step.decision.visible_state, category)


# -- sitting -----------------------------------------------------------------------------------------------------------
def is_sit(recorded: RecordedEpisode, step: StepRecord) -> bool:
    """Tell whether a step called a skill of role sit."""
    return role_of(recorded, step) == "sit"


def sat_down(recorded: RecordedEpisode) -> bool:
    """Tell whether the pelvis was on a target in the last frame of any sit (GeoInteractSR)."""
    return any(is_sit(recorded, step) and on_target(recorded, step) for step in recorded.steps)


# -- turning -----------------------------------------------------------------------------------------------------------
def reversals(recorded: RecordedEpisode) -> float:
    """Return the share of steps that turn the body back, by TURNS or more, right after a step that turned it the other
    way (paper, section 5.2); NaN without motion."""
    if not recorded.has_motion or not recorded.steps:
        return float("nan")
    facing = heading(recorded.motion("simulated").rotations[:, 0])
    turns = [float(wrap_angle(facing[max(last - 1, 0)] - facing[first - 1])) for first, last in recorded.spans]
    back = [a * b < 0 and min(abs(a), abs(b)) >= TURNS for a, b in pairwise(turns)]
    return sum(back) / len(turns)


# -- generated motion --------------------------------------------------------------------------------------------------
def generated_trajectory(recorded: RecordedEpisode) -> Motion:
    """Return the generated motion of all steps as one, each chunk from the end of the one before it.

    In the record a chunk begins at the simulated body. The offset to the last generated pose comes from contact, not
    from the motion model, so it must not count as jerk.
    """
    made, real = recorded.motion("generated"), recorded.motion("simulated")
    whole: Motion | None = None
    for first, last in _chunks(recorded.spans):
        piece = made[first:last]
        if whole is not None:
            piece = _hips(whole).to_world(_hips(real[:first]).to_local(piece))
        whole = piece if whole is None else whole.then(piece)
    return whole or made[:0]


def _chunks(spans: Sequence[tuple[int, int]]) -> Iterator[tuple[int, int]]:
    for first, last in spans:
        yield from ((start, min(start + FUTURE, last)) for start in range(first, last, FUTURE))


def _hips(motion: Motion) -> Pose2D:
    """Return the floor-projected hip frame of the last pose, in which the next chunk begins."""
    return Pose2D.of(motion, floor=float(motion.root[-1, 1]))


# -- an episode --------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Scores:
    """One episode in numbers. None: not part of the task. NaN: not in the record."""

    episode: str
    agent: str
    verifier: str
    scene: str
    scene_digest: str
    category: str
    outcome: Outcome
    find: bool | None
    geo_find: bool | None
    false_claims: float
    """Share of steps without a target pixel in view that claim to see the target; NaN without such steps."""
    nav: bool | None
    arrive: bool | None
    """As arrived() returns it; None also if the way was not measured."""
    geo_nav: bool | None
    """Within reach of a target after any step."""
    ends_near: bool | None
    """Within reach of a target at the end."""
    nav_1m: bool | None
    interact: bool | None
    geo_interact: bool | None
    distance: float
    """Distance from the body to the nearest target at the end, metres."""
    collisions: Mapping[str, float]
    displaced: int
    """Number of displaced objects."""
    displacement: float
    """Their total displacement, metres."""
    disturbed: int
    """Number of objects touched by the body or by another of them."""
    disturbed_path: float
    """The total path of these, metres."""
    jerk: float
    """Of the pelvis, m/s^3."""
    rigid_jerk: float
    """Of the whole body as the root carries it, m/s^3."""
    reversals: float
    """Share of steps that turn the body back; NaN without motion."""
    steps: int
    invalid: int
    """Number of steps without a usable call."""
    tokens_in: int
    tokens_out: int
    cost: float
    """US dollars."""
    tokens_reasoning: int = 0
    """Reasoning tokens among tokens_out, if the provider reports them."""
    spl: float = float("nan")
    soft_spl: float = float("nan")
    """As path_weighted() returns them: NavSR, and the covered share of the distance; NaN without a geodesic."""
    brier: float = float("nan")
    """As brier() returns it."""
    limit: str = ""
    """Scope of the limit that ended the episode; empty if none did."""
    error: str = ""
    """Error that ended the episode; it names the plugin."""
    verified: int = 0
    """Number of steps whose call the verifier should check. Calls of skills without checks do not count."""
    unasked: int = 0
    """Number of these steps that passed without a usable answer of the verifier."""
    answers: int = 0
    """Number of answers of the agent; a step has up to three."""
    refused: int = 0
    """Number of answers without a usable call."""
    dropped_steps: int = 0
    """Number of steps whose prompt lacked past steps because the model's context was full."""
    left_out: tuple[str, ...] = ()
    """Parameters that the model refuses and was asked without."""
    tier: str = ""
    """easy, medium or hard; empty if unknown."""
    simulator: str = ""
    """Name of the simulator; empty if the record does not say."""
    privileged: str | None = None
    """Who got scene and true state: "agent", "verifier" or both; empty for nobody, None if the record does not say."""
    spec: EpisodeSpec | None = None
    """The specification of the episode."""
    falls: int = 0
    """Number of falls; one that goes on over several steps counts once."""
    chunks: int = 0
    """Number of half seconds of motion."""
    motion: float = 0.0
    """Seconds of motion."""
    longest: float = 0.0
    """Seconds of motion of the longest call, without the time to rise before it."""
    fastest: float = 0.0
    """Longest way of the pelvis over the floor in half a second, metres."""
    sequences: int = 0
    """Number of steps whose call played a sequence."""
    conditions: Conditions = field(default_factory=dict)
    """What the episode was played with."""
    also: str = ""
    """Further labels of a failure, after its root cause (attribution.also)."""
    extra: Mapping[str, float] = field(default_factory=dict)
    """Metrics of plugins (hook humanclaw_metrics), by name."""
    done: bool | None = None
    """Whether the goal for hands was met; None without one."""
    hands: Mapping[str, bool] = field(default_factory=dict)
    """Stages of a task for hands or with a partner, as stages_of() and Together return them."""
    dropped: int | None = None
    """How often a thing left a hand that was not told to open, in such a task."""

    apart: float = float("nan")
    """Mean distance to the partner, metres; NaN without one."""
    touched: int = 0
    """Number of steps that touch another person."""
    words: int = 0
    """Number of words said, an answer's left out."""

    @property
    def of_two(self) -> bool:
        """Whether there is a partner."""
        return self.spec is not None and self.spec.partner is not None

    @property
    def finished(self) -> bool:
        return ended(self.outcome, self.limit)

    @property
    def in_pace(self) -> bool:
        """Whether no call moves the body longer, or farther in half a second, than skills of the paper's kind."""
        return self.longest <= LONGEST + 1e-6 and self.fastest <= FARTHEST + 1e-6

    @property
    def success(self) -> bool | None:
        """Whether the last stage of the task was met; None for an unscored instruction."""
        if self.done is not None:
            return self.done
        return self.nav if self.interact is None else self.interact


def score(recorded: RecordedEpisode) -> Scores:
    """Score one episode from its record. Raises RecordError if its motion cannot be read."""
    record, spec = recorded.record, recorded.record.spec
    spl, soft_spl = path_weighted(recorded)
    task, successes = _task(recorded), _successes(recorded)
    stages = task.get("hands", {})
    scores = Scores(
        episode=spec.id,
        agent=record.agent,
        verifier=record.verifier,
        scene=spec.scene,
        scene_digest=record.scene_digest,
        category=spec.target_category,
        outcome=record.outcome,
        limit=record.limit,
        error=record.error,
        **{name: stages.get(name, met) for name, met in successes.items()},
        **task,
        **_motion_scores(recorded),
        **_step_counts(recorded.steps),
        false_claims=_false_claims(recorded),
        distance=end_distance(recorded),
        collisions=collisions(recorded),
        reversals=reversals(recorded),
        spl=spl,
        soft_spl=soft_spl,
        tier=overall(spec.difficulty) if spec.difficulty else "",
        simulator=str(record.settings.get("body", {}).get("simulator", "")),
        privileged=_privileged(record.settings),
        spec=spec,
        conditions=conditions_of(record),
    )
    return replace(scores, brier=brier(recorded, scores.success))


def _task(recorded: RecordedEpisode) -> dict[str, Any]:
    """Return the scores of a task for hands or with a partner; none of other tasks."""
    goal, scores = recorded.record.spec.goal, dict[str, Any]()
    if goal is not None:
        scores |= {"dropped": HandFacts(recorded).dropped}
    if recorded.record.spec.partner is not None:
        two = Together.of(recorded)
        stages = two.stages
        return scores | {
            "done": all(stages.values()), "hands": stages, "apart": two.mean_distance, "words": two.words
        }  # fmt: skip
    return scores | ({"done": is_met(goal, recorded.steps), "hands": stages_of(recorded)} if goal is not None else {})


def _motion_scores(recorded: RecordedEpisode) -> dict[str, Any]:
    """Return the scores of displaced objects and of the smoothness of the generated motion."""
    moved, motion = (recorded.objects(), generated_trajectory(recorded)) if recorded.has_motion else ({}, rest_pose(0))
    since = disturbed(recorded, moved)
    displaced = displacements(since, moved)
    return {
        "displaced": len(displaced),
        "displacement": float(sum(displaced)),
        "disturbed": len(since),
        "disturbed_path": disturbed_path(since, moved),
        "jerk": pelvis_jerk(motion),
        "rigid_jerk": root_jerk(motion),
    }


def _step_counts(steps: Sequence[StepRecord]) -> dict[str, Any]:
    """Return the scores that are counts, sums or maxima over steps."""
    usage = sum((step.usage for step in steps), Usage())
    return {
        "steps": len(steps),
        "invalid": sum(step.status == "invalid" for step in steps),
        "tokens_in": usage.tokens_in,
        "tokens_out": usage.tokens_out,
        "cost": usage.cost,
        "tokens_reasoning": usage.tokens_reasoning,
        # An accepting verdict without an answer or a cost is of a call that there was nothing to ask about.
        "verified": sum(step.verdict not in (None, Verdict(True)) for step in steps),
        "unasked": sum(step.verdict is not None and bool(step.verdict.failed_open) for step in steps),
        "answers": sum(len(step.attempts) for step in steps),
        "refused": sum(bool(attempt.error) for step in steps for attempt in step.attempts),
        "dropped_steps": sum(bool(step.decision.dropped_steps) for step in steps),
        "left_out": tuple(sorted({name for step in steps for name in step.decision.left_out})),
        "falls": _falls(steps),
        "chunks": sum(step.chunks for step in steps),
        "motion": sum(step.motion_frames for step in steps) / FPS,
        "longest": max((step.motion_frames - step.rise_frames for step in steps), default=0) / FPS,
        "fastest": max(map(pace, steps), default=0.0),
        "sequences": sum(len(step.parts) > 1 for step in steps),
        "touched": sum(any(contact.person for contact in step.contacts) for step in steps),
    }


def _falls(steps: Sequence[StepRecord]) -> int:
    """Count falls: one that goes on in the next step is that step's."""
    moved = [step for step in steps if step.motion_frames]
    return sum(step.fall > 0 for step in moved) - sum(step.falling for step in moved[:-1])


def _privileged(settings: Mapping[str, Mapping[str, bool]]) -> str | None:
    privileged = settings.get("privileged")
    return None if privileged is None else " and ".join(role for role, knows in privileged.items() if knows)


def brier(recorded: RecordedEpisode, success: bool | None) -> float:
    """Return the squared error of the success that the agent expected when it stopped (Brier score).

    NaN without an active stop, an expectation or a scored task.
    """
    if recorded.record.outcome != "stopped" or success is None:
        return float("nan")
    expected = recorded.steps[-1].decision.expected_success
    return float("nan") if expected is None else (expected - success) ** 2


def _false_claims(recorded: RecordedEpisode) -> float:
    category = recorded.record.spec.target_category
    blind = [step for step in recorded.steps if category and not any(step.target_pixels.values())]
    return sum(claims(step, category) for step in blind) / len(blind) if blind else float("nan")


def _successes(recorded: RecordedEpisode) -> dict[str, bool | None]:
    spec, steps = recorded.record.spec, recorded.steps
    if spec.goal is not None or not spec.target_category:
        names = ("find", "geo_find", "nav", "arrive", "geo_nav", "ends_near", "nav_1m", "interact", "geo_interact")
        return dict.fromkeys(names)
    near = recorded.record.outcome == "stopped" and end_distance(recorded) <= NEARBY
    return {
        "find": any(in_view(step) and claims(step, spec.target_category) for step in steps),
        "geo_find": any(map(in_view, steps)),
        "nav": stopped_within_reach(steps),
        "arrive": arrived(recorded),
        "geo_nav": ever_reached(recorded),
        "ends_near": reached(recorded),
        "nav_1m": near,
        "interact": stopped_seated(spec, steps, sits_of(recorded)) if spec.interact else None,
        "geo_interact": sat_down(recorded) if spec.interact else None,
    }
