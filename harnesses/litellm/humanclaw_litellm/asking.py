"""Structured answers from any model: by tools, by a JSON schema, or by instructions in the prompt."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from humanclaw import ProviderError
from humanclaw_litellm.client import Client, Completion
from humanclaw_litellm.failures import RefusalError
from humanclaw_litellm.settings import Mode, ModelError, Settings

Json = dict[str, Any]


@dataclass(frozen=True)
class AnswerFormat:
    """The form of an answer: a call of one of these tools, in OpenAI's format, or one object of this schema."""

    tools: tuple[Json, ...]
    schema: Json

    def request(self, mode: Mode) -> Json:
        """Return the parameters of a request that asks for this form."""
        if mode == "prompt":
            return {}
        if mode == "schema":
            named = {"name": "answer", "schema": self.schema}
            return {"response_format": {"type": "json_schema", "json_schema": named}}
        return {"tools": list(self.tools), **({"tool_choice": "required"} if mode == "tools" else {})}


@dataclass(frozen=True)
class Reply:
    """An answer, the mode of its request, and the digest of the messages and parameters sent."""

    completion: Completion
    mode: Mode
    prompt_digest: str

    @property
    def raw(self) -> str:
        """The answer as received, as JSON."""
        calls = [{"name": name, "arguments": arguments} for name, arguments in self.completion.calls]
        answer = {
            "mode": self.mode,
            "model": self.completion.model,
            "finish_reason": self.completion.finish_reason,
            "content": self.completion.text,
            "thoughts": self.completion.thoughts,
            "tool_calls": calls,
        }
        return json.dumps(answer, ensure_ascii=False)


class ModeNegotiator:
    """Finds the first mode in which a model can answer, together with all others that ask this model.

    The negotiator drops a mode when the provider refuses it, or when a complete reply of the model holds no answer. The
    first usable answer settles the mode.
    """

    def __init__(self, settings: Settings) -> None:
        self.client = Client(settings)
        self._learned = self.client.learned
        self._chosen: Mode | None = None if settings.mode == "auto" else settings.mode

    @property
    def mode(self) -> Mode:
        return self._chosen or self._learned.modes[0]

    def ask(self, form: AnswerFormat, messages: Callable[[Mode], list[Json]]) -> Reply:
        """Ask for an answer. messages: returns the conversation for a mode.

        Raises ProviderError, TooLongError, and ModelError if the provider refuses every mode.
        """
        while True:
            mode = self.mode
            sent, request = messages(mode), form.request(mode)
            try:
                return Reply(self.client.complete(sent, request), mode, _digest(sent, request))
            except RefusalError as refusal:
                self._refused(mode, str(refusal))

    def report(self, reply: Reply, understood: bool) -> None:
        """Learn from a reply. understood: whether it held a usable answer."""
        completion, learned = reply.completion, self._learned
        if self._chosen or learned.settled:
            return
        if understood:
            learned.settled = True
        elif not (completion.calls or completion.cut_off or completion.withheld) and len(learned.modes) > 1:
            # A model that writes text although it must use tools will not use them voluntarily: both modes go.
            tools = ("tools", "tools_auto")
            dropped = tools if reply.mode in tools else (reply.mode,)
            learned.modes = [mode for mode in learned.modes if mode not in dropped]

    def _refused(self, mode: Mode, reason: str) -> None:
        learned = self._learned
        if learned.worked if self._chosen else learned.settled:
            raise ProviderError(f"the provider refused a request: {reason}")
        if self._chosen or learned.modes == [mode]:
            hint = "Check that the server serves this model, or name another."
            hint += " Parameters of the request are --option params, temperature and max_tokens."
            raise ModelError(f"the provider refuses the requests: {reason}.", hint)
        learned.modes = [other for other in learned.modes if other != mode]


class Asker:
    """The part of an agent and of a verifier that asks a model."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._negotiator = ModeNegotiator(settings)

    @property
    def settings(self) -> Json:
        return self._negotiator.client.in_force

    def ready(self, instruction: str) -> None:
        """Raise ModelError if the model's name, key or environment rules out any request. None is made."""
        self._negotiator.client.begin(None)


def _digest(messages: list[Json], request: Json) -> str:
    return hashlib.sha256(json.dumps([messages, request], sort_keys=True, default=str).encode()).hexdigest()
