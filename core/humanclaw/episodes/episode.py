"""One episode that anyone can step: observe, submit a decision, get the step's record (paper, section 3).

An agent's mistake is an error text that goes back to it; a provider's failure ends the episode as infra_error; neither
is ever turned into a motion. Whatever ends an episode, its record is closed.

with Episode(body, spec, agent, folder=folder) as episode:
    while not episode.done:
        episode.submit(agent.decide(episode.observe(), episode.history))
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Literal, Self

from humanclaw.episodes.embodiment import Body, SkillExecution
from humanclaw.episodes.recorder import (
    TrajectoryBuffer,
    begin_record,
    contacts,
    distance_to_goal,
    pelvis_contacts,
    target_boxes,
    target_distance,
    touches,
    vec3,
    yaw,
)
from humanclaw.errors import (
    ANSWERING,
    CallError,
    HumanclawError,
    LimitError,
    PluginError,
    PluginRunError,
    ProviderError,
    ReplayError,
    SceneError,
    blaming,
    in_words,
)
from humanclaw.plugins.agents import Agent, EpisodeContext, HistoryEntry, Observation, Verifier
from humanclaw.plugins.deciders import admit, is_privileged, name_of, origin, settings_of
from humanclaw.records.decisions import Attempt, Decision, Refusal, Usage, Verdict, check
from humanclaw.records.feedback import Feedback
from humanclaw.records.folder import EpisodeWriter
from humanclaw.records.limits import Meter
from humanclaw.records.outcomes import succeeded
from humanclaw.records.specification import EpisodeSpec
from humanclaw.records.steps import EpisodeRecord, Outcome, StepRecord
from humanclaw.skills.call import Call, check_call
from humanclaw.storage.pictures import jpeg
from humanclaw.text.notebook import card
from humanclaw.world.simulator import Chunk, DistanceFactory, WorldState
from humanclaw.world.view import View

_QUALITY: Final = 88
"""Of the frames of a record, as JPEG."""
MAX_ATTEMPTS: Final = 3
"""Answers asked for in one step until one is usable; after that the step is lost and the episode goes on."""


class Episode:
    """A body's episode, from its start to its closed record. Not thread-safe, except for stop()."""

    def __init__(
        self,
        body: Body,
        spec: EpisodeSpec,
        agent: Agent | str = "",
        verifier: Verifier | None = None,
        *,
        folder: Path | None = None,
        options: Mapping[str, Any] | None = None,
        distance: DistanceFactory | None = None,
        replay: Sequence[StepRecord] = (),
        meter: Meter | None = None,
        attempts: int = MAX_ATTEMPTS,
    ) -> None:
        """Put the body at the start, start agent and verifier, and begin the record.

        Args:
            agent: who decides. It is told its task here; somebody who knows it already is only named.
            folder: of the record; None keeps none on disk.
            options: of the run, for the record.
            distance: measures the way that is left to a target after each step, for the record.
            replay: the steps of an earlier run of the same episode. They are executed again without asking anybody, and
                the episode goes on from there.
            meter: the limits of the run, one meter for all of its episodes.
            attempts: so many refused decisions in a row cost a step; at least 1.

        Raises:
            HumanclawError: no attempt is left for any decision.
            SceneError: the scene is not the one that the episode was made for.
            ReplayError: the world does not do as it did, or steps follow the end of the episode.
        """
        if attempts < 1:
            raise HumanclawError(f"an episode needs at least one attempt a step; got {attempts}.", "Give 1 or more.")
        _check_replay(replay, spec)
        reset(body, spec)
        self.body, self.spec = body, spec
        self._reset = body.resets
        self._agent = None if isinstance(agent, str) else agent
        self._verifier, self._max_attempts = verifier, attempts
        self._meter = meter or Meter()
        self._meter.begin("episode")
        self.fault: PluginRunError | None = None
        """What a plugin raised, if that ended the episode."""
        self._privileged = self._asked_privileges()
        settings = {
            "agent": self._settings(agent), "verifier": self._settings(verifier), "privileged": self._privileged,
            "limits": self._meter.limits,
        }  # fmt: skip
        record = begin_record(body, spec, self._name(agent), self._name(verifier), options or {}, settings)
        self._distance = (
            distance(body.scene, spec.target_ids, body.start.floor) if distance and spec.target_ids else None
        )
        self._record = record.model_copy(update={"geodesic": distance_to_goal(body.state(), self._distance)})
        # Before anything is written: what they refuse leaves nothing behind.
        self._begin_deciders()
        self._folder = folder
        self._writer: EpisodeWriter | None = None
        self._drawn: dict[str, bytes] = {}
        """Frames of replayed steps, until the world is known to do as it did."""
        self._trajectory = TrajectoryBuffer(body)
        self._steps: list[StepRecord] = []
        self._history: list[HistoryEntry] = []
        self._feedback = Feedback()
        self._stopping = self._cancelling = False
        self._asked: float | None = None
        """When the open question was put; None if none is open."""
        self._begin_step()
        with self._closing():
            self._replay(replay)
            self._open(folder)
        if self.fault:
            self._end_by(self.fault)
        elif self._is_over():
            self._close()

    # -- how it stands -------------------------------------------------------------------------------------------------
    @property
    def done(self) -> bool:
        """Whether no further decision is taken."""
        return self._stopping or self.outcome != "running" or len(self._steps) >= self.spec.max_steps

    @property
    def outcome(self) -> Outcome:
        """'running' until the record is closed."""
        return self._record.outcome

    @property
    def record(self) -> EpisodeRecord:
        """The episode's record as it stands."""
        return self._record

    @property
    def steps(self) -> tuple[StepRecord, ...]:
        """Every step so far."""
        return tuple(self._steps)

    @property
    def history(self) -> tuple[HistoryEntry, ...]:
        """Every step so far as an agent remembers it."""
        return tuple(self._history)

    @property
    def success(self) -> bool:
        """Whether it has been stopped within reach of a target, and sitting on it if that was asked."""
        sits = {name for name, skill in self.body.skills.items() if skill.role == "sit"}
        return succeeded(self.spec, self._steps, sits)

    def target_distance(self) -> float | None:
        """Metres from the nearest joint to the bounding box of the nearest target, straight; None without a target."""
        return target_distance(self.body.scene, self.spec.target_ids, self.body.state())

    def distance_to_goal(self) -> float | None:
        """Shortest way to a place beside the nearest target, metres; None if nothing measures it or there is none."""
        return distance_to_goal(self.body.state(), self._distance)

    # -- stepping it ---------------------------------------------------------------------------------------------------
    def observe(self) -> Observation:
        """See what the body sees, and what became of the last decision. Nothing moves; may be called as often as one
        likes.

        Raises LimitError, and ends the episode, if a limit leaves nothing for another decision.
        """
        view = self._look()
        if self._asked is None and not self.done:
            with self._closing():
                self._question()
            self._asked = time.perf_counter()
        return Observation(len(self._steps), self.spec.instruction, view.rgb, self._feedback)

    def ask(self) -> StepRecord | Refusal:
        """Let the episode's agent decide, and submit it. Raises what submit does, and PluginRunError for what the agent
        raises."""
        self._check_open()
        if self._agent is None:
            raise HumanclawError("nobody decides in this episode.", "Begin it with an agent, or submit decisions.")
        seen = self.observe()
        with self._closing():
            return self._take(self._decide(self._agent, seen))

    def submit(self, decision: Decision) -> StepRecord | Refusal:
        """Take a step. A decision that holds no legal call is refused; the last of several in a row costs the step.

        Raises HumanclawError if the episode has ended, TypeError for what is no Decision or is malformed, which changes
        nothing, LimitError if a limit was crossed, which ends it.
        """
        self._check_open()
        decision = admit(decision, Decision, "submit() was given")
        with self._closing():
            return self._take(decision)

    def _repr_html_(self) -> str:
        """How it stands, and what the eyes see now, for a notebook."""
        last = str(self.steps[-1].feedback) if self.steps else "Nothing was called yet."
        lines = [self.record.spec.instruction, f"{self.outcome.replace('_', ' ')} at step {len(self.steps)}", last]
        return card(f"Episode {self.record.spec.id}", lines, [("view", jpeg(self.body.view().rgb, _QUALITY))])

    def stop(self) -> None:
        """Take no further decision, and break off the call under way. May be called from another thread or a signal
        handler."""
        self._stopping = True

    def cancel(self) -> None:
        """Break off the call under way after the chunk that is being played: a step, recorded as cancelled. May be
        called from another thread or an observer; does nothing between two calls."""
        self._cancelling = True

    def close(self) -> None:
        """Close the record; an episode that has not ended is recorded as interrupted."""
        self._close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, fault: BaseException | None, trace: TracebackType | None
    ) -> bool:
        """Close the record. The failure of a provider or a plugin and a limit end the episode; they go no further than
        this."""
        self._end_by(fault)
        return isinstance(fault, ProviderError | LimitError | PluginRunError)

    # -- one step ------------------------------------------------------------------------------------------------------
    def _check_open(self) -> None:
        """Raise HumanclawError if no further decision is taken, or the body is somewhere else by now."""
        if self.done:
            ended = "stopped from outside" if self.outcome == "running" else self.outcome.replace("_", " ")
            raise HumanclawError(f"the episode has ended ({ended}).", "Begin another one.")
        if self.body.resets != self._reset:
            raise HumanclawError("the body was put elsewhere since the episode began.", "Begin another one.")

    def _begin_step(self) -> None:
        self._attempts: list[Attempt] = []
        self._seconds: dict[str, float] = {}
        self._view: View | None = None
        self._frame_file = ""
        self._asked = None

    def _look(self) -> View:
        """Return the view of the step under way, which is drawn and kept once."""
        if self._view is None:
            with self._timed("observe"):
                self._view = self.body.view()
            if self._folder and not self.done:
                self._frame_file = self._keep_frame(f"{len(self._steps):04d}.jpg", jpeg(self._view.rgb, _QUALITY))
        return self._view

    def _keep_frame(self, name: str, data: bytes) -> str:
        """Write a frame, or hold it back while steps are replayed; its path relative to the folder."""
        if self._writer:
            return self._writer.frame(name, data)
        self._drawn[name] = data
        return f"frames/{name}"

    def _open(self, folder: Path | None) -> None:
        """Begin the record on disk. Not before the replay: one that fails leaves the folder as it was."""
        if folder:
            self._writer = EpisodeWriter(folder, self._record, self._steps)
            for name, data in self._drawn.items():
                self._writer.frame(name, data)
            self._drawn.clear()

    def _question(self) -> None:
        """Open the account of one question to a model. Raises LimitError if a limit has been crossed."""
        self._meter.begin("call")
        self._meter.check()

    def _decide(self, agent: Agent, seen: Observation) -> Decision:
        """Return what an agent decides. Raises PluginRunError for what breaks there, a malformed decision included."""
        with self._asking(agent):
            return admit(agent.decide(seen, self.history), Decision, f"decide() of {self._record.agent} returned")

    def _take(self, decision: Decision) -> StepRecord | Refusal:
        """Enter a decision, and carry it out if it holds a legal call."""
        self._look()
        self._answered("decide", decision.usage)
        try:
            call = check(decision, self.body.skills)
        except CallError as fault:
            return self._refuse(decision, str(fault))
        self._attempts.append(Attempt(decision))
        verdict, call = self._verify(decision, call)
        return self._keep(self._execute(call, verdict))

    def _answered(self, part: str, usage: Usage) -> None:
        """Enter what an answer took. Raises LimitError if it has crossed a limit."""
        if self._asked is not None:
            self._seconds[part] = self._seconds.get(part, 0.0) + time.perf_counter() - self._asked
            self._asked = None
        self._meter.add(usage)
        self._meter.check()

    def _refuse(self, decision: Decision, error: str) -> StepRecord | Refusal:
        self._attempts.append(Attempt(decision, error))
        self._feedback = Feedback(refusal=error)
        left = self._max_attempts - len(self._attempts)
        return Refusal(error, left) if left else self._keep(self._measure(self.body.state()))

    def _verify(self, decision: Decision, call: Call) -> tuple[Verdict | None, Call]:
        """Return the verdict and the call to execute. A replacement that is not legal lets the proposal through, and
        says so."""
        if self._verifier is None:
            return None, call
        skills = self.body.skills
        self._question()
        self._asked = time.perf_counter()
        observation = Observation(len(self._steps), self.spec.instruction, self._look().rgb)
        with self._asking(self._verifier):
            verdict = self._verifier.verify(observation, call, skills[call.skill], decision.mid_level_goal)
            verdict = admit(verdict, Verdict, f"verify() of {self._record.verifier} returned")
        self._answered("verify", verdict.usage)
        if verdict.accepted or verdict.replacement is None:
            return verdict, call
        try:
            return verdict, check_call(verdict.replacement, skills)
        except CallError as fault:
            return replace(verdict, accepted=True, replacement=None, failed_open=f"replacement refused: {fault}"), call

    def _execute(self, call: Call, verdict: Verdict | None) -> StepRecord:
        """Carry out a call. An active stop ends the episode where the body is: no motion follows."""
        before = self.body.state()
        if self._stops(call):
            return self._measure(before, call, verdict)
        self._cancelling = False
        done = self.body.execute(call, self._watch)
        self._trajectory.add(done.chunks)
        self._seconds |= done.seconds
        return self._measure(before, call, verdict, done)

    def _watch(self, chunk: Chunk) -> bool:
        """Tell the observers of a chunk; whether the call goes on."""
        self.body.plugins.tell("humanclaw_chunk", episode=self._record, step=len(self._steps), chunk=chunk)
        return not (self._cancelling or self._stopping)

    def _measure(
        self,
        before: WorldState,
        call: Call | None = None,
        verdict: Verdict | None = None,
        done: SkillExecution | None = None,
    ) -> StepRecord:
        """Return the record of a step: of a call with the motion that it led to, or of none."""
        after, chunks = self.body.state(), done.chunks if done else ()
        scene, targets, ids = self.body.scene, self.spec.target_ids, self._look().ids
        return StepRecord(
            step=len(self._steps),
            status=("stopped" if self._stops(call) else "executed") if call else "invalid",
            attempts=tuple(self._attempts),
            verdict=verdict,
            call=call,
            proprioception=done.proprioception if done else None,
            tactile=done.tactile if done else None,
            target_pixels={key: int((ids == key).sum()) for key in targets},
            frame_file=self._frame_file,
            motion_frames=sum(len(chunk.commanded) for chunk in chunks),
            parts=done.parts if done else (),
            cancelled=done.cancelled if done else False,
            waypoints=tuple(vec3(chunk.execution.simulated.root[-1]) for chunk in chunks[:-1]),
            start=vec3(before.body.root[-1]),
            end=vec3(after.body.root[-1]),
            yaw_start=yaw(before),
            yaw_end=yaw(after),
            contacts=contacts(chunks),
            touches=touches(chunks),
            targets=target_boxes(scene, targets, after),
            target_distance=target_distance(scene, targets, after),
            pelvis_contacts=pelvis_contacts(chunks) if chunks else self._resting(),
            geodesic=self.distance_to_goal(),
            seconds={part: round(seconds, 4) for part, seconds in self._seconds.items()},
        )

    def _stops(self, call: Call) -> bool:
        return self.body.skills[call.skill].role == "stop"

    def _resting(self) -> tuple[int, ...]:
        """Return what the pelvis touches while nothing moves: what it touched when the last motion ended."""
        return self._steps[-1].pelvis_contacts if self._steps else ()

    def _keep(self, step: StepRecord, replayed: bool = False) -> StepRecord:
        """Note that a step is over: record it, remember it, tell the observers."""
        if self._writer and not replayed:
            self._writer.step(step)
        self._steps.append(step)
        self._feedback = step.feedback
        view = self._look().rgb
        self._history.append(HistoryEntry(step.step, step.decision, step.feedback, view))
        self._begin_step()
        self.body.plugins.tell("humanclaw_step", episode=self._record, step=step, view=view)
        if not replayed and self._is_over():
            self._close()
        return step

    def _is_over(self) -> bool:
        """Whether the steps so far end the episode."""
        return self._natural_outcome() != "interrupted"

    # -- replay --------------------------------------------------------------------------------------------------------
    def _replay(self, steps: Sequence[StepRecord]) -> None:
        """Carry out recorded steps again, up to where a plugin breaks."""
        with self._noting():
            for step in () if self.fault else steps:
                self._replay_step(step)

    def _replay_step(self, step: StepRecord) -> None:
        """Carry out a recorded step again, so that body, history and trajectory are as they were after it."""
        self._look()
        self._replay_decisions(step)
        if step.call and step.status != "stopped":
            left = iter(range(step.chunks - 1, -1, -1))
            self._trajectory.add(self.body.execute(step.call, lambda chunk: next(left) > 0).chunks)
        after = self.body.state()
        if (vec3(after.body.root[-1]), yaw(after)) != (step.end, step.yaw_end):
            raise ReplayError(
                f"step {step.step} of episode {self.spec.id} ended at {step.end}, "
                f"and now ends at {vec3(after.body.root[-1])}.",
                "Continue it on the machine and with the versions that it was begun with, or remove its folder.",
            )
        self._meter.add(step.usage)
        self._keep(step, replayed=True)

    def _replay_decisions(self, step: StepRecord) -> None:
        """Replay the decisions: a script that knows the world keeps a memory beside the history, so it has to live
        through its decisions too."""
        if self._agent and self._privileged["agent"]:
            feedback = self._feedback
            for attempt in step.attempts:
                seen = Observation(step.step, self.spec.instruction, self._look().rgb, feedback)
                if self._decide(self._agent, seen) != attempt.decision:
                    raise ReplayError(
                        f"{self._record.agent} now decides otherwise in step {step.step} of episode {self.spec.id}.",
                        "Continue it with the versions that it was begun with, or remove its folder.",
                    )
                feedback = Feedback(refusal=attempt.error)
        if self._privileged.get("verifier") and step.status != "invalid":
            self._verify(step.decision, check(step.decision, self.body.skills))

    # -- the end -------------------------------------------------------------------------------------------------------
    @contextmanager
    def _closing(self) -> Iterator[None]:
        """Close the record if anything is raised; it goes on to whoever called."""
        try:
            yield
        except BaseException as fault:
            self._end_by(fault)
            raise

    def _end_by(self, fault: BaseException | None) -> None:
        if isinstance(fault, ProviderError):
            self._close("infra_error", str(fault))
        elif isinstance(fault, PluginRunError):
            self.fault = fault
            self._close("plugin_error", str(fault))
        elif isinstance(fault, LimitError):
            self._close("limit_reached", str(fault), fault.scope)
        elif isinstance(fault, HumanclawError):
            self._close("interrupted", str(fault))
        else:
            self._close("interrupted" if fault else "")

    def _close(self, outcome: Outcome | Literal[""] = "", error: str = "", limit: str = "") -> None:
        """Write the end of the record, once. outcome: by default what the steps say."""
        if self.outcome != "running":
            return
        counted = {"usage": self._meter.episode, "steps": len(self._steps)}
        record = self._record.ended(outcome or self._natural_outcome(), error, limit=limit, **counted)
        if self._writer:
            self._writer.end(record, self._trajectory.arrays())
        self._record = record  # Not before: an end that could not be written may be written once there is room.
        self._agent = self._verifier = None  # They know the episode by their context: a cycle would keep its house.
        self.body.plugins.tell("humanclaw_episode_end", episode=self._record, folder=self._folder)

    def _natural_outcome(self) -> Outcome:
        if self._steps and self._steps[-1].status == "stopped":
            return "stopped"
        return "out_of_steps" if len(self._steps) >= self.spec.max_steps else "interrupted"

    # -- parts ---------------------------------------------------------------------------------------------------------
    @contextmanager
    def _noting(self) -> Iterator[None]:
        """Note what a plugin raises while there is no record yet: it ends the episode once there is one."""
        try:
            yield
        except PluginRunError as fault:
            self.fault = self.fault or fault

    @contextmanager
    def _asking(self, decider: Agent | Verifier) -> Iterator[None]:
        """Name the plugin of a decider in what it raises. PluginError ends the run, and from the second step on the
        episode too: it would otherwise be had again."""
        try:
            with blaming(origin(decider), *ANSWERING):
                yield
        except PluginError as fault:
            if self._steps:
                self._close("plugin_error", f"{origin(decider)} raised {in_words(fault)}")
            raise

    def _name(self, decider: Agent | Verifier | str | None) -> str:
        """Return what a decider is called; one that has no name that a record can hold, after its package."""
        if decider is None or isinstance(decider, str):
            return decider or ""
        with self._noting():
            return name_of(decider)
        return origin(decider)

    def _settings(self, decider: object) -> Mapping[str, Any]:
        with self._noting():
            return settings_of(decider)
        return {}

    def _asked_privileges(self) -> dict[str, bool]:
        """Ask agent and verifier once whether they are privileged: what the record says is what they are told."""
        found = {}
        for role, decider in (("agent", self._agent), ("verifier", self._verifier)):
            if decider is not None:
                found[role] = False
                with self._noting():
                    found[role] = is_privileged(decider)
        return found

    def _begin_deciders(self) -> None:
        """Tell agent and verifier their task. Raises PluginError for one that cannot be used; what breaks ends the
        episode."""
        deciders: Mapping[str, Agent | Verifier | None] = {"agent": self._agent, "verifier": self._verifier}
        for role, decider in deciders.items():
            with self._noting(), blaming(origin(decider), *ANSWERING):
                if decider:
                    decider.begin(self._context(role))

    def _context(self, role: str) -> EpisodeContext:
        context = EpisodeContext(self.spec, self.body.skills, self.spec.seed, meter=self._meter)
        if not self._privileged[role]:
            return context
        return replace(context, scene=self.body.scene, state=self.body.state, view=self._look)

    @contextmanager
    def _timed(self, part: str) -> Iterator[None]:
        began = time.perf_counter()
        yield
        self._seconds[part] = self._seconds.get(part, 0.0) + time.perf_counter() - began


def _check_replay(steps: Sequence[StepRecord], spec: EpisodeSpec) -> None:
    """Nothing follows an active stop, nor the last step that an episode has. Raises ReplayError."""
    ends = [index for index, step in enumerate(steps, 1) if step.status == "stopped" or index == spec.max_steps]
    if ends and ends[0] < len(steps):
        told = f"the record of episode {spec.id} has {len(steps)} steps, and the episode ends with step {ends[0] - 1}."
        raise ReplayError(told, "Remove its folder, or give back the specification that it was begun with.")


def reset(body: Body, spec: EpisodeSpec) -> None:
    """Put a body at the start of an episode. Raises SceneError if the scene is not the one that the episode was made
    for."""
    body.reset(body.scene if body.scene.name == spec.scene else spec.scene, spec.start, seed=spec.seed)
    if spec.scene_digest and body.scene.digest != spec.scene_digest:
        raise SceneError(
            f"scene {spec.scene} has digest {body.scene.digest[:12]}, the episode was made for "
            f"{spec.scene_digest[:12]}.",
            "Install the version of the scene's plugin that the episode was made with.",
        )
