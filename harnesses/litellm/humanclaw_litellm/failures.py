"""Failed requests: the server's own words, what they mean, and whether to try again."""

from __future__ import annotations

import email.utils
import json
import math
import re
import time
from collections.abc import Mapping
from typing import Any, Final

from humanclaw_litellm.endings import ending_of, first_of, part_of, stranger_in

_PREFIXES: Final = re.compile(r"^(?:litellm\.\w+: |\w+(?:Error|Exception): |\w+Exception\w* ?\w* - )+")
_TRACE: Final = re.compile(r"\s*Traceback \(most recent call last\):.*", re.DOTALL)
_TRANSIENT: Final = frozenset({408, 409, 425, 429})  # Timeout, conflict, too early, too many requests.
_LOCAL: Final = re.compile(r"https?://(?:localhost|127\.[\d.]+|0\.0\.0\.0|\[::1\])(?::|$)")
_DEEPEST: Final = 8
"""Levels of an error's body that are read."""
_COUNTS: Final = ("usage", "usageMetadata", "prompt_eval_count")
"""Where replies hold their token counts."""
_SIZE: Final = r"context[ _-]?(?:length|window|size|limit)"
_TOO_LONG: Final = re.compile(
    rf"(?:exceed|longer than|larger than|greater than|too large for|maximum|overflow)[^.]{{0,80}}{_SIZE}"
    rf"|{_SIZE}[^.]{{0,80}}(?:exceed|overflow|only|not enough)"
    r"|context[ _]length[ _]exceeded|exceed_context_size"  # OpenAI; llama.cpp
    r"|(?:prompt|input|request)(?: entity| length| tokens)?(?: is| are)? too (?:long|large)"  # Anthropic, Bedrock, Groq
    r"|(?:exceeds? the|longer than the) maximum (?:number of tokens allowed|model length|size)"  # Gemini, vLLM
    r"|maximum prompt length is|exceeded model token limit"  # xAI, Kimi
    r"|prompt exceeds max|in request more than max tokens"  # GLM
    r"|range of input length|`inputs` tokens"  # Qwen, TGI
    r"|reduce (?:the length of|your message size)",
    re.IGNORECASE,
)
_TOO_MANY: Final = re.compile(r"too many tokens", re.IGNORECASE)
"""Cohere's words for a full context; other servers limit rates with them."""
_PICTURE: Final = r"(?:image|picture|vision|multi-?modal)"
_NO_PICTURES: Final = re.compile(
    rf"{_PICTURE}[^.]{{0,60}}(?:not|n't|un)[ -]?(?:\w+ )?(?:support|enabled|allowed|accept|available)"
    rf"|(?:not|n't|cannot) (?:support|accept|take|have|process|read)(?!ed (?:for|on|with|by))[^.]{{0,40}}{_PICTURE}"
    r"|no endpoints found[^.]*image|at most 0 image|not a multimodal model|missing data required for image"
    r"|image_url[^.]{0,40}only supported|unknown variant .?image_url",
    re.IGNORECASE,
)
_LARGE_PICTURE: Final = re.compile(
    rf"{_PICTURE}s?\b[^.;]{{0,30}}(?:too (?:large|big)|exceed[^.;]{{0,20}}\d ?(?:[kmg]i?b|bytes|pixels)\b)",
    re.IGNORECASE,
)
_TOOLS: Final = re.compile(r"\btools?\b|function[ -]call", re.IGNORECASE)
_CLAUSES: Final = re.compile(r"[.;](?=\s|$)|[()\n]")
"""What separates the clauses of a message: words in one do not speak of a parameter in another."""
_UNSUPPORTED: Final = re.compile(
    r"(?:not|n't|un) ?support(?!ed operand)|requires --|no endpoints found that", re.IGNORECASE
)
_NO_MONEY: Final = re.compile(
    r"insufficient[ _](?:quota|balance|credit|fund)|credit balance is too low|exceeded_current_quota_error"
    r"|used all available credits|have any credits",  # xAI
    re.IGNORECASE,
)
_FILTERED: Final = re.compile(r"content_filter|content_policy|data_inspection_failed|input was flagged", re.IGNORECASE)
_TOKENS: Final = r"max_?(?:completion|output|new)?_?tokens"
"""The names that providers have for max_tokens."""
_NOT_TAKEN: Final = (
    r"(?:un(?:supported|known|expected|recogni[sz]ed|available)|deprecated|invalid|incompatible|forbidden|disabled"
    r"|extra|only supports|(?:not|\w*n't|no longer|cannot)(?: \w+)? (?:be )?"
    r"(?:support|allow|permit|accept|recogni|availab|compatib|set|specif|us)\w*)"
)
_NOUNS: Final = (
    r"parameter(?:s|\(s\))?|arguments?|values?|fields?|propert(?:y|ies)|options?|inputs?|the|this|for|on|with|model"
)
_BEFORE: Final = (
    rf"{_NOT_TAKEN}(?:[^\w.,(]+(?:(?:request|keyword) argument|supplied|setting|of|such|as|sampling|{_NOUNS}))*"
    r"[^\w.,(]+"
)
"""Words of a refusal, and those that may stand between them and the parameter's name."""
_AFTER: Final = (
    rf"(?:[=: ]+-?[\d.]*\d)?[^\w.]{{1,4}}(?:(?:is|are|was|be|may|can|must|has|been|currently|and|top_p|{_NOUNS})\W+)*"
    rf"(?:{_NOT_TAKEN}|does(?: not|n't)|\bonly\b|requires|must be (?:set to )?-?\d)"
)
_BOUND: Final = re.compile(
    r"too (?:large|small|high|low)|at (?:most|least) |exceeds|(?:less|greater|more) than|between|must be in\b"
    r"|(?:valid|supported) range|(?:above|below) (?:max|min)|maximum allowed|(?<![\w'])[<>]=? ?-?\d",
    re.IGNORECASE,
)
"""Words for a value out of bounds: another value is taken, so that the user is told of it."""
_ROOM_LEFT: Final = re.compile(r"too large: (\d+)\..*context length is (\d+)", re.DOTALL)
"""vLLM's words for an answer's bound and for a prompt that leaves no room for it: the numbers tell which."""
_DELAY: Final = re.compile(r'"retryDelay":\s*"([\d.]+)s"')
"""Gemini's words for a wait."""
_AGAIN: Final = re.compile(
    r"(?:try again|retry)(?: again)? (?:in|after) ((?:[\d.]+ ?(?:ms|[hms])[a-z]* ?)+)", re.IGNORECASE
)
_LARGER_THAN_RATE: Final = re.compile(r"too large.{0,200}?\bper (?:min|hour|day|sec)", re.IGNORECASE)
_WAITS: Final = re.compile(r"\bwait\b|retryDelay|(?:try again|retry)(?: again)? (?:in|after) \d", re.IGNORECASE)
_PART: Final = re.compile(r"([\d.]+) ?(ms|[hms])", re.IGNORECASE)
_SECONDS: Final = {"h": 3600.0, "m": 60.0, "s": 1.0, "ms": 0.001}


class RefusalError(Exception):
    """The provider understood the request and will not serve it in this form."""


class TooLongError(Exception):
    """The request does not fit the model's context window."""


class FailedRequest(Exception):  # noqa: N818
    """A request that brought no answer.

    said: everything that the server or litellm said, which decides what the failure means. reply: litellm's reply of a
    generation that failed although its tokens are counted.
    """

    def __init__(
        self, words: str, status: int, said: str = "", headers: Mapping[str, str] | None = None, reply: Any = None
    ) -> None:
        super().__init__(words)
        self.reply = reply
        self.words, self.status, self.said, self.headers = words, status, said or words, headers or {}

    @property
    def redirect(self) -> str:
        """The address that the server redirects to; empty if its answer is no redirect."""
        return self.headers.get("location", "another address") if 300 <= self.status < 400 else ""

    @property
    def too_long(self) -> bool:
        """Whether the request does not fit the model's context."""
        if self.larger_than_rate or self._asks_to_wait or _LARGE_PICTURE.search(self.said):
            return False
        if self.status in (400, 413, 422):
            return self.status == 413 or bool(_TOO_LONG.search(self.said) or _TOO_MANY.search(self.said))
        return self._is_answer and bool(_TOO_LONG.search(self.said))

    @property
    def larger_than_rate(self) -> bool:
        """Whether one request is larger than the account's tokens per minute, so that no wait helps."""
        return self._is_answer and not self._asks_to_wait and bool(_LARGER_THAN_RATE.search(self.said))

    @property
    def about_pictures(self) -> bool:
        """Whether the model takes no pictures."""
        clauses = [clause for clause in _CLAUSES.split(self.said) if not _TOOLS.search(clause)]
        return self._is_answer and any(map(_NO_PICTURES.search, clauses))

    def refuses(self, parameter: str) -> int | None:
        """Return where the words refuse a parameter; None if they do not, or refuse its value by a bound alone."""
        if self.bounds(parameter):
            return None
        if self.param == parameter:
            return 0
        name = rf"(?<!\w){re.escape(parameter)}(?!\w)"
        match = re.search(rf"{_BEFORE}{name}|{name}{_AFTER}", self.said, re.IGNORECASE)
        return match.start() if match else None

    def bounds(self, parameter: str) -> bool:
        """Tell whether the words refuse a parameter's value by a bound."""
        name = _TOKENS if parameter == "max_tokens" else re.escape(parameter)
        room = _ROOM_LEFT.search(self.said)
        if self.status not in (400, 422) or (room and int(room[1]) < int(room[2])):
            return False
        if re.fullmatch(name, self.param):
            return bool(_BOUND.search(self.said))
        # "prompt and max_tokens exceed", "inputs + max_tokens must be": a sum is no bound of the parameter.
        alone = re.compile(
            rf"(?<![\w])(?<!and )(?<!and .)(?<!\+ )(?<!\+ .){name}(?!\w)(?!.? (?:and|\+) )", re.IGNORECASE
        )
        return any(alone.search(clause) and _BOUND.search(clause) for clause in _CLAUSES.split(self.said))

    @property
    def param(self) -> str:
        """The parameter that an error is about, in OpenAI's form or pydantic's; empty if it names none."""
        match = re.search(r'"param":\s*"([^"]+)"|["\']loc["\']: ?[\[(][^\])]*["\'](\w+)["\']\s*[\])]', self.said)
        return (match[1] or match[2]) if match else ""

    @property
    def filtered(self) -> bool:
        """Whether the provider's filter refused the request."""
        return self.status in (400, 403) and bool(_FILTERED.search(self.said))

    @property
    def unpaid(self) -> bool:
        """Whether the account is empty. Some providers send status 429, but no retry brings the money back."""
        if self.status == 402:
            return True
        return self.status >= 400 and not self._asks_to_wait and bool(_NO_MONEY.search(self.said))

    @property
    def refused(self) -> bool:
        """Whether the provider refuses the form of the request, so that another form may succeed."""
        lacking = (self.status in (404, 405, 501) or self.status >= 500) and _UNSUPPORTED.search(self.said)
        return (self.status in (400, 415, 422) and not self._asks_to_wait) or bool(lacking)

    @property
    def transient(self) -> bool:
        """Whether the same request may succeed later."""
        if self.too_long or self.larger_than_rate or self.about_pictures or self.unpaid or self.refused:
            return False
        return self.status in _TRANSIENT or self.status >= 500 or (self.status == 400 and self._asks_to_wait)

    @property
    def wait(self) -> float:
        """Seconds that the provider asks to wait; 0 if it does not say, or asks for ever."""
        if (asked := self.headers.get("retry-after-ms", "")) and (seconds := _number(asked) / 1000):
            return seconds
        if asked := self.headers.get("retry-after", ""):
            return _number(asked) or _until(asked)
        if delay := _DELAY.search(self.said):
            return _number(delay[1])
        again = _AGAIN.search(self.said)
        parts = _PART.findall(again[1]) if again else ()
        return sum(_number(count) * _SECONDS[unit.lower()] for count, unit in parts)

    @property
    def _asks_to_wait(self) -> bool:
        """Whether the words ask to wait: a limit of a rate, whatever else they speak of."""
        return bool(_WAITS.search(self.said))

    @property
    def _is_answer(self) -> bool:
        """Whether the words may be about the request."""
        return self.status >= 400 and self.status not in (401, 403, 408)


class UnservedRequest(FailedRequest):
    """A request to an address of this machine where nothing listens: most likely the server was never started."""


def _number(text: str) -> float:
    """Return a number of 0 or more; 0 for any other text."""
    try:
        number = float(text)
    except ValueError:
        return 0.0
    return max(0.0, number) if math.isfinite(number) else 0.0


def _until(date: str) -> float:
    then = email.utils.parsedate_tz(date)  # A date without a zone counts as UTC.
    return max(0.0, email.utils.mktime_tz(then) - time.time()) if then else 0.0


def check_reply(completion: Any, response: Any) -> None:
    """Raise FailedRequest for a reply of status 200 that reports a failure, or holds no answer of the model.

    The first choice gets the ending as its finish_reason, unless it is whole. An answer that ended for an unknown
    reason counts as whole if there is one.
    """
    body = _body_of(response)
    body = body if isinstance(body, dict) else {}
    first = first_of(body, "choices")
    message = part_of(first, "message")
    fault = first.get("error") or message.get("error") or body.get("error")
    ending = ending_of(body)
    counted = completion if any(body.get(key) for key in _COUNTS) else None
    if ending == "full":
        raise FailedRequest("the context window is full", 400, "context_length_exceeded", reply=counted)
    if role := stranger_in(body):
        raise FailedRequest(f"expected a message of the model; got one of role {role!r}", 502, reply=counted)
    if fault or ending == "failed" or (ending == "unknown" and _is_empty(completion)):
        words = _words(fault) or _words(message.get("content")) or "the generation failed"
        raise FailedRequest(words, _code(fault), _dump(fault), reply=counted)
    if not completion.choices:
        raise FailedRequest("the reply held no choices", 502)
    if ending not in ("", "whole"):
        completion.choices[0].finish_reason = "stop" if ending == "unknown" else ending


def _is_empty(completion: Any) -> bool:
    """Tell whether a completion holds no call, no text and no thoughts."""
    said = [choice.message for choice in completion.choices]
    fields = ("tool_calls", "content", "reasoning_content")
    return not any(getattr(message, field, None) for message in said for field in fields)


def failure_of(error: BaseException, response: Any, address: str) -> FailedRequest:
    """Return the failure behind an error of litellm.

    response: the HTTP response, if there was one. address: where the request went; empty if none was sent.
    """
    if isinstance(error, FailedRequest):
        return error
    name, text = type(error).__name__, re.sub(_PREFIXES, "", _TRACE.sub("", str(error).strip()))
    plain = text.splitlines()[0] if text else name
    if name == "UnsupportedParamsError":  # litellm's own: nothing was sent.
        return FailedRequest(plain, 400, text)
    if name == "ContentPolicyViolationError":
        return FailedRequest(plain, 400, "content_filter")
    if response is None:
        return _unanswered(error, plain.rstrip("."), address)
    body, headers = _body_of(response), dict(response.headers)
    if response.status_code >= 300:
        return FailedRequest(_words(body) or plain, response.status_code, response.text, headers)
    if response.headers.get("content-type", "").startswith("text/html"):
        return FailedRequest("it answers with a web page; an api_base often ends in /v1", 404)
    fault = body.get("error") if isinstance(body, dict) else None
    return FailedRequest(_words(fault) or plain, _code(fault), _dump(fault) if fault else "", headers)


def _unanswered(error: BaseException, plain: str, address: str) -> FailedRequest:
    cause, status = _cause(error), getattr(error, "status_code", None) or 0
    if isinstance(cause, ConnectionRefusedError) and _LOCAL.match(address):
        remedy = "start the server there, or name its address with --option api_base=URL"
        return UnservedRequest(f"nothing listens at {address} ({cause}): {remedy}", status)
    where = f" at {address} ({str(cause) or type(cause).__name__})" if address else ""
    return FailedRequest(f"{plain}{where}", status)


def _body_of(response: Any) -> Any:
    """Return the body of a response: JSON where it is, else its text."""
    try:
        return response.json()
    except (AttributeError, ValueError, RecursionError):
        return getattr(response, "text", "")


def _code(fault: Any) -> int:
    """Return the status within an error of a reply of status 200; 502 without one."""
    code = fault.get("code") if isinstance(fault, dict) else None
    return code if isinstance(code, int) and 400 <= code < 600 else 502


def _dump(fault: Any) -> str:
    try:
        return json.dumps(fault)
    except RecursionError:
        return ""


def _words(body: Any, deepest: int = _DEEPEST) -> str:
    """Return the message in the body of an error. Every provider names it in its own way."""
    if isinstance(body, str):
        return "" if body.lstrip().startswith("<") else body.strip()
    if isinstance(body, list) and deepest:
        return "; ".join(filter(None, (_words(part, deepest - 1) for part in body)))
    if not isinstance(body, dict) or not deepest:
        return ""
    texts = (_words(body.get(key), deepest - 1) for key in ("error", "detail", "message", "msg"))
    message = next(filter(None, texts), "")
    where = ".".join(map(str, body["loc"])) if isinstance(body.get("loc"), list) else ""
    upstream = _words(part_of(body, "metadata").get("raw"), deepest - 1)  # OpenRouter's provider.
    return ": ".join(filter(None, (where, message, upstream)))


def _cause(error: BaseException) -> BaseException:
    """Return the innermost cause, such as "Connection refused"."""
    while inner := error.__cause__ or error.__context__:
        error = inner
    return error
