"""How to ask for structured answers: with tools, with a JSON schema, or with words, whichever the model can do."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, get_args

from humanclaw import Meter, ProviderError
from humanclaw_litellm.client import Client, Completion, RefusalError
from humanclaw_litellm.settings import Mode, ModelError, Settings

Json = dict[str, Any]
ModeCache = dict[tuple[str, str], Mode]
"""Model and address to the mode in which it answered; shared by all that one set of plugins makes."""
MODES: Final[tuple[Mode, ...]] = get_args(Mode)


@dataclass(frozen=True)
class Form:
    """What an answer looks like: one of these tools, in OpenAI's format, or else one object of this schema."""

    tools: tuple[Json, ...]
    schema: Json

    def request(self, mode: Mode) -> Json:
        """Return the parameters of a request that asks for it."""
        if mode == "prompt":
            return {}
        if mode == "schema":
            named = {"name": "answer", "schema": self.schema}
            return {"response_format": {"type": "json_schema", "json_schema": named}}
        must = {"tool_choice": "required"} if mode == "tools" else {}
        return {"tools": list(self.tools), **must, "parallel_tool_calls": False}


@dataclass(frozen=True)
class Reply:
    """An answer, the mode that it was asked for in, and the digest of all that was sent."""

    completion: Completion
    mode: Mode
    prompt_digest: str

    @property
    def raw(self) -> str:
        """The answer as it came, as JSON."""
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
    """Finds the first mode in which a model can answer, keeps to it, and remembers it for the next that asks this
    model.

    A mode is given up when the provider refuses it, or when the model says something complete that holds no answer. It
    is settled by the first answer that does.
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
        """messages: the conversation for a mode. Raises ProviderError, and ModelError if every mode is refused."""
        while True:
            sent, request = messages(self.mode), form.request(self.mode)
            try:
                return Reply(self._client.complete(sent, request), self.mode, _digest(sent, request))
            except RefusalError as refusal:
                self._refused(str(refusal))

    def report(self, reply: Reply, understood: bool) -> None:
        """Tell whether the reply held an answer."""
        completion = reply.completion
        said_something = bool(completion.text.strip()) and not (
            completion.calls or completion.cut_off or completion.withheld
        )
        if understood:
            self._settled = True
            if not self._chosen:
                self._cache[self._key] = reply.mode
        elif said_something and not self._settled and len(self._left) > 1:
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
