"""Structured answers from any model: by tools, by a JSON schema, or by instructions in the prompt."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, get_args

from humanclaw import Meter, ProviderError
from humanclaw_litellm.client import Client, Completion
from humanclaw_litellm.failures import RefusalError
from humanclaw_litellm.settings import Mode, ModelError, Settings

Json = dict[str, Any]
ModeCache = dict[tuple[str, str], Mode]
"""Model and address to the mode that worked; shared by the agents and verifiers of one set of plugins."""
MODES: Final[tuple[Mode, ...]] = get_args(Mode)


@dataclass(frozen=True)
class Form:
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
        must = {"tool_choice": "required"} if mode == "tools" else {}
        return {"tools": list(self.tools), **must, "parallel_tool_calls": False}


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
    """Finds the first mode in which a model can answer, keeps it, and caches it for others that ask this model.

    The negotiator drops a mode when the provider refuses it, or when a complete text of the model holds no answer. The
    first usable answer settles the mode.
    """

    def __init__(self, settings: Settings, cache: ModeCache | None = None) -> None:
        self._client = Client(settings)
        self._cache: ModeCache = {} if cache is None else cache
        self._key = (settings.model, settings.api_base)
        known = [self._cache[self._key]] if self._key in self._cache else list(MODES)
        self._left: list[Mode] = known if settings.mode == "auto" else [settings.mode]
        self._chosen = settings.mode != "auto"
        self._settled = not self._chosen and self._key in self._cache

    @property
    def mode(self) -> Mode:
        return self._left[0]

    def begin(self, meter: Meter | None) -> None:
        """Begin an episode within these limits. Raises ModelError if the model cannot be reached."""
        self._client.begin(meter or Meter())

    def ask(self, form: Form, messages: Callable[[Mode], list[Json]]) -> Reply:
        """Ask for an answer. messages: returns the conversation for a mode.

        Raises ProviderError, and ModelError if the provider refuses every mode.
        """
        while True:
            sent, request = messages(self.mode), form.request(self.mode)
            try:
                return Reply(self._client.complete(sent, request), self.mode, _digest(sent, request))
            except RefusalError as refusal:
                self._refused(str(refusal))

    def report(self, reply: Reply, understood: bool) -> None:
        """Learn from a reply. understood: whether it held a usable answer."""
        completion = reply.completion
        said_something = bool(completion.text.strip()) and not (
            completion.calls or completion.cut_off or completion.withheld
        )
        if understood:
            self._settled = True
            if not self._chosen:
                self._cache[self._key] = reply.mode
        elif said_something and not self._settled and len(self._left) > 1:
            # A model that writes text although it must use tools will not use them voluntarily: both modes go.
            tools = ("tools", "tools_auto")
            self._left = [
                mode for mode in self._left if mode != reply.mode and (reply.mode not in tools or mode not in tools)
            ]

    def _refused(self, reason: str) -> None:
        if self._settled:
            raise ProviderError(f"the provider refused a request: {reason}")
        if len(self._left) == 1:
            raise ModelError(
                f"the provider refuses the requests: {reason}.", "Use a model that takes pictures, or other params."
            )
        self._left.pop(0)


def _digest(messages: list[Json], request: Json) -> str:
    return hashlib.sha256(json.dumps([messages, request], sort_keys=True, default=str).encode()).hexdigest()
