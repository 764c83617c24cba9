"""Requests to a model's provider: what is sent through litellm, what comes back, and what can go wrong.

Retries are made here alone (litellm and the provider's client make none), so that the number of requests is the one asked for.
"""

from __future__ import annotations

import functools
import json
import logging
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import tenacity

from humanclaw.errors import ProviderError
from humanclaw.interfaces import Usage
from humanclaw_litellm.settings import ModelError, Settings

Json = dict[str, Any]
_LOG: Final = logging.getLogger(__name__)
_LONGEST_WAIT: Final = 60.0
_HINTS: Final = frozenset({"parallel_tool_calls"})
_LETTERS_A_TOKEN: Final = 4
_TOKENS_A_PICTURE: Final = 350  # What the large providers charge for 512 x 512 pixels lies between 250 and 400.
_TRANSIENT: Final = frozenset({408, 409, 425, 429})
_SECRET_NAME: Final = re.compile(r"KEY|TOKEN|SECRET|PASSWORD|CREDENTIAL", re.IGNORECASE)
_SECRET_FORM: Final = re.compile(r"\b(?:sk|pk|gsk|xai|hf)[-_][\w*.-]{6,}|\bAIza[\w-]{20,}|(?<=Bearer )\S+")


class RefusalError(Exception):
    """The provider understood the request and will not serve it in this form."""


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


class Client:
    """One model at one provider."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._worked = False

    def check(self) -> None:
        """Raises ModelError if it is plain before any request that the model cannot be reached."""
        settings = self._settings
        self._key()
        try:
            load().get_llm_provider(settings.model, api_base=settings.api_base or None)
        except Exception:
            hint = (
                "Write provider/name, such as openai/gpt-4o-mini; for a server of your own openai/NAME with api_base."
            )
            raise ModelError(f"no provider is known for model {settings.model!r}.", hint) from None
        missing = self._missing_keys()
        if missing and not settings.api_base:
            hint = f"Set {missing[0]}, or name a server of your own with api_base."
            raise ModelError(f"model {settings.model!r} needs a key and {missing[0]} is not set.", hint)

    def complete(self, messages: list[Json], request: Mapping[str, Any]) -> Completion:
        """Ask once, trying again while the fault may pass.

        Raises ProviderError if it does not pass, RefusalError if the provider does not take a request of this form, and
        ModelError if the first request ever shows that the key or the model is wrong.
        """
        try:
            response = self._retrying()(self._request, messages, request)
        except Exception as error:
            raise self._sorted(error) from None  # The cause may hold the key.
        self._worked = True
        return _completion(response, self._settings.model, messages, request, self._redact)

    def _request(self, messages: list[Json], request: Mapping[str, Any]) -> Any:
        settings = self._settings
        optional = {"api_base": settings.api_base, "api_key": self._key()}
        chosen = {"temperature": settings.temperature, "max_tokens": settings.max_tokens}
        known = load().get_supported_openai_params(settings.model) or ()
        return load().completion(
            model=settings.model,
            messages=messages,
            timeout=settings.timeout,
            num_retries=0,
            max_retries=0,
            drop_params=False,  # What was asked for is sent or refused, never left out in silence; hints may be.
            **{key: value for key, value in optional.items() if value},
            **{key: value for key, value in chosen.items() if value is not None},
            **{key: value for key, value in request.items() if key not in _HINTS or key in known},
            **settings.params,
        )

    def _retrying(self) -> tenacity.Retrying:
        return tenacity.Retrying(
            stop=tenacity.stop_after_attempt(self._settings.num_retries + 1),
            wait=self._wait,
            retry=tenacity.retry_if_exception(_transient),
            before_sleep=self._warn,
            reraise=True,
        )

    def _wait(self, state: tenacity.RetryCallState) -> float:
        """Exponential with jitter, but at least as long as the provider asks for."""
        first = self._settings.backoff
        spread = (tenacity.wait_exponential(multiplier=first) + tenacity.wait_random(0, first))(state)
        error = state.outcome.exception() if state.outcome else None
        return min(max(spread, _retry_after(error)), _LONGEST_WAIT)

    def _warn(self, state: tenacity.RetryCallState) -> None:
        error = state.outcome.exception() if state.outcome else None
        pause = state.next_action.sleep if state.next_action else 0.0
        _LOG.warning("%s: %s; next try in %.1f s", self._settings.model, self._tell(error or Exception()), pause)

    def _key(self) -> str:
        """The key to send if litellm does not find one by itself; a server of one's own often wants none, its client does."""
        name = self._settings.auth_env
        if name and not os.environ.get(name):
            raise ModelError(f"auth_env names {name}, which is not set.", f"Set {name}.")
        return os.environ[name] if name else "none" if self._settings.api_base and self._missing_keys() else ""

    def _missing_keys(self) -> list[str]:
        """Other credentials, such as a cloud's, can be found in places that litellm's check does not look into."""
        if self._settings.auth_env:
            return []
        missing = load().validate_environment(self._settings.model)["missing_keys"]
        return [name for name in missing if name.endswith("_API_KEY")]

    def _sorted(self, error: Exception) -> Exception:
        """What an error means to the caller."""
        if isinstance(error, ModelError):
            return error
        status, told = getattr(error, "status_code", None), self._tell(error)
        if status in (400, 422) and type(error).__name__ not in (
            "ContentPolicyViolationError",
            "ContextWindowExceededError",
        ):
            return RefusalError(told)
        mendable = None if self._worked else self._mendable(status, told)
        return mendable or ProviderError(f"{self._where()} gave no answer: {told}")

    def _tell(self, error: BaseException) -> str:
        """The first line of an error without class names, tracebacks and secrets."""
        line = next(iter(str(error).strip().splitlines()), "") or type(error).__name__
        plain = re.sub(r"^(?:litellm\.\w+: |\w+(?:Error|Exception): |\w+Exception - )+", "", line)
        return self._redact(plain)[:300].rstrip(". ")

    def _redact(self, text: str) -> str:
        return redact(text, os.environ.get(self._settings.auth_env, "") if self._settings.auth_env else "")

    def _where(self) -> str:
        base = self._settings.api_base
        return f"{self._settings.model} at {base}" if base else self._settings.model

    def _mendable(self, status: int | None, told: str) -> ModelError | None:
        model, server = self._settings.model, self._settings.api_base or "the provider"
        if status in (401, 403):
            return ModelError(f"{server} does not accept the key for {model}: {told}.", "Set the right key.")
        if status == 404:
            return ModelError(f"{server} does not know {model}: {told}.", "Check the model's name and api_base.")
        if "insufficient_quota" in told:
            return ModelError(f"the quota for {model} is used up: {told}.", "Top it up or use another key.")
        return None


@functools.cache
def load() -> Any:
    """litellm, silent and without telemetry. Imported on first use: it takes seconds."""
    for part in ("MODEL_COST_MAP", "ANTHROPIC_BETA_HEADERS"):
        os.environ.setdefault(f"LITELLM_LOCAL_{part}", "True")  # Otherwise these lists are fetched from the network.
    import litellm

    litellm.telemetry = False
    litellm.suppress_debug_info = True
    for name in ("LiteLLM", "LiteLLM Router", "LiteLLM Proxy"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)  # It logs requests, and so pictures and perhaps keys.
    return litellm


def redact(text: str, *secrets: str) -> str:
    """The text without these secrets, without the values of secret environment variables and without what looks like a key."""
    kept = [value for name, value in os.environ.items() if _SECRET_NAME.search(name)]
    for value in sorted((value for value in (*kept, *secrets) if len(value) >= 8), key=len, reverse=True):
        text = text.replace(value, "[redacted]")
    return _SECRET_FORM.sub("[redacted]", text)


def _transient(error: BaseException) -> bool:
    status = getattr(error, "status_code", None)
    if not isinstance(status, int) or "insufficient_quota" in str(error):
        return False
    return status in _TRANSIENT or status >= 500


def _retry_after(error: BaseException | None) -> float:
    headers = getattr(error, "litellm_response_headers", None) or {}
    try:
        return float(headers.get("retry-after", 0))
    except ValueError:
        return 0.0  # A date; the back-off will do.


# -- what came back ----------------------------------------------------------------------------------------------------
def _completion(
    response: Any, model: str, messages: list[Json], request: Mapping[str, Any], redact: Callable[[str], str]
) -> Completion:
    choice = response.choices[0] if response.choices else None
    message = choice.message if choice else None
    called = getattr(message, "tool_calls", None) or ()
    calls = tuple((redact(item.function.name or ""), redact(_as_text(item.function.arguments))) for item in called)
    text = redact(getattr(message, "content", None) or "")
    return Completion(
        text,
        calls,
        str(choice.finish_reason or "") if choice else "",
        redact(getattr(message, "reasoning_content", None) or ""),
        str(response.model or ""),
        _usage(response, model, messages, request, text + "".join(arguments for _, arguments in calls)),
    )


def _as_text(arguments: Any) -> str:
    """Arguments as JSON; some providers give an object."""
    return arguments if isinstance(arguments, str) else json.dumps(arguments or {})


def _usage(response: Any, model: str, messages: list[Json], request: Mapping[str, Any], answer: str) -> Usage:
    """The provider's count; an estimate, marked as one, if it gave none."""
    usage = getattr(response, "usage", None)
    counted = (getattr(usage, "prompt_tokens", 0) or 0, getattr(usage, "completion_tokens", 0) or 0)
    if any(counted):
        return Usage(*counted, _cost(response, usage, model))
    pictures, letters = _measure(messages)
    sent = pictures * _TOKENS_A_PICTURE + (letters + len(json.dumps(dict(request)))) // _LETTERS_A_TOKEN
    return Usage(sent, len(answer) // _LETTERS_A_TOKEN, 0.0, estimated=True)


def _measure(messages: list[Json]) -> tuple[int, int]:
    """How many pictures, and how many letters of text, messages hold."""
    contents = [message["content"] for message in messages]
    parts = [part for content in contents if isinstance(content, list) for part in content]
    texts = [content for content in contents if isinstance(content, str)] + [part.get("text", "") for part in parts]
    return sum(part["type"] == "image_url" for part in parts), sum(map(len, texts))


def _cost(response: Any, usage: Any, model: str) -> float:
    """US dollars as the provider says, else by litellm's price list; 0 for a model that is not on it."""
    told = getattr(usage, "cost", None)
    if isinstance(told, int | float):
        return float(told)
    try:
        return float(load().completion_cost(completion_response=response, model=model))
    except Exception:
        return 0.0  # litellm raises a bare Exception for a model without a price.
