"""Requests to a model's provider, through litellm, with retries, a rate limit and a deadline.

Only this module retries. Retries of litellm and of the provider's client are off, so the number of requests is the one
that the options ask for.
"""

from __future__ import annotations

import json
import logging
import os
import re
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, get_args

import tenacity

from humanclaw import Meter, ProviderClosedError, ProviderError
from humanclaw.cli import legible
from humanclaw.records import Usage
from humanclaw.skills import split_thoughts
from humanclaw_litellm.failures import FailedRequest, RefusalError, TooLongError, UnservedRequest
from humanclaw_litellm.litellm_setup import complete, load, missing_key
from humanclaw_litellm.rates import RateLimiter
from humanclaw_litellm.redaction import redact
from humanclaw_litellm.settings import Mode, ModelError, Settings
from humanclaw_litellm.usage import price_of, text_tokens_sent, tokens_sent, usage_of

Json = dict[str, Any]
MODES: Final[tuple[Mode, ...]] = get_args(Mode)
_LOG: Final = logging.getLogger(__name__)
_LONGEST_BACKOFF: Final = 60.0  # Seconds: providers count requests by the minute.
_LONGEST_WAIT: Final = 600.0  # Seconds: all workers wait, and a wait of days would look like a hang.
_STARTING: Final = 5.0  # Seconds: waits double, so the last try comes within ten.
_BREAKS: Final = re.compile(r"[\t\n\r]+")
_LONGEST_NAME: Final = 200  # Characters: records hold the name that a provider gives, whatever it sends.
_ANSWER: Final = 300
"""Tokens reserved for an answer before the first one has come."""
_ROOM: Final = 2048
"""Tokens of Ollama's context window for an answer without max_tokens."""
_WINDOW: Final = 8192
"""Tokens of the smallest window that Ollama is asked for. A change loads the model again, so it only doubles."""
_UNREADABLE: Final = "unreadable: "
"""No JSON begins so: a call with these arguments is refused wherever it is read."""
_PRICES: Final = 'params={"input_cost_per_token": 1e-6, "output_cost_per_token": 4e-6}'


@dataclass(frozen=True)
class Completion:
    """A model's answer."""

    text: str
    """What the model said, without thoughts."""
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


@dataclass
class Learned:
    """What requests have shown of a model. All agents and verifiers of this process that ask it share one."""

    modes: list[Mode] = field(default_factory=lambda: list(MODES))
    """The ways of asking that are left to try; the first one is in use."""
    settled: bool = False
    """Whether that way has brought a usable answer."""
    worked: bool = False
    left_out: list[str] = field(default_factory=list)
    """Parameters that the model has refused."""
    renamed: bool = False
    """Whether max_tokens is sent as max_completion_tokens, as the provider asks."""
    priced: bool | None = None
    """Whether a price is known; None before the first episode."""
    window: int = _WINDOW
    warned: set[str] = field(default_factory=set)

    @classmethod
    def of(cls, settings: Settings) -> Learned:
        return _LEARNED.setdefault((settings.model, settings.api_base, settings.auth_env), cls())

    def warn(self, kind: str, text: str) -> None:
        """Log a warning, once for each kind."""
        if kind not in self.warned:
            self.warned.add(kind)
            _LOG.warning(text)


_LEARNED: Final[dict[tuple[str, str, str], Learned]] = {}


class Client:
    """One model at one provider."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self.learned = Learned.of(settings)
        self._limiter = RateLimiter.of(settings)
        self._answer = settings.max_tokens or _ANSWER
        self._meter = Meter()

    @property
    def in_force(self) -> Json:
        """The settings as JSON values, and whether a price is known. They hold no key."""
        return {**self._settings.model_dump(mode="json"), "priced": self.learned.priced}

    @property
    def left_out(self) -> tuple[str, ...]:
        """The parameters among the settings that the model has refused."""
        return tuple(name for name in self.learned.left_out if name in self._chosen())

    def begin(self, meter: Meter | None) -> None:
        """Begin an episode within these limits.

        Raises ModelError if the model's name, key or environment rules out any request, and if money is limited but
        the model has no known price.
        """
        self._meter = meter or Meter()
        self._check_name()
        self._key()
        self._check_price()
        listed = load().model_cost.get(self._settings.model, {})
        if self._settings.images and listed.get("mode") == "chat" and not listed.get("supports_vision"):
            warning = f"litellm lists {self._settings.model} without image input; --images 0 sends no picture"
            self.learned.warn("pictures", warning)

    def _check_name(self) -> None:
        settings = self._settings
        try:
            load().get_llm_provider(settings.model, api_base=settings.api_base or None)
        except Exception:
            hint = (
                "Write provider/name, such as openai/gpt-4o-mini; for a server of your own openai/NAME with api_base."
            )
            raise ModelError(f"no provider is known for model {settings.model!r}.", hint) from None

    def _check_price(self) -> None:
        model, self.learned.priced = self._settings.model, price_of(self._settings) is not None
        if self.learned.priced:
            return
        # Checked before the first request: afterwards the money would already be spent.
        if self._meter.limits_money():
            hint = f"Give prices: --option '{_PRICES}', or usd_per_million of a model in a study's file."
            raise ModelError(f"a limit in usd cannot be kept: no price is known for model {model!r}.", hint)
        if not self._settings.api_base and not model.startswith("ollama"):
            warning = f"no price is known for model {model!r}: its cost is recorded as 0; give --option '{_PRICES}'"
            self.learned.warn("price", warning)

    def _key(self) -> str:
        """Return the key to send; empty if litellm finds one by itself. Raises ModelError if it is missing.

        "none" for a local server, which often needs no key although its client library does.
        """
        if name := self._settings.auth_env:
            if key := os.environ.get(name, "").strip():
                return key
            raise ModelError(f"auth_env names {name}, which is not set.", f"Set {name}.")
        missing = missing_key(self._settings.model)
        if missing and not self._settings.api_base:
            hint = f"Set {missing}, or name a server of your own with api_base."
            raise ModelError(f"model {self._settings.model!r} needs a key and {missing} is not set.", hint)
        return "none" if missing else ""

    # -- requests ---------------------------------------------------------------------------------------------------
    def complete(self, messages: list[Json], request: Mapping[str, Any]) -> Completion:
        """Send one request, and retry it after transient failures and without a parameter that the model refuses.

        Raises ProviderError if the retries fail, RefusalError if the provider refuses this form of request,
        TooLongError if it does not fit the model's context, ModelError if no request can succeed, ProviderClosedError
        if none can succeed any more, and LimitError if time runs out.
        """
        while True:
            try:
                response = self._retrying()(self._request, messages, request)
            except FailedRequest as failure:
                self._meter.check()  # A timeout shortened by a limit counts as the limit.
                if failure.filtered:
                    return Completion("", (), "content_filter", "", "", Usage(estimated=True))
                if not self._leaves_out(failure):
                    raise self._sorted(failure) from None  # The cause may hold the key.
            else:
                self.learned.worked = True
                return self._completion(response, messages, request)

    def _request(self, messages: list[Json], request: Mapping[str, Any]) -> Any:
        self._meter.check()
        self._wait_for_turn(tokens_sent(messages, request) + self._answer)
        settings = self._settings
        where = {"api_base": settings.api_base, "api_key": self._key()}
        try:
            return complete(
                min(settings.timeout, self._meter.seconds_left()),
                model=settings.model,
                messages=messages,
                num_retries=0,  # of litellm
                max_retries=0,  # of the provider's client
                drop_params=False,  # A refused parameter is left out and recorded, never dropped silently.
                **{key: value for key, value in where.items() if value},
                **self._window(messages, request),
                **{**request, **self._optional(request)},
            )
        except FailedRequest as failure:
            self._book(failure, messages, request)
            raise

    def _book(self, failure: FailedRequest, messages: list[Json], request: Mapping[str, Any]) -> None:
        """Book the tokens of a generation that failed: they count for limits, and belong to no step."""
        if failure.reply is not None:
            self._meter.add(usage_of(failure.reply, self._settings, messages, request, ""))

    def _chosen(self) -> Json:
        """Return the parameters that the user chose."""
        chosen = {"temperature": self._settings.temperature, "max_tokens": self._settings.max_tokens}
        return {**{key: value for key, value in chosen.items() if value is not None}, **self._settings.params}

    def _optional(self, request: Mapping[str, Any]) -> Json:
        """Return the parameters that can be left out, without those that the model has refused."""
        parallel = {} if "tools" not in request else {"parallel_tool_calls": False}
        wanted = {**parallel, **self._chosen()}
        names = {"max_tokens": "max_completion_tokens"} if self.learned.renamed else {}
        return {names.get(key, key): value for key, value in wanted.items() if key not in self.learned.left_out}

    def _leaves_out(self, failure: FailedRequest) -> bool:
        """Leave out or rename the first parameter that the provider says it does not take; return whether one is."""
        if not failure.refused or self._bounded(failure) or failure.too_long:
            return False
        names = [name for name in {**self._chosen(), "parallel_tool_calls": False} if name not in self.learned.left_out]
        places = {name: failure.refuses(name) for name in names}
        named = {name: place for name, place in places.items() if place is not None}
        if named:
            first = min(named, key=lambda name: named[name])
            if first == "max_tokens" and "max_completion_tokens" in failure.said and not self.learned.renamed:
                self.learned.renamed = True
                return True
            self.learned.left_out.append(first)
            note = f"{self._settings.model} does not take {first}, which is left out: {self._tell(failure)}"
            (_LOG.info if first == "parallel_tool_calls" else _LOG.warning)(note)
        return bool(named)

    def _bounded(self, failure: FailedRequest) -> str:
        """Return the parameter that the user set to a value out of its bounds; empty if there is none."""
        return next(filter(failure.bounds, self._chosen()), "")

    def _window(self, messages: list[Json], request: Mapping[str, Any]) -> Json:
        """Return the context window to ask Ollama for: by default it cuts long prompts silently."""
        if not self._settings.model.startswith("ollama") or "num_ctx" in self._settings.params:
            return {}
        while self.learned.window < tokens_sent(messages, request) + (self._settings.max_tokens or _ROOM):
            self.learned.window *= 2
        return {"num_ctx": self.learned.window}

    def _wait_for_turn(self, tokens: int) -> None:
        """Wait until the rate limit allows the request. Raises LimitError if time runs out meanwhile."""
        wait = self._limiter.enter(tokens)
        if wait > 0:
            time.sleep(min(wait, self._meter.seconds_left()))
        self._meter.check()

    def _retrying(self) -> tenacity.Retrying:
        return tenacity.Retrying(
            stop=self._gives_up,
            wait=self._pause,
            retry=tenacity.retry_if_exception(lambda error: isinstance(error, FailedRequest) and error.transient),
            before_sleep=self._tell_retry,
            reraise=True,
        )

    def _gives_up(self, state: tenacity.RetryCallState) -> bool:
        """Tell whether no further try is made. A server of this machine that has never answered is not waited for."""
        error = state.outcome.exception() if state.outcome else None
        unserved = isinstance(error, UnservedRequest) and not self.learned.worked
        soon = unserved and tenacity.stop_after_delay(_STARTING)(state)
        return soon or tenacity.stop_after_attempt(self._settings.num_retries + 1)(state)

    def _pause(self, state: tenacity.RetryCallState) -> float:
        """Return the seconds to wait: exponential with jitter, at least as the provider asks, at most the time left."""
        first = self._settings.backoff
        spread = (tenacity.wait_exponential(multiplier=first) + tenacity.wait_random(0, first))(state)
        error = state.outcome.exception() if state.outcome else None
        asked = min(error.wait, _LONGEST_WAIT) if isinstance(error, FailedRequest) else 0.0
        if asked:
            self._limiter.close(asked)  # All workers wait: the provider would refuse them too.
        return min(max(min(spread, _LONGEST_BACKOFF), asked), self._meter.seconds_left())

    def _tell_retry(self, state: tenacity.RetryCallState) -> None:
        error = state.outcome.exception() if state.outcome else None
        pause = state.next_action.sleep if state.next_action else 0.0
        _LOG.warning("%s: %s; next try in %.1f s", self._settings.model, self._tell(error), pause)

    # -- answers ----------------------------------------------------------------------------------------------------
    def _completion(self, response: Any, messages: list[Json], request: Mapping[str, Any]) -> Completion:
        choice = response.choices[0]
        called = getattr(choice.message, "tool_calls", None) or ()
        calls = tuple(map(self._call, called))
        if choice.finish_reason == "unreadable":
            calls = tuple((name, _UNREADABLE + arguments) for name, arguments in calls) or (("", _UNREADABLE),)
        inner, text = split_thoughts(self._redact(getattr(choice.message, "content", None) or ""))
        stated = self._redact(getattr(choice.message, "reasoning_content", None) or "")
        thoughts = "\n".join(filter(None, (stated, inner)))
        said = thoughts + text + "".join(arguments for _, arguments in calls)
        usage = usage_of(response, self._settings, messages, request, said)
        self._settle(usage, messages, request)
        model = self._redact(str(response.model or ""))[:_LONGEST_NAME]
        return Completion(text, calls, str(choice.finish_reason or ""), thoughts, model, usage)

    def _call(self, item: Any) -> tuple[str, str]:
        """Return name and arguments of a tool call; of one that calls no function, arguments that nobody can read."""
        function = getattr(item, "function", None)
        if function is None:
            return "", self._redact(f"{_UNREADABLE}{item}")
        return self._redact(str(function.name or "")), self._redact(_as_text(function.arguments))

    def _settle(self, usage: Usage, messages: list[Json], request: Mapping[str, Any]) -> None:
        """Correct the rate limiter by the tokens used, and warn if the server read far fewer than were sent."""
        used = usage.tokens_in + usage.tokens_out
        self._limiter.settle(used - tokens_sent(messages, request) - self._answer)
        self._answer = usage.tokens_out  # The next answer is expected to be about as long.
        sent = text_tokens_sent(messages, request)
        if not usage.estimated and usage.tokens_in < sent / 2:
            words = f"{self._where()} counted {usage.tokens_in} tokens of about {sent} that were sent: it may have cut"
            self.learned.warn("cut", f"{words} the prompt; give it a larger context window (Ollama: params num_ctx)")

    # -- failures ---------------------------------------------------------------------------------------------------
    def _sorted(self, failure: FailedRequest) -> Exception:
        """Turn a failure into the exception that the caller gets."""
        words, where = self._tell(failure), self._where()
        if failure.redirect:
            return ModelError(
                f"{where} sends requests on to {self._redact(failure.redirect)}, where nothing was sent.",
                "Name that address with api_base if prompt and picture may go there.",
            )
        if name := self._bounded(failure):
            bound = f"{self._settings.model} does not take {name}={self._chosen()[name]}: {words}."
            hint = f"Set {name} within this bound, or to none."
            return ProviderClosedError(bound, hint) if self.learned.worked else ModelError(bound, hint)
        if failure.too_long:
            return TooLongError(f"{where} says: {words}")
        if failure.about_pictures and not self.learned.worked:
            hint = "Name a model that takes pictures, or play without any: --images 0."
            return ModelError(f"{self._settings.model} takes no pictures: {words}.", hint)
        if mendable := self._mendable(failure, words):
            return ProviderClosedError(*mendable) if self.learned.worked else ModelError(*mendable)
        return RefusalError(words) if failure.refused else ProviderError(f"{where} gave no answer: {words}")

    def _mendable(self, failure: FailedRequest, words: str) -> tuple[str, str] | None:
        """Return what ends the run, and the remedy; None if another request may succeed."""
        model, server = self._settings.model, self._settings.api_base or "the provider"
        if failure.unpaid:
            return f"the quota for {model} is used up: {words}.", "Top it up or use another key."
        if failure.larger_than_rate:
            hint = "Raise the account's rate, or send less: --history, --images, max_tokens."
            return f"one request is larger than the rate that {server} allows {model}: {words}.", hint
        # Some gateways answer 403 to a single request that their filter refuses.
        if failure.status == 401 or (failure.status == 403 and not self.learned.worked):
            return f"{server} does not accept the key for {model}: {words}.", "Set the right key."
        if failure.status == 404 and not failure.refused:
            return f"{server} does not know {model}: {words}.", "Check the model's name and api_base."
        return None

    def _tell(self, failure: BaseException | None) -> str:
        """Return the provider's message on one line of at most 300 characters, without secrets."""
        return _BREAKS.sub(" ", legible(self._redact(str(failure))))[:300].rstrip(". ")

    def _redact(self, text: str) -> str:
        return redact(text, os.environ.get(self._settings.auth_env, "") if self._settings.auth_env else "")

    def _where(self) -> str:
        base = self._settings.api_base
        return f"{self._settings.model} at {base}" if base else self._settings.model


def _as_text(arguments: Any) -> str:
    """Return arguments as JSON text; some providers send an object."""
    return arguments if isinstance(arguments, str) else json.dumps(arguments or {})
