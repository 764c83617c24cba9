"""Failed requests: what an error of litellm or of a provider means, what it says, and whether to try again."""

from __future__ import annotations

import datetime
import email.utils
import math
import re
from collections.abc import Iterator, Mapping
from typing import Any, Final

from humanclaw.skills import json_objects
from humanclaw_litellm.library import UnusableReplyError

Json = dict[str, Any]
_NO_REFUSALS: Final = frozenset({"ContentPolicyViolationError", "ContextWindowExceededError"})
_PREFIXES: Final = re.compile(r"^(?:litellm\.\w+: |\w+(?:Error|Exception): |\w+Exception\w* ?\w* - )+")
_RETRY_DELAY: Final = re.compile(r'"retryDelay":\s*"([\d.]+)s"')
_UNREADABLE: Final = re.compile(
    "Error converting to valid response|Empty or invalid response from LLM endpoint|Invalid response object"
)
"""litellm's words for a reply that it could not read."""
_IN_PIECES: Final = re.compile(r"Received: ['\"]data:")
"""litellm's words for server-sent events that it did not ask for."""
_TRACE: Final = re.compile(r"\s*Traceback \(most recent call last\):.*", re.DOTALL)
_WANTS_STREAM: Final = re.compile(r"stream", re.IGNORECASE)
_REDIRECTS: Final = frozenset({301, 302, 303, 307, 308})
_TRANSIENT: Final = frozenset({408, 409, 425, 429})
_CAUSES: Final = 8
"""Longest chain of causes that is followed."""


class RefusalError(Exception):
    """The provider understood the request and will not serve it in this form."""


class TooSlowError(Exception):
    """The deadline has passed, whether or not bytes still arrive."""

    status_code = 408


class NoAnswerError(Exception):
    """The reply is well-formed but holds no answer of a model."""

    status_code = 502


def is_transient(error: BaseException) -> bool:
    """Tell whether the same request may succeed later."""
    if redirect(error) or unusable(error) or _IN_PIECES.search(str(error)):
        return False
    status = getattr(error, "status_code", None)
    # A used-up quota also has status 429, but no retry brings it back.
    if not isinstance(status, int) or "insufficient_quota" in str(error):
        return False
    return status in _TRANSIENT or status >= 500 or _is_unreadable(error)


def is_refusal(error: BaseException) -> bool:
    """Tell whether the provider refuses the form of the request, so that another form may succeed."""
    refused = getattr(error, "status_code", None) in (400, 422) and type(error).__name__ not in _NO_REFUSALS
    return refused and not _is_unreadable(error)


def wants_stream(error: BaseException) -> bool:
    """Tell whether the server only streams: its refusal says so, or its reply shows it."""
    refused = getattr(error, "status_code", None) in (400, 405, 422) and _WANTS_STREAM.search(str(error))
    return bool(refused or _is_unreadable(error))


def _is_unreadable(error: BaseException) -> bool:
    """Tell whether litellm could not read the provider's reply, which it reports as a fault of the request."""
    return bool(_UNREADABLE.search(str(error)))


def redirect(error: BaseException | None) -> str:
    """Return the address that a server redirects to; empty if its answer is no redirect."""
    found = ""
    for one in _causes(error):  # The errors of some providers lack the response; their causes have it.
        response = getattr(one, "response", None)
        if getattr(response, "status_code", None) in _REDIRECTS:
            headers: Mapping[str, str] = getattr(response, "headers", None) or {}
            found = headers.get("location", "") or found or "another address"
    return found


def unusable(error: BaseException | None) -> UnusableReplyError | None:
    """Return the error of a reply that is too long or a web page; None if it is neither."""
    return next((one for one in _causes(error) if isinstance(one, UnusableReplyError)), None)


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an error and its causes, _CAUSES errors at most."""
    for _ in range(_CAUSES):
        if error is None:
            return
        yield error
        error = error.__cause__ or error.__context__


def retry_after(error: BaseException | None) -> float:
    """Return the seconds that the provider asks to wait; 0 if it does not say, or asks for ever.

    Reads the header Retry-After, a number or a date, and the retryDelay in the body of Gemini's errors.
    """
    headers: Mapping[str, str] = getattr(error, "litellm_response_headers", None) or {}
    in_body = _RETRY_DELAY.search(str(error))
    asked = headers.get("retry-after") or (in_body[1] if in_body else "0")
    try:
        seconds = float(asked)
        return max(0.0, seconds) if math.isfinite(seconds) else 0.0
    except ValueError:
        return _until(asked)


def _until(date: str) -> float:
    try:
        then = email.utils.parsedate_to_datetime(date)
    except ValueError:
        return 0.0
    if then.tzinfo is None:  # A date without a zone, or with the zone -0000, counts as UTC.
        then = then.replace(tzinfo=datetime.UTC)
    return max(0.0, (then - datetime.datetime.now(datetime.UTC)).total_seconds())


def message_of(error: BaseException) -> str:
    """Return the provider's message, or the first line of the error, without class names and tracebacks."""
    text = _TRACE.sub("", re.sub(_PREFIXES, "", str(error).strip())) or type(error).__name__
    return next(map(_message_in, json_objects(text)), "") or text.splitlines()[0]


def _message_in(body: Json) -> str:
    """Read the message in {"error": {"message": ...}}, {"error": ...} or {"message": ...}; providers differ."""
    inner = body.get("error", body)
    found = inner.get("message", "") if isinstance(inner, dict) else inner
    return found if isinstance(found, str) else ""
