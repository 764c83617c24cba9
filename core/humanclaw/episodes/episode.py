"""One episode that anyone can step: observe, submit a decision, get the step's record (paper, section 3).

An agent's mistake goes back to it as an error text. A provider's failure ends the episode as infra_error. Neither ever
becomes a motion. Whatever ends an episode, its record is closed.

with Episode(body, spec, agent, folder=folder) as episode:
    while not episode.done:
        episode.submit(agent.decide(episode.observe(), episode.history))
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, Literal, Self

from humanclaw.body.pose import FPS, FUTURE
from humanclaw.episodes.agents import EpisodeAgents, own_seed, settled
from humanclaw.episodes.embodiment import Body
from humanclaw.episodes.execution import SkillExecution
from humanclaw.episodes.history import QUALITY, History
from humanclaw.episodes.recorder import begin_folder, begin_record, ending, piece_of, stand_at_start
from humanclaw.episodes.replay import check_end, check_memory, check_place
from humanclaw.episodes.step import Step, distance_to_goal, target_distance
from humanclaw.errors import CallError, HumanclawError, LimitError, PluginError, PluginRunError, ProviderError
from humanclaw.plugins.agents import Agent, EpisodeContext, HistoryEntry, Observation, Verifier
from humanclaw.plugins.validation import admit
from humanclaw.records.decisions import Attempt, Decision, Refusal, Usage, Verdict, check
from humanclaw.records.feedback import Feedback
from humanclaw.records.limits import Meter
from humanclaw.records.specification import EpisodeSpec
from humanclaw.records.steps import EpisodeRecord, Outcome, StepRecord, spent
from humanclaw.records.success import succeeded
from humanclaw.skills.call import Call
from humanclaw.storage.files import Folder
from humanclaw.storage.pictures import jpeg
from humanclaw.text.notebook import card
from humanclaw.world.scene import Scene
from humanclaw.world.simulator import Chunk, DistanceFactory, WorldState
from humanclaw.world.view import View

Clock = Literal["paused", "real"]
MAX_ATTEMPTS: Final = 3
"""Answers that an agent may give in one step until one is usable. After the last one the step is lost."""


class Episode:
    """A body's episode, from its start to its closed record. Not thread-safe, except for stop()."""

    def __init__(
        self,
        body: Body,
        spec: EpisodeSpec,
        agent: Agent | str = "",
        verifier: Verifier | None = None,
        *,
        folder: Path | str | Folder | None = None,
        options: Mapping[str, Any] | None = None,
        distance: DistanceFactory | None = None,
        replay: Sequence[StepRecord] = (),
        meter: Meter | None = None,
        attempts: int = MAX_ATTEMPTS,
        apart: Mapping[str, str] | None = None,
        agent_seed: int | None = None,
        scene: Scene | None = None,
        company: Sequence[str] = (),
        clock: Clock = "paused",
    ) -> None:
        """Put the body at the start, start agent and verifier, and begin the record.

        Args:
            agent: makes the decisions; begin() is called here. Give only a name if decisions come through submit().
            folder: where to write the record; None writes nothing.
            options: options of the run, for the record.
            distance: measures the remaining way to a target after each step, for the record.
            replay: steps of an earlier run of the same episode. They are executed again without asking agent or
                verifier, and the episode continues after them.
            meter: limits of the run, shared by all its episodes.
            attempts: number of refused decisions in a row that costs a step; at least 1.
            apart: where "agent" and "verifier" play if not in this process, for the record.
            agent_seed: for random numbers of agent and verifier; by default derived from the episode's, so that who
                knows all episodes can tell from it which one this is.
            scene: the scene of the specification, if it is loaded already.
            company: of several bodies in the scene the ids of all their episodes, in order, for the record.
            clock: "real" lets the world go on while agent and verifier think: each half second costs a step.

        Raises:
            HumanclawError: attempts is below 1.
            SceneError: the scene has another digest than the specification.
            ReplayError: a replayed step ends elsewhere than recorded, steps follow the end of the episode, or agent or
                verifier is privileged.
        """
        if attempts < 1:
            raise HumanclawError(f"an episode needs at least one attempt a step; got {attempts}.", "Give 1 or more.")
        check_end(replay, spec)
        self._agents = EpisodeAgents(agent, verifier)
        check_memory(replay, self._agents.privileged, spec)
        stand_at_start(body, spec, scene)
        self.body, self.spec, self._reset = body, spec, body.resets
        self._clock = clock
        self._max_attempts, self._meter = attempts, meter or Meter()
        self._meter.begin("episode")
        self._distance = None
        if distance and spec.target_ids:
            self._distance = distance(body.scene, spec.target_ids, body.start.floor)
        settings = {"limits": self._meter.limits, "apart": apart or {}}
        record = begin_record(body, spec, self._agents, options or {}, settings, self.distance_to_goal(), company)
        # Before anything is written, so that a refusal leaves no folder behind.
        own = own_seed(spec.seed) if agent_seed is None else agent_seed
        context = EpisodeContext(spec.for_agent, body.skills, own, meter=self._meter, gaze=body.gaze)
        known = {"spec": spec, "seed": spec.seed, "scene": body.scene, "state": body.state, "view": self._look}
        self._agents.begin(context, known)
        self._recording = begin_folder(body, record, folder)
        self._history = History()
        self._between: list[bytes] = []
        self._feedback, self._step = Feedback(), Step(0)
        self._stopping = self._cancelling = False
        self._open(replay)

    # -- state -------------------------------------------------------------------------------------------------
    @property
    def done(self) -> bool:
        """Whether the episode takes no further decision."""
        return self._stopping or self.outcome != "running" or spent(self._recording.steps) >= self.spec.max_steps

    @property
    def fault(self) -> PluginRunError | None:
        """The plugin error that ended the episode, if one did."""
        return self._agents.fault

    @property
    def outcome(self) -> Outcome:
        """'running' until the record is closed."""
        return self.record.outcome

    @property
    def record(self) -> EpisodeRecord:
        """The record so far."""
        return self._recording.record

    @property
    def steps(self) -> tuple[StepRecord, ...]:
        """Every step so far."""
        return tuple(self._recording.steps)

    @property
    def history(self) -> tuple[HistoryEntry, ...]:
        """Every step so far, as an agent may recall it. Views of more than ten steps ago have passed through JPEG."""
        return self._history.entries

    @property
    def success(self) -> bool:
        """Whether the agent has stopped within reach of a target, and seated on it if the task says so."""
        sits = {name for name, skill in self.body.skills.items() if skill.role == "sit"}
        return succeeded(self.spec, self._recording.steps, sits)

    def target_distance(self) -> float | None:
        """Return the straight distance from the nearest joint to the nearest target's bounding box, metres; None
        without a target."""
        return target_distance(self.body.scene, self.spec.target_ids, self.body.state())

    def distance_to_goal(self) -> float | None:
        """Return the length of the shortest way to a place beside the nearest target, metres; None if it is not
        measured or there is no way."""
        return distance_to_goal(self.body.state(), self._distance)

    # -- stepping ---------------------------------------------------------------------------------------------------
    def observe(self) -> Observation:
        """Return the view and the feedback of the last decision. Nothing moves; call it as often as you like.

        Raises LimitError, and ends the episode, if a limit leaves no room for another decision.
        """
        view = self._look()
        if self._step.asked is None and not self.done:
            with self._closing():
                self._question()
        return self._seen(view, self._feedback)

    def ask(self) -> StepRecord | Refusal:
        """Let the episode's agent decide, and submit its decision.

        Raises what submit() raises, and PluginRunError for an error of the agent.
        """
        self._check_open()
        if self._agents.agent is None:
            raise HumanclawError("this episode has no agent.", "Begin it with an agent, or submit decisions.")
        seen = self.observe()
        with self._closing():
            return self._take(self._agents.decide(seen, self.history))

    def submit(self, decision: Decision, waited: int | None = None) -> StepRecord | Refusal:
        """Take a step. A decision without a legal call is refused; the last allowed refusal in a row costs the step.

        waited: half seconds that the world goes on before the call, by default as the clock has it.

        Raises:
            HumanclawError: the episode has ended.
            TypeError: the decision is malformed; nothing changes.
            LimitError: a limit was crossed, which ends the episode.
        """
        self._check_open()
        decision = admit(decision, Decision, "submit() was given")
        with self._closing():
            return self._take(decision, waited)

    def _repr_html_(self) -> str:
        """Return the state and the current view, for a notebook."""
        last = str(self.steps[-1].feedback) if self.steps else "Nothing was called yet."
        lines = [self.record.spec.instruction, f"{self.outcome.replace('_', ' ')} at step {len(self.steps)}", last]
        return card(f"Episode {self.record.spec.id}", lines, [("view", jpeg(self.body.view().rgb, QUALITY))])

    def stop(self) -> None:
        """Take no further decision, and break off the current call. Safe to call from another thread or a signal
        handler."""
        self._stopping = True

    def cancel(self) -> None:
        """Break off the current call after the chunk that is being played, and record the step as cancelled.

        Safe to call from another thread or an observer. Does nothing between two calls.
        """
        self._cancelling = True

    def close(self) -> None:
        """Close the record. An episode that has not ended is recorded as interrupted."""
        self._close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, fault: BaseException | None, trace: object) -> bool:
        """Close the record. Swallow a provider's failure, a plugin's error and a limit: they are outcomes."""
        self._end_by(fault)
        outcomes = ProviderError | LimitError | PluginRunError
        return isinstance(fault, outcomes) and not isinstance(fault, PluginError)

    # -- one step ------------------------------------------------------------------------------------------------------
    def _check_open(self) -> None:
        """Raise HumanclawError if the episode has ended, or the body has been reset since it began."""
        if self.done:
            ended = "stopped from outside" if self.outcome == "running" else self.outcome.replace("_", " ")
            raise HumanclawError(f"the episode has ended ({ended}).", "Begin another one.")
        if self.body.resets != self._reset:
            raise HumanclawError("the body was put elsewhere since the episode began.", "Begin another one.")

    def _look(self) -> View:
        """Return the view of the current step; it is drawn and kept once."""
        step = self._step
        if step.view is None:
            with step.timed("observe"):
                step.view = self.body.view()
            if self._recording.folder and not self.done:
                step.jpeg = jpeg(step.view.rgb, QUALITY)
                step.frame_file = self._recording.frame(f"{step.number:04d}.jpg", step.jpeg)
        return step.view

    def _seen(self, view: View, feedback: Feedback) -> Observation:
        step = self._step
        return Observation(step.number, self.spec.instruction, view.rgb, feedback, step.jpeg, tuple(self._between))

    def _question(self) -> None:
        """Begin the account of one question to a model. Raises LimitError if a limit has been crossed."""
        self._meter.begin("call")
        self._meter.check()
        self._step.ask()
        if self._clock == "real":
            self.body.hurry()

    def _take(self, decision: Decision, waited: int | None = None) -> StepRecord | Refusal:
        """Enter a decision, and execute it if it holds a legal call."""
        self._look()
        self._answered("decide", decision.usage)
        try:
            call = check(decision, self.body.skills)
        except CallError as fault:
            return self._refuse(decision, str(fault))
        self._step.attempts.append(Attempt(decision))
        verdict, call = self._verify(decision, call)
        return self._keep(self._execute(call, verdict, self._thought if waited is None else waited))

    @property
    def _thought(self) -> int:
        """Half seconds that the world goes on for the time of thinking, as far as steps are left for them."""
        if self._clock == "paused":
            return 0
        seconds = sum(self._step.seconds.get(part, 0.0) for part in ("decide", "verify"))
        return min(int(seconds * FPS / FUTURE), self.spec.max_steps - spent(self.steps) - 1)

    def _answered(self, part: str, usage: Usage) -> None:
        """Enter the time and cost of an answer. Raises LimitError if a limit has been crossed."""
        self._step.answered(part)
        self._meter.add(usage)
        self._meter.check()

    def _refuse(self, decision: Decision, error: str) -> StepRecord | Refusal:
        self._step.attempts.append(Attempt(decision, error))
        self._feedback = Feedback(refusal=error)
        left = self._max_attempts - len(self._step.attempts)
        return Refusal(error, left) if left else self._keep(self._measure(self.body.state()))

    def _verify(self, decision: Decision, call: Call) -> tuple[Verdict | None, Call]:
        """Return the verdict, if there is a verifier, and the call to execute."""
        if self._agents.verifier is None:
            return None, call
        skills = self.body.skills
        self._question()
        observation = self._seen(self._look(), Feedback())
        verdict = self._agents.verify(observation, call, skills[call.skill], decision.mid_level_goal)
        self._answered("verify", verdict.usage)
        return settled(verdict, call, skills)

    def _execute(self, call: Call, verdict: Verdict | None, waited: int) -> StepRecord:
        """Execute a call. An active stop ends the episode without motion."""
        before = self.body.state()
        if self.body.skills[call.skill].role == "stop":
            return self._measure(before, call, verdict)
        self._cancelling, self._between = False, []
        done = self.body.execute(call, self._watch, waited)
        self._recording.move(*map(piece_of, done.chunks))
        self._step.seconds |= done.seconds
        return self._measure(done.before, call, verdict, done)

    def _watch(self, chunk: Chunk) -> bool:
        """Call the observers of a chunk, and keep views for an agent that asks. Returns whether the call goes on."""
        if count := self._agents.views_between:
            self._between += [jpeg(view.rgb, QUALITY) for view in self.body.views_during(chunk, count)]
        self.body.plugins.tell("humanclaw_chunk", episode=self.record, step=len(self._recording.steps), chunk=chunk)
        return not (self._cancelling or self._stopping)

    def _measure(
        self,
        before: WorldState,
        call: Call | None = None,
        verdict: Verdict | None = None,
        done: SkillExecution | None = None,
    ) -> StepRecord:
        """Return the record of the current step: of a call with its motion, or of no call."""
        resting = self._recording.steps[-1].pelvis_contacts if self._recording.steps else ()
        return self._step.record(
            self._look(), self.body.scene, self.spec.target_ids, before, self.body.state(),
            call=call, verdict=verdict, done=done, resting=resting, geodesic=self.distance_to_goal(),
            partner=self.spec.partner is not None,
        )  # fmt: skip

    def _keep(self, step: StepRecord, replayed: bool = False) -> StepRecord:
        """Finish a step: record it, remember it, call the observers."""
        self._recording.keep(step)
        self._feedback = step.feedback
        view = self._look().rgb
        frame = self._recording.folder / step.frame_file if self._recording.folder and step.frame_file else None
        self._history.append(HistoryEntry(step.step, step.decision, step.feedback, view), frame)
        self._step = Step(len(self._recording.steps))
        self.body.plugins.tell("humanclaw_step", episode=self.record, step=step, view=view)
        if not replayed and self._recording.is_over:
            self._close()
        return step

    # -- replay --------------------------------------------------------------------------------------------------------
    def _open(self, replay: Sequence[StepRecord]) -> None:
        """Execute the recorded steps and open the record, which a fault of the agents or the last step may close."""
        with self._closing():
            with self._agents.noting():
                for step in () if self.fault else replay:
                    self._replay_step(step)
            self._recording.open()
        if self.fault:
            self._end_by(self.fault)
        elif self._recording.is_over:
            self._close()

    def _replay_step(self, step: StepRecord) -> None:
        """Execute a recorded step again, to restore body, history and trajectory."""
        self._look()
        if step.call and step.status != "stopped":
            left = iter(range(step.chunks - 1, -1, -1))
            done = self.body.execute(step.call, lambda chunk: next(left) > 0, step.waited)
            self._recording.move(*map(piece_of, done.chunks))
        check_place(step, self.body.state(), self.spec)
        self._meter.add(step.usage)
        self._keep(step, replayed=True)

    # -- the end -------------------------------------------------------------------------------------------------------
    @contextmanager
    def _closing(self) -> Iterator[None]:
        """Close the record if the block raises, and raise again."""
        try:
            yield
        except BaseException as fault:
            self._end_by(fault)
            raise

    def _end_by(self, fault: BaseException | None) -> None:
        if isinstance(fault, PluginRunError):
            self._agents.fault = fault
        # An agent's PluginError ends the run. After the first step it also ends the episode: a resumed run would
        # otherwise play it again. A provider that serves no more requests is no failure of the agent.
        own = isinstance(fault, PluginError) and not isinstance(fault, ProviderError)
        if own and self._agents.refusal and self._recording.steps:
            self._close("plugin_error", self._agents.refusal)
        self._close(*ending(fault))

    def _close(self, outcome: Outcome | None = None, error: str = "", limit: str = "") -> None:
        """Write the end of the record, once. outcome: by default the one that follows from the steps."""
        if self.outcome != "running":
            return
        counted = {"usage": self._meter.episode, "steps": len(self._recording.steps)}
        outcome = outcome or self._recording.outcome
        self._recording.end(self.record.ended(outcome, error, limit=limit, **counted))
        self._agents.dismiss()
        self.body.plugins.tell("humanclaw_episode_end", episode=self.record, folder=self._recording.folder)
