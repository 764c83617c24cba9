"""The agent: a vision-language model that plans from high to mid to low level (paper, section 3.2)."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass

from humanclaw import (
    Call,
    CallError,
    Decision,
    EpisodeContext,
    HistoryEntry,
    HumanclawError,
    LimitError,
    Observation,
    Skill,
    model_tools,
    step_content,
    system_message,
    system_prompt,
)
from humanclaw.skills import Json, Reasoning, answer_schema, read_call, read_text
from humanclaw_litellm.asking import AnswerFormat, Asker, Reply
from humanclaw_litellm.client import Completion
from humanclaw_litellm.failures import TooLongError
from humanclaw_litellm.settings import Mode, ModelError, Settings


@dataclass(frozen=True)
class _Episode:
    context: EpisodeContext
    skills: tuple[Skill, ...]
    form: AnswerFormat


class ModelAgent(Asker):
    """Asks a model for one call per step.

    An answer without a call is still a Decision; the loop explains the fault to the model.
    """

    privileged = False

    def __init__(self, settings: Settings) -> None:
        super().__init__(settings)
        self.name = settings.model
        self._episode: _Episode | None = None
        self._note = ""
        self._room = sys.maxsize
        """The most past steps that fit into the model's context, as far as this episode has shown."""

    def begin(self, context: EpisodeContext) -> None:
        """Begin an episode. Raises ModelError if the model cannot be reached or if there is no skill to call."""
        self._negotiator.client.begin(context.meter)
        skills, settings = usable(context), self._settings
        asked: Json = {"mid_level": settings.mid_level, "described": False, "optional": settings.optional}
        form = AnswerFormat(tuple(model_tools(skills, settings)), answer_schema(skills, **asked))
        self._episode, self._note, self._room = _Episode(context, skills, form), "", sys.maxsize

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        """Ask the model for a decision. Past steps that do not fit into its context are dropped, oldest first.

        Raises ProviderError if the provider gives no answer, ModelError if it rejects the model or the key, and
        LimitError if a step alone does not fit.
        """
        if self._episode is None:
            raise HumanclawError("an agent must begin an episode before it decides.", "Call begin first.")
        wanted = len(history) - self._settings.first_told(len(history))
        while True:
            shown = min(wanted, self._room)
            try:
                reply = self._ask(self._episode, observation, history, shown if shown < wanted else None)
                break
            except TooLongError as fault:
                if not shown:
                    raise LimitError("episode", _no_room(observation.step, fault)) from None
                self._room = shown // 2
        calls, self._note = read(reply.completion, prose=not reply.mode.startswith("tools"))
        self._negotiator.report(reply, bool(calls))
        return _decision(calls, reply, wanted - shown, self._negotiator.client.left_out)

    def _ask(
        self, episode: _Episode, observation: Observation, history: Sequence[HistoryEntry], shown: int | None
    ) -> Reply:
        """Ask about a step. shown: number of past steps in the prompt; None for as many as the settings say."""
        settings = self._settings
        if shown is not None:
            fewer = {"history": shown, "history_slack": 0, "images": min(settings.images, shown + 1)}
            settings = settings.model_copy(update=fewer)
        content = step_content(episode.context, observation, history, self._note, settings)

        def messages(mode: Mode) -> list[Json]:
            schema = episode.form.schema if mode in ("schema", "prompt") else None
            system = system_prompt(episode.context, episode.skills, settings, schema)
            return [system_message(system, settings), {"role": "user", "content": content}]

        return self._negotiator.ask(episode.form, messages)


def _no_room(step: int, fault: TooLongError) -> str:
    why = f"step {step + 1} alone, without past steps (--history 0), does not fit the model's context window: {fault}."
    return f"{why} Use a model or a server with a larger window, or a shorter answer (max_tokens)."


def usable(context: EpisodeContext) -> tuple[Skill, ...]:
    """Return the trained skills. Raises ModelError if there is none."""
    skills = tuple(skill for skill in context.skills.values() if skill.trained)
    if not skills:
        raise ModelError("no installed skill has a trained adapter.", "Install skills or train their adapters.")
    return skills


def read(completion: Completion, prose: bool = True) -> tuple[tuple[tuple[Reasoning, Call], ...], str]:
    """Return every call of an answer, or the reason why it holds none. A broken answer is never repaired.

    prose: whether words may stand before a call written as text, as for a model without tools.
    """
    if completion.cut_off:
        # Even a call that looks whole may lack its last parameters: some providers close open brackets.
        return (), "The last answer was cut off before its call was complete: be brief."
    if completion.withheld:
        return (), "The last answer was withheld by the provider's filter."
    if completion.calls:
        return _read_calls(completion)
    try:
        return tuple(read_text(completion.text, prose)), ""
    except CallError as fault:
        return (), str(fault) if "{" in completion.text else ""


def _read_calls(completion: Completion) -> tuple[tuple[tuple[Reasoning, Call], ...], str]:
    """Read tool calls. An unreadable one among several still counts, so that no other is executed in its place."""
    calls, faults = [], []
    for name, arguments in completion.calls:
        try:
            calls.append(read_call(name, arguments))
        except CallError as fault:
            faults.append(str(fault))
            calls.append((Reasoning(), Call(name)))
    return (() if faults and len(calls) == 1 else tuple(calls)), " ".join(faults)


def _decision(
    calls: Sequence[tuple[Reasoning, Call]], reply: Reply, dropped: int, left_out: tuple[str, ...]
) -> Decision:
    said = calls[0][0] if calls else Reasoning()
    return Decision(
        tuple(call for _, call in calls),
        **vars(said),
        raw=reply.raw,
        prompt_digest=reply.prompt_digest,
        usage=reply.completion.usage,
        dropped_steps=dropped,
        left_out=left_out,
    )
