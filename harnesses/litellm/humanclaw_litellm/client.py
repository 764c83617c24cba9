"""Requests to a model's provider, through litellm, with retries, a rate limit and a deadline.

Only this module retries. Retries of litellm and of the provider's client are off, so the number of requests is the one
that the options ask for.
"""

from __future__ import annotations

import json
import logging
import os
import re
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future, TimeoutError as FutureTimeoutError
from dataclasses import dataclass
from typing import Any, Final

import tenacity

from humanclaw import LimitError, Meter, ProviderError
from humanclaw.cli import legible
from humanclaw.records import Usage
from humanclaw_litellm.accounting import price_of, tokens_sent, usage_of
from humanclaw_litellm.failures import (
    NoAnswerError,
    RefusalError,
    TooSlowError,
    is_refusal,
    is_transient,
    message_of,
    redirect,
    retry_after,
    unusable,
    wants_stream,
)
from humanclaw_litellm.library import WebPageError, load, missing_keys
from humanclaw_litellm.rates import Gate
from humanclaw_litellm.redaction import redact
from humanclaw_litellm.settings import ModelError, Settings

Json = dict[str, Any]
_LOG: Final = logging.getLogger(__name__)
_LONGEST_BACKOFF: Final = 60.0
_LONGEST_RETRY_AFTER: Final = 600.0
_SHORTEST_TIMEOUT: Final = 0.05
_GRACE: Final = 0.25
_HINTS: Final = frozenset({"parallel_tool_calls"})
_BREAKS: Final = re.compile(r"[\t\n\r]+")
_LONGEST_NAME: Final = 200
_ANSWER: Final = 300
"""Tokens reserved for an answer before the first one has come."""


@dataclass(frozen=True)
class Completion:
    """A model's answer."""

    text: str
    calls: tuple[tuple[str, str], ...]
    """Name and arguments of every tool call; the arguments are JSON as received."""
    finish_reason: str
    thoughts: str
    model: str
    """The name that the provider gives in its reply."""
    usage: Usage

    @property
    def cut_off(self) -> bool:
        return self.finish_reason == "length"

    @property
    def withheld(self) -> bool:
        """Whether the provider's filter withheld the answer or a part of it."""
        return self.finish_reason == "content_filter"


class Client:
    """One model at one provider."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._worked = False
        self._streams = settings.stream
        self._gate = Gate.of(settings)
        self._answer = settings.max_tokens or _ANSWER
        self._meter = Meter()

    def begin(self, meter: Meter) -> None:
        """Begin an episode within these limits.

        Raises ModelError if the model's name, key or environment rules out any request, and if money is limited but
        the model has no known price.
        """
        self._meter = meter
        self._check_name()
        self._check_key()
        # Checked before the first request: afterwards the money would already be spent.
        if meter.limits_money() and price_of(self._settings) is None:
            hint = 'Give prices: --option \'params={"input_cost_per_token": 1e-6, "output_cost_per_token": 4e-6}\'.'
            raise ModelError(
                f"a limit in usd cannot be kept: no price is known for model {self._settings.model!r}.", hint
            )

    def _check_name(self) -> None:
        settings = self._settings
        try:
            load().get_llm_provider(settings.model, api_base=settings.api_base or None)
        except Exception:
            hint = (
                "Write provider/name, such as openai/gpt-4o-mini; for a server of your own openai/NAME with api_base."
            )
            raise ModelError(f"no provider is known for model {settings.model!r}.", hint) from None

    def _check_key(self) -> None:
        settings = self._settings
        self._key()
        missing = self._missing_keys()
        if missing and not settings.api_base:
            hint = f"Set {missing[0]}, or name a server of your own with api_base."
            raise ModelError(f"model {settings.model!r} needs a key and {missing[0]} is not set.", hint)

    def complete(self, messages: list[Json], request: Mapping[str, Any]) -> Completion:
        """Send one request, and retry it after transient failures.

        Raises ProviderError if the retries fail, RefusalError if the provider refuses this form of request, ModelError
        if this client's first request shows that the key or the model is wrong, and LimitError if time runs out.
        """
        try:
            response = self._retrying()(self._request, messages, request)
        except LimitError:
            raise
        except Exception as error:
            self._meter.check()  # A timeout shortened by a limit counts as the limit.
            if self._may_stream(error) and (completion := self._in_pieces(messages, request)):
                return completion
            raise self._sorted(error) from None  # The cause may hold the key.
        self._worked = True
        completion = self._completion(response, messages, request)
        self._settle(completion.usage, tokens_sent(messages, request) + self._answer)
        return completion

    def _in_pieces(self, messages: list[Json], request: Mapping[str, Any]) -> Completion | None:
        """Stream from now on; None if the server cannot stream either."""
        self._streams = True
        try:
            return self.complete(messages, request)
        except ModelError:
            self._streams = False
            return None

    def _may_stream(self, error: Exception) -> bool:
        return not (self._streams or self._worked) and wants_stream(error)

    def _settle(self, usage: Usage, reserved: int) -> None:
        self._gate.settle(usage.tokens_in + usage.tokens_out - reserved)
        self._answer = usage.tokens_out  # The next answer is expected to be about as long.

    def _wait_for_turn(self, tokens: int) -> None:
        """Wait until the rate limit allows the request. Raises LimitError if time runs out meanwhile."""
        wait = self._gate.enter(tokens)
        if wait > 0:
            time.sleep(min(wait, self._meter.seconds_left()))
        self._meter.check()

    def _request(self, messages: list[Json], request: Mapping[str, Any]) -> Any:
        self._meter.check()
        self._wait_for_turn(tokens_sent(messages, request) + self._answer)
        settings = self._settings
        optional = {"api_base": settings.api_base, "api_key": self._key()}
        chosen = {"temperature": settings.temperature, "max_tokens": settings.max_tokens}
        known = load().get_supported_openai_params(settings.model) or ()
        seconds = max(_SHORTEST_TIMEOUT, min(settings.timeout, self._meter.seconds_left()))
        response = _within(
            seconds,
            _streamed if self._streams else load().completion,
            model=settings.model,
            messages=messages,
            timeout=seconds,
            num_retries=0,  # of litellm
            max_retries=0,  # of the provider's client
            drop_params=False,  # Parameters are sent or refused, never dropped silently; only _HINTS may be dropped.
            **{key: value for key, value in optional.items() if value},
            **{key: value for key, value in chosen.items() if value is not None},
            **({key: value for key, value in request.items() if key not in _HINTS or key in known} | settings.params),
        )
        if not response.choices:
            raise NoAnswerError("the reply held no choices")
        return response

    def _retrying(self) -> tenacity.Retrying:
        return tenacity.Retrying(
            stop=tenacity.stop_after_attempt(self._settings.num_retries + 1),
            wait=self._wait,
            retry=tenacity.retry_if_exception(is_transient),
            before_sleep=self._warn,
            reraise=True,
        )

    def _wait(self, state: tenacity.RetryCallState) -> float:
        """Return the seconds to wait: exponential with jitter, at least as the provider asks, at most the time left."""
        first = self._settings.backoff
        spread = (tenacity.wait_exponential(multiplier=first) + tenacity.wait_random(0, first))(state)
        asked = min(retry_after(state.outcome.exception() if state.outcome else None), _LONGEST_RETRY_AFTER)
        if asked:
            self._gate.close(asked)  # All workers wait: the provider would refuse them too.
        pause = max(min(spread, _LONGEST_BACKOFF), asked)
        return min(pause, self._meter.seconds_left())

    def _warn(self, state: tenacity.RetryCallState) -> None:
        error = state.outcome.exception() if state.outcome else None
        pause = state.next_action.sleep if state.next_action else 0.0
        _LOG.warning("%s: %s; next try in %.1f s", self._settings.model, self._tell(error or Exception()), pause)

    def _key(self) -> str:
        """Return the key to send; empty if litellm finds one by itself.

        "none" for a local server, which often needs no key although its client library does.
        """
        name = self._settings.auth_env
        if name and not os.environ.get(name, "").strip():
            raise ModelError(f"auth_env names {name}, which is not set.", f"Set {name}.")
        return os.environ[name] if name else "none" if self._settings.api_base and self._missing_keys() else ""

    def _missing_keys(self) -> list[str]:
        return [] if self._settings.auth_env else missing_keys(self._settings.model)

    # -- answers ----------------------------------------------------------------------------------------------------
    def _completion(self, response: Any, messages: list[Json], request: Mapping[str, Any]) -> Completion:
        choice = response.choices[0]
        message = choice.message
        called = getattr(message, "tool_calls", None) or ()
        calls = tuple(
            (self._redact(item.function.name or ""), self._redact(_as_text(item.function.arguments))) for item in called
        )
        text = self._redact(getattr(message, "content", None) or "")
        thoughts = self._redact(getattr(message, "reasoning_content", None) or "")
        said = text + "".join(arguments for _, arguments in calls)
        usage = usage_of(response, self._settings, messages, request, said + thoughts)
        model = self._redact(str(response.model or ""))[:_LONGEST_NAME]
        return Completion(text, calls, str(choice.finish_reason or ""), thoughts, model, usage)

    # -- failures ---------------------------------------------------------------------------------------------------
    def _sorted(self, error: Exception) -> Exception:
        """Turn an error into the exception that the caller gets."""
        if isinstance(error, ModelError):
            return error
        if elsewhere := redirect(error):
            return self._redirected(elsewhere)
        if reply := unusable(error):
            told = f"{self._where()} gave no answer: {reply}"
            wrong = isinstance(reply, WebPageError) and not self._worked
            return ModelError(f"{told}.", "Check api_base; it often ends in /v1.") if wrong else ProviderError(told)
        told = self._tell(error)
        if is_refusal(error):
            return RefusalError(told)
        # A key or name that worked before is right, so the fault must be the provider's.
        mendable = None if self._worked else self._mendable(getattr(error, "status_code", None), told)
        return mendable or ProviderError(f"{self._where()} gave no answer: {told}")

    def _tell(self, error: BaseException) -> str:
        """Return the provider's message on one line of at most 300 characters, without secrets."""
        return _BREAKS.sub(" ", legible(self._redact(message_of(error))))[:300].rstrip(". ")

    def _redact(self, text: str) -> str:
        return redact(text, os.environ.get(self._settings.auth_env, "") if self._settings.auth_env else "")

    def _where(self) -> str:
        base = self._settings.api_base
        return f"{self._settings.model} at {base}" if base else self._settings.model

    def _redirected(self, address: str) -> ModelError:
        told = f"{self._where()} sends requests on to {self._redact(address)}, where nothing was sent."
        return ModelError(told, "Name that address with api_base if prompt and picture may go there.")

    def _mendable(self, status: int | None, told: str) -> ModelError | None:
        model, server = self._settings.model, self._settings.api_base or "the provider"
        if status in (401, 403):
            return ModelError(f"{server} does not accept the key for {model}: {told}.", "Set the right key.")
        if status == 404:
            return ModelError(f"{server} does not know {model}: {told}.", "Check the model's name and api_base.")
        if "insufficient_quota" in told:
            return ModelError(f"the quota for {model} is used up: {told}.", "Top it up or use another key.")
        return None


def _within(seconds: float, ask: Callable[..., Any], **request: Any) -> Any:
    """Return the result of a call that takes at most `seconds` of wall time. Raises TooSlowError.

    A client's own timeout restarts with every byte that arrives. A request that is too slow is abandoned to its
    thread.
    """
    answer: Future[Any] = Future()

    def run() -> None:
        try:
            answer.set_result(ask(**request))
        except BaseException as error:
            answer.set_exception(error)

    threading.Thread(target=run, name="request", daemon=True).start()
    try:
        # The client's own timeout gets a head start: its error says more.
        return answer.result(seconds + _GRACE)
    except FutureTimeoutError:
        if answer.done():
            raise
        raise TooSlowError(f"no answer within {seconds:.3g} s") from None


def _streamed(**request: Any) -> Any:
    """Request a stream and assemble the answer, without the token count that litellm makes up if none came."""
    stream = load().completion(**request, stream=True, stream_options={"include_usage": True})
    pieces = list(stream)
    if getattr(stream, "received_finish_reason", "") is None:  # litellm would invent one.
        raise NoAnswerError("the reply broke off before its end")
    whole = load().stream_chunk_builder(pieces, messages=request["messages"])
    if whole is None:
        raise NoAnswerError("the reply held no pieces")
    counted = load().token_counter(model=pieces[0].model, messages=request["messages"])
    # A count that equals litellm's own estimate is that estimate.
    if getattr(getattr(whole, "usage", None), "prompt_tokens", counted) == counted:
        whole.usage = None
    return whole


def _as_text(arguments: Any) -> str:
    """Return arguments as JSON text; some providers send an object."""
    return arguments if isinstance(arguments, str) else json.dumps(arguments or {})
