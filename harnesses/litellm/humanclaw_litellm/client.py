"""Requests to a model's provider: what is sent through litellm, what comes back, and what can go wrong.

Retries are made here alone (litellm and the provider's client make none), so that the number of requests is the one
asked for.
"""

from __future__ import annotations

import datetime
import email.utils
import json
import logging
import os
import re
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, TimeoutError as FutureTimeoutError
from dataclasses import dataclass
from typing import Any, Final

import tenacity

from humanclaw import LimitError, Meter, ProviderError
from humanclaw.records import Usage
from humanclaw.skills import json_objects
from humanclaw_litellm.accounting import price_of, tokens_sent, usage_of
from humanclaw_litellm.library import TooLongError, load, missing_keys
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
_NO_REFUSALS: Final = frozenset({"ContentPolicyViolationError", "ContextWindowExceededError"})
_PREFIXES: Final = re.compile(r"^(?:litellm\.\w+: |\w+(?:Error|Exception): |\w+Exception\w* ?\w* - )+")
_RETRY_DELAY: Final = re.compile(r'"retryDelay":\s*"([\d.]+)s"')
_UNREADABLE: Final = re.compile(
    "Error converting to valid response|Empty or invalid response from LLM endpoint|Invalid response object"
)
"""litellm's words for a reply that it could not read."""
_IN_PIECES: Final = re.compile(r"Received: ['\"]data:")
"""The same for one that came as server-sent events, unasked."""
_TRACE: Final = re.compile(r"\s*Traceback \(most recent call last\):.*", re.DOTALL)
_CONTROLS: Final = re.compile(r"[\x00-\x1f\x7f-\x9f]+")
"""What a terminal would not print but obey."""
_WANTS_STREAM: Final = re.compile(r"stream", re.IGNORECASE)
_LONGEST_NAME: Final = 200
_ANSWER: Final = 300
"""Tokens that an answer is thought to have before there was one."""
_REDIRECTS: Final = frozenset({301, 302, 303, 307, 308})
_CAUSES: Final = 8
"""So far back the causes of an error are looked at."""
_TRANSIENT: Final = frozenset({408, 409, 425, 429})


class RefusalError(Exception):
    """The provider understood the request and will not serve it in this form."""


class _TooSlowError(Exception):
    """The deadline has passed, whether or not bytes still trickle in."""

    status_code = 408


class _NoAnswerError(Exception):
    """A reply that is well-formed and holds no answer: no model said anything."""

    status_code = 502


@dataclass(frozen=True)
class Completion:
    """What a model answered."""

    text: str
    calls: tuple[tuple[str, str], ...]
    """Name and arguments, JSON as it came, of every tool call."""
    finish_reason: str
    thoughts: str
    model: str
    """The name that the provider answers by."""
    usage: Usage

    @property
    def cut_off(self) -> bool:
        return self.finish_reason == "length"

    @property
    def withheld(self) -> bool:
        """Whether the provider's filter kept the answer, or part of it, back."""
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
        """Keep to these limits. Raises ModelError if it is plain before any request that the model cannot be reached.

        Raises it also if money is limited and nobody knows what the model costs.
        """
        self._meter = meter
        self._check_name()
        self._check_key()
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
        """Ask once, trying again while the fault may pass.

        Raises ProviderError if it does not pass, RefusalError if the provider does not take a request of this form,
        ModelError if the first request ever shows that the key or the model is wrong, and LimitError if time runs out.
        """
        try:
            response = self._retrying()(self._request, messages, request)
        except LimitError:
            raise
        except Exception as error:
            self._meter.check()  # A timeout that a limit has set is the limit's doing.
            if self._may_stream(error) and (completion := self._in_pieces(messages, request)):
                return completion
            raise self._sorted(error) from None  # The cause may hold the key.
        self._worked = True
        completion = self._completion(response, messages, request)
        self._settle(completion.usage, tokens_sent(messages, request) + self._answer)
        return completion

    def _in_pieces(self, messages: list[Json], request: Mapping[str, Any]) -> Completion | None:
        """Ask for an answer in pieces, and from then on; None if the server knows no such thing either."""
        self._streams = True
        try:
            return self.complete(messages, request)
        except ModelError:
            self._streams = False
            return None

    def _may_stream(self, error: Exception) -> bool:
        """Whether the server gives answers in pieces alone, as it says, or by what it sends."""
        refused = getattr(error, "status_code", None) in (400, 405, 422) and _WANTS_STREAM.search(str(error))
        return not (self._streams or self._worked) and bool(refused or _unreadable(error))

    def _settle(self, usage: Usage, reserved: int) -> None:
        self._gate.settle(usage.tokens_in + usage.tokens_out - reserved)
        self._answer = usage.tokens_out

    def _wait_for_turn(self, tokens: int) -> None:
        """Keep to the rate. Raises LimitError if time runs out meanwhile."""
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
            num_retries=0,
            max_retries=0,
            drop_params=False,  # What was asked for is sent or refused, never left out in silence; hints may be.
            **{key: value for key, value in optional.items() if value},
            **{key: value for key, value in chosen.items() if value is not None},
            **({key: value for key, value in request.items() if key not in _HINTS or key in known} | settings.params),
        )
        if not response.choices:
            raise _NoAnswerError("the reply held no choices")
        return response

    def _retrying(self) -> tenacity.Retrying:
        return tenacity.Retrying(
            stop=tenacity.stop_after_attempt(self._settings.num_retries + 1),
            wait=self._wait,
            retry=tenacity.retry_if_exception(_transient),
            before_sleep=self._warn,
            reraise=True,
        )

    def _wait(self, state: tenacity.RetryCallState) -> float:
        """Exponential with jitter, but at least as long as the provider asks for, and no longer than time is left."""
        first = self._settings.backoff
        spread = (tenacity.wait_exponential(multiplier=first) + tenacity.wait_random(0, first))(state)
        asked = min(retry_after(state.outcome.exception() if state.outcome else None), _LONGEST_RETRY_AFTER)
        if asked:
            self._gate.close(asked)  # The other workers have nothing to gain by asking before.
        pause = max(min(spread, _LONGEST_BACKOFF), asked)
        return min(pause, self._meter.seconds_left())

    def _warn(self, state: tenacity.RetryCallState) -> None:
        error = state.outcome.exception() if state.outcome else None
        pause = state.next_action.sleep if state.next_action else 0.0
        _LOG.warning("%s: %s; next try in %.1f s", self._settings.model, self._tell(error or Exception()), pause)

    def _key(self) -> str:
        """Return the key to send if litellm does not find one by itself; a server of one's own often wants none, its
        client does."""
        name = self._settings.auth_env
        if name and not os.environ.get(name, "").strip():
            raise ModelError(f"auth_env names {name}, which is not set.", f"Set {name}.")
        return os.environ[name] if name else "none" if self._settings.api_base and self._missing_keys() else ""

    def _missing_keys(self) -> list[str]:
        return [] if self._settings.auth_env else missing_keys(self._settings.model)

    # -- what came back --------------------------------------------------------------------------------------------
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

    # -- what went wrong -------------------------------------------------------------------------------------------
    def _sorted(self, error: Exception) -> Exception:
        """Return what an error means to the caller."""
        if isinstance(error, ModelError):
            return error
        status, told = getattr(error, "status_code", None), self._tell(error)
        if elsewhere := _redirect(error):
            return self._redirected(elsewhere)
        if endless := _too_long(error):
            return ProviderError(f"{self._where()} gave no answer: {endless}")
        if status in (400, 422) and type(error).__name__ not in _NO_REFUSALS and not _unreadable(error):
            return RefusalError(told)
        mendable = None if self._worked else self._mendable(status, told)
        return mendable or ProviderError(f"{self._where()} gave no answer: {told}")

    def _tell(self, error: BaseException) -> str:
        """Return what the provider said, or the first line of the error, without class names, tracebacks and
        secrets."""
        text = _TRACE.sub("", re.sub(_PREFIXES, "", str(error).strip())) or type(error).__name__
        plain = next(map(_message_in, json_objects(text)), "") or text.splitlines()[0]
        return _CONTROLS.sub(" ", self._redact(plain))[:300].rstrip(". ")

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
    """Return what a call gives, by the clock on the wall: a client's own timeout begins anew with every byte that
    comes.

    A request that is too slow is left to a thread that nobody waits for. Raises _TooSlowError.
    """
    answer: Future[Any] = Future()

    def run() -> None:
        try:
            answer.set_result(ask(**request))
        except BaseException as error:
            answer.set_exception(error)

    threading.Thread(target=run, name="request", daemon=True).start()
    try:
        # A client that keeps its own deadline says more of what went wrong: it goes first.
        return answer.result(seconds + _GRACE)
    except FutureTimeoutError:
        if answer.done():
            raise
        raise _TooSlowError(f"no answer within {seconds:.3g} s") from None


def _streamed(**request: Any) -> Any:
    """Put an answer together that comes in pieces. litellm fills a missing count in by itself, which is none."""
    stream = load().completion(**request, stream=True, stream_options={"include_usage": True})
    pieces = list(stream)
    if getattr(stream, "received_finish_reason", "") is None:  # litellm would make an end of its own.
        raise _NoAnswerError("the reply broke off before its end")
    whole = load().stream_chunk_builder(pieces, messages=request["messages"])
    if whole is None:
        raise _NoAnswerError("the reply held no pieces")
    counted = load().token_counter(model=pieces[0].model, messages=request["messages"])
    if getattr(getattr(whole, "usage", None), "prompt_tokens", counted) == counted:
        whole.usage = None
    return whole


def retry_after(error: BaseException | None) -> float:
    """Seconds that the provider asks to wait, as a number or a date, or in the body as Gemini does; 0 if it does not
    say."""
    headers: Mapping[str, str] = getattr(error, "litellm_response_headers", None) or {}
    in_body = _RETRY_DELAY.search(str(error))
    told = headers.get("retry-after") or (in_body[1] if in_body else "0")
    try:
        return max(0.0, float(told))
    except ValueError:
        return _until(told)


def _until(date: str) -> float:
    try:
        then = email.utils.parsedate_to_datetime(date)
    except ValueError:
        return 0.0
    if then.tzinfo is None:  # A date without a zone, or of the zone -0000, which says as little.
        then = then.replace(tzinfo=datetime.UTC)
    return max(0.0, (then - datetime.datetime.now(datetime.UTC)).total_seconds())


def _transient(error: BaseException) -> bool:
    if _redirect(error) or _too_long(error) or _IN_PIECES.search(str(error)):
        return False
    status = getattr(error, "status_code", None)
    if not isinstance(status, int) or "insufficient_quota" in str(error):
        return False
    return status in _TRANSIENT or status >= 500 or _unreadable(error)


def _unreadable(error: BaseException) -> bool:
    """litellm could not read the provider's reply and reports that as if the request had been wrong."""
    return bool(_UNREADABLE.search(str(error)))


def _redirect(error: BaseException | None) -> str:
    """Where a server sends requests on to, if that is its answer; of some providers' errors only the causes know."""
    found = ""
    for one in _causes(error):
        response = getattr(one, "response", None)
        if getattr(response, "status_code", None) in _REDIRECTS:
            headers: Mapping[str, str] = getattr(response, "headers", None) or {}
            found = headers.get("location", "") or found or "another address"
    return found


def _too_long(error: BaseException | None) -> TooLongError | None:
    """Return what cut a reply off for its length, if something did."""
    return next((one for one in _causes(error) if isinstance(one, TooLongError)), None)


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an error and what it came from, so far back as anybody looks."""
    for _ in range(_CAUSES):
        if error is None:
            return
        yield error
        error = error.__cause__ or error.__context__


def _message_in(body: Json) -> str:
    """Return the words of an error in any provider's form: {"error": {"message": ...}}, {"error": ...} or {"message":
    ...}."""
    inner = body.get("error", body)
    found = inner.get("message", "") if isinstance(inner, dict) else inner
    return found if isinstance(found, str) else ""


def _as_text(arguments: Any) -> str:
    """Arguments as JSON; some providers give an object."""
    return arguments if isinstance(arguments, str) else json.dumps(arguments or {})
