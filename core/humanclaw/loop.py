"""The loop: observe, decide, check, verify, generate, simulate, record (paper, section 3).

One episode is one call of run_episode. A decision maker's mistake is an error text that goes back to it; a provider's failure
ends the episode as infra_error; neither is ever turned into a motion.
"""

from __future__ import annotations

import difflib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from humanclaw.contract import Skill
from humanclaw.embodiment import Body
from humanclaw.episode import EpisodeSpec
from humanclaw.errors import CallError, HumanclawError, LimitError, ProviderError, ReplayError, SceneError
from humanclaw.interfaces import (
    Call,
    Decision,
    DecisionMaker,
    EpisodeContext,
    Observation,
    Past,
    Verdict,
    Verifier,
    View,
)
from humanclaw.limits import Meter
from humanclaw.pose import Array
from humanclaw.recorder import (
    Film,
    attempt_record,
    decision_of,
    episode_record,
    jpeg,
    outcome,
    place,
    usage_of,
    usage_record,
    verdict_record,
    way_left,
)
from humanclaw.records import AttemptRecord, CallRecord, EpisodeRecord, EpisodeWriter, Outcome, StepRecord
from humanclaw.scene import Placement, Scene

Distance = Callable[[Array], float]
"""From a pelvis (3,) to the length of the shortest way to a target, metres; infinite if there is none."""
Ruler = Callable[[Scene, Sequence[int], float], Distance]
"""Makes a Distance for a scene, the ids of its targets and the height of the floor."""

MAX_ATTEMPTS: Final = 3
"""Answers asked for in one step until one is usable; after that the step is lost and the episode goes on."""


@dataclass
class Run:
    """One episode under way."""

    body: Body
    spec: EpisodeSpec
    maker: DecisionMaker
    verifier: Verifier | None = None
    writer: EpisodeWriter | None = None
    distance: Distance | None = None
    meter: Meter = field(default_factory=Meter)
    history: list[Past] = field(default_factory=list)
    feedback: str = ""
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def clock(self, part: str) -> Iterator[None]:
        began = time.perf_counter()
        yield
        self.seconds[part] = self.seconds.get(part, 0.0) + time.perf_counter() - began

    @property
    def skills(self) -> dict[str, Skill]:
        return self.body.skills

    def targets(self) -> tuple[int, ...]:
        return self.spec.target_ids


def run_episode(
    body: Body,
    spec: EpisodeSpec,
    maker: DecisionMaker,
    verifier: Verifier | None = None,
    *,
    folder: Path | None = None,
    options: Mapping[str, Any] | None = None,
    ruler: Ruler | None = None,
    replay: Sequence[StepRecord] = (),
    meter: Meter | None = None,
) -> EpisodeRecord:
    """Run one episode to its end and record it in folder, if one is given.

    ruler: measures the way that is left to a target after each step, for the record.
    replay: the steps of an earlier run of the same episode. They are lived through again without asking anybody, and the
    episode goes on from there. Raises ReplayError if the world does not do as it did.
    meter: the limits of the run, one meter for all of its episodes. When one is reached the episode ends as limit_reached; if
    the record's `limit` is "run", no further episode may begin.
    Raises SceneError if the scene is not the one the episode was made for. A KeyboardInterrupt is recorded and raised again.
    """
    begin(body, spec)
    meter = meter or Meter()
    meter.begin("episode")
    record = episode_record(body, spec, maker, verifier, options or {}, meter.limits)
    distance = ruler(body.scene, spec.target_ids, body.start.floor) if ruler and spec.target_ids else None
    record = record.model_copy(update=way_left(body.state(), distance))
    _introduce(body, spec, maker, verifier, meter)
    run = Run(body, spec, maker, verifier, EpisodeWriter(folder, record, replay) if folder else None, distance, meter)
    film = Film(body)
    ending: Outcome = "interrupted"
    error, limit, steps = "", "", 0
    try:
        for step in _steps(run, film, replay):
            steps += 1
            body.plugins.hook.humanclaw_step(episode=record, step=step)
            ending = "stopped" if step.status == "stopped" else "interrupted"
        ending = "stopped" if ending == "stopped" else "out_of_steps"
    except ProviderError as fault:
        ending, error = "infra_error", str(fault)
    except LimitError as reached:
        ending, error, limit = "limit_reached", str(reached), reached.scope
    except HumanclawError as fault:
        error = str(fault)
        raise
    finally:
        ended = {"outcome": ending, "error": error, "limit": limit, "usage": usage_record(meter.episode)}
        record = record.model_copy(update=ended | {"steps": steps})
        if run.writer:
            run.writer.end(record, film.arrays())
        body.plugins.hook.humanclaw_episode_end(episode=record, folder=folder)
    return record


def _introduce(body: Body, spec: EpisodeSpec, maker: DecisionMaker, verifier: Verifier | None, meter: Meter) -> None:
    """Tell the deciders their task, before anything is written: what they refuse here leaves nothing behind."""
    context = EpisodeContext(spec, body.skills, spec.seed, meter=meter)
    maker.begin(_privileged(context, body) if maker.privileged else context)
    if verifier:
        verifier.begin(_privileged(context, body) if getattr(verifier, "privileged", False) else context)


def begin(body: Body, spec: EpisodeSpec) -> None:
    """Put the body at the start of an episode."""
    start = Placement(**spec.start.model_dump()) if spec.start else None
    body.reset(body.scene if body.scene.name == spec.scene else spec.scene, start, seed=spec.seed)
    if spec.scene_digest and body.scene.digest != spec.scene_digest:
        raise SceneError(
            f"scene {spec.scene} has digest {body.scene.digest[:12]}, the episode was made for {spec.scene_digest[:12]}.",
            "Install the version of the scene's plugin that the episode was made with.",
        )


# -- one step ----------------------------------------------------------------------------------------------------------
def _steps(run: Run, film: Film, replay: Sequence[StepRecord]) -> Iterator[StepRecord]:
    for number in range(run.spec.max_steps):
        run.seconds = {}
        step = _relive(run, film, replay[number]) if number < len(replay) else _step(run, film, number)
        if run.writer and number >= len(replay):
            run.writer.step(step)
        yield step
        if step.status == "stopped":
            return


def _relive(run: Run, film: Film, step: StepRecord) -> StepRecord:
    """Carry out a recorded step again, so that body, history and film are as they were after it."""
    view = run.body.view()
    if run.writer:
        run.writer.frame(f"{step.step:04d}.jpg", jpeg(view))
    if run.maker.privileged:
        _recall(run, step, view)
    if run.verifier and getattr(run.verifier, "privileged", False) and step.status != "invalid":
        decision = decision_of(step.attempts[-1])
        _verify(run, step.step, view, decision, check(decision, run.skills))
    call = Call(step.call.skill, step.call.params) if step.call else None
    if call:
        film.add(run.body.execute(call))
    now = place(run.body.state(), "end")
    if now != {key: getattr(step, key) for key in now}:
        raise ReplayError(
            f"step {step.step} of episode {run.spec.id} ended at {step.end}, and now ends at {now['end']}.",
            "Continue it on the machine and with the versions that it was begun with, or remove its folder.",
        )
    run.meter.add(usage_of(step))
    _remember(run, step.step, decision_of(step.attempts[-1]), call, step.feedback, view)
    return step


def _recall(run: Run, step: StepRecord, view: View) -> None:
    """A script that knows the world keeps a memory beside the history, so it has to live through its decisions too."""
    feedback = run.feedback
    for attempt in step.attempts:
        again = run.maker.decide(Observation(step.step, run.spec.instruction, view.rgb, feedback), tuple(run.history))
        if attempt_record(again, attempt.error) != attempt:
            raise ReplayError(
                f"{run.maker.name} now decides otherwise in step {step.step} of episode {run.spec.id}.",
                "Continue it with the versions that it was begun with, or remove its folder.",
            )
        feedback = attempt.error


def _step(run: Run, film: Film, number: int) -> StepRecord:
    with run.clock("observe"):
        view = run.body.view()
    frame_file = run.writer.frame(f"{number:04d}.jpg", jpeg(view)) if run.writer else ""
    seen: dict[str, Any] = {
        "target_pixels": {i: int((view.ids == i).sum()) for i in run.targets()},
        "frame_file": frame_file,
    }
    attempts, decision, call = _decide(run, number, view)
    if call is None:
        _remember(run, number, decision, None, attempts[-1].error, view)
        return StepRecord(
            step=number,
            status="invalid",
            attempts=attempts,
            feedback=attempts[-1].error,
            **place(run.body.state()),
            **place(run.body.state(), "end"),
            **way_left(run.body.state(), run.distance),
            **seen,
        )
    verdict, call = _verify(run, number, view, decision, call)
    before = place(run.body.state())
    deed = run.body.execute(call)
    film.add(deed)
    run.seconds |= deed.seconds
    feedback = f"{_feedback(decision.calls[0], call, verdict)} {deed.felt}".strip()
    _remember(run, number, decision, call, feedback, view)
    return StepRecord(
        step=number,
        status="stopped" if run.skills[call.skill].role == "stop" else "executed",
        attempts=attempts,
        verdict=verdict_record(run.verifier, verdict),
        call=CallRecord(skill=call.skill, params=dict(call.params)),
        feedback=feedback,
        **(before | place(run.body.state(), "end") | seen | outcome(run.body.scene, run.targets(), deed)),
        **way_left(run.body.state(), run.distance),
        seconds={key: round(value, 4) for key, value in run.seconds.items()},
    )


def _decide(run: Run, number: int, view: View) -> tuple[tuple[AttemptRecord, ...], Decision, Call | None]:
    """Ask until an answer holds one legal call; each unusable answer is recorded and explained to the decision maker."""
    attempts: list[AttemptRecord] = []
    feedback = run.feedback
    for _ in range(MAX_ATTEMPTS):
        observation = Observation(number, run.spec.instruction, view.rgb, feedback)
        with run.clock("decide"), metered(run.meter):
            decision = run.maker.decide(observation, tuple(run.history))
            run.meter.add(decision.usage)
        try:
            call = check(decision, run.skills)
        except CallError as fault:
            feedback = str(fault)
            attempts.append(attempt_record(decision, feedback))
            continue
        attempts.append(attempt_record(decision))
        return tuple(attempts), decision, call
    return tuple(attempts), decision, None


@contextmanager
def metered(meter: Meter) -> Iterator[None]:
    """One question to a model. Raises LimitError, before it or after it, if a limit has been crossed."""
    meter.begin("call")
    meter.check()
    yield
    meter.check()


def check(decision: Decision, skills: Mapping[str, Skill]) -> Call:
    """The one legal call of a decision, defaults filled in. Raises CallError, written for the model."""
    if len(decision.calls) != 1:
        count = "no call" if not decision.calls else f"{len(decision.calls)} calls"
        raise CallError(f"Nothing was executed: the answer held {count}; make exactly one skill call a step.")
    return check_call(decision.calls[0], skills)


def check_call(call: Call, skills: Mapping[str, Skill]) -> Call:
    """The call with defaults filled in. Raises CallError, written for the model."""
    if call.skill not in skills:
        near = difflib.get_close_matches(call.skill, skills, n=1)
        hint = f" Did you mean {near[0]}?" if near else ""
        raise CallError(
            f"Nothing was executed: there is no skill {call.skill!r}.{hint} The skills are {', '.join(skills)}."
        )
    skill = skills[call.skill]
    if not skill.trained:
        raise CallError(
            f"Nothing was executed: {call.skill} is not available, its adapter is not trained. Use another skill."
        )
    return Call(call.skill, skill.check(call.params))


def _verify(run: Run, number: int, view: View, decision: Decision, call: Call) -> tuple[Verdict | None, Call]:
    """The verifier's verdict and the call to execute. A replacement that is not legal lets the proposal through, and says so."""
    if run.verifier is None:
        return None, call
    observation = Observation(number, run.spec.instruction, view.rgb)
    with run.clock("verify"), metered(run.meter):
        verdict = run.verifier.verify(observation, call, run.skills[call.skill], decision.mid_level_goal)
        run.meter.add(verdict.usage)
    if verdict.accepted or verdict.replacement is None:
        return verdict, call
    try:
        return verdict, check_call(verdict.replacement, run.skills)
    except CallError as fault:
        return Verdict(True, None, verdict.answers, f"replacement refused: {fault}", verdict.usage), call


def _feedback(proposed: Call, executed: Call, verdict: Verdict | None) -> str:
    if verdict is None or verdict.accepted or verdict.replacement is None:
        return f"Executed {executed}."
    failed = "; ".join(answer.note or answer.check for answer in verdict.answers if not answer.passed)
    return (
        f"{proposed} was not executed: the check before execution failed ({failed}). Executed {executed} in its place."
    )


def _remember(run: Run, number: int, decision: Decision, call: Call | None, feedback: str, view: View) -> None:
    run.feedback = feedback
    run.history.append(Past(number, decision, call, feedback, view.rgb))


def _privileged(context: EpisodeContext, body: Body) -> EpisodeContext:
    return replace(context, scene=body.scene, state=body.state)
