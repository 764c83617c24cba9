"""The usage of an answer: tokens and US dollars from the provider, else estimates marked as such."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Mapping
from typing import Any, Final, TypeGuard

from humanclaw.records import Usage
from humanclaw_litellm.litellm_setup import load
from humanclaw_litellm.settings import Settings

Json = dict[str, Any]
_LETTERS_A_TOKEN: Final = 4  # Of English text, by the rule of thumb of OpenAI and Anthropic.
_TOKENS_A_PICTURE: Final = 350
"""For 512 x 512 pixels. The large providers count 250 to 420."""
_MOST: Final = 1 << 40
"""Larger token counts are not believed."""
_MOST_TIMES: Final = 10
"""A total of more times its parts is not believed."""
_DEAREST: Final = 1e4
"""US dollars; a larger cost of one answer is not believed."""
_PRICES: Final = ("input_cost_per_token", "output_cost_per_token")


def usage_of(response: Any, settings: Settings, messages: list[Json], request: Mapping[str, Any], said: str) -> Usage:
    """Return the usage of litellm's response. said: all text that the model wrote, for an estimate."""
    counted = getattr(response, "usage", None)
    sent, wrote, thought = _tokens(counted)
    if not (sent or wrote) or _counted_by_litellm(settings.model, messages, sent):
        sent = wrote = thought = 0
    likely = len(said) // _LETTERS_A_TOKEN
    estimated = not sent or (not wrote and likely > 0)
    sent, wrote = sent or tokens_sent(messages, request), wrote or likely
    stated = getattr(counted, "cost", None)
    if _is_amount(stated) and stated < _DEAREST and not estimated and not _are_given(settings):
        return Usage(sent, wrote, float(stated), tokens_reasoning=thought)
    cost = _cost(response, settings, sent, wrote)
    return Usage(sent, wrote, cost, estimated, cost_estimated=True, tokens_reasoning=thought)


def _tokens(counted: Any) -> tuple[int, int, int]:
    """Return tokens sent, tokens written with the reasoning among them, and tokens of reasoning.

    Some providers count reasoning not as written, or cached tokens and pictures not as sent, but both in the total: the
    details tell which. Without them the rest of the total counts as reasoning, as Gemini hides it: it is billed.
    """
    sent, wrote, total = (_count(counted, f"{part}_tokens") for part in ("prompt", "completion", "total"))
    thought = _count(getattr(counted, "completion_tokens_details", None), "reasoning_tokens")
    beside = total - sent - wrote
    details = getattr(counted, "prompt_tokens_details", None)
    parts = [_count(details, f"{part}_tokens") for part in ("cached", "cache_creation", "image")]
    if beside > 0:
        for some in range(1, len(parts) + 1):
            for chosen in itertools.combinations(parts, some):
                if sum(chosen) in (beside, beside - thought):
                    return sent + sum(chosen), total - sent - sum(chosen), thought
        if not thought and total <= _MOST_TIMES * (sent + wrote):
            return sent, wrote + beside, beside
    unsaid = thought if thought > wrote or beside == thought else 0
    return sent, wrote + unsaid, thought


def _count(counts: object, name: str) -> int:
    """Return a provider's token count; 0 if it is missing or no plausible count."""
    count = getattr(counts, name, 0)
    return int(count) if _is_amount(count) and count < _MOST else 0


def _is_amount(value: object) -> TypeGuard[int | float]:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0 <= value < math.inf


def _are_given(settings: Settings) -> bool:
    """Tell whether the user gave prices: they count before the provider's cost."""
    return any(word in settings.params for word in _PRICES)


def price_of(settings: Settings) -> tuple[float, float] | None:
    """Return US dollars for a token in and a token out, from params or else from litellm's list.

    None for a model that is on neither.
    """
    if _are_given(settings):
        # _PRICES are two.
        return tuple(float(settings.params.get(word, 0.0)) for word in _PRICES)  # type: ignore[return-value]
    listed, model = load().model_cost, _listed(settings)  # litellm's own look-up would ask an Ollama server for prices.
    prices = listed.get(model) or listed.get(model.partition("/")[2]) or {}
    first, second = (prices.get(word) for word in _PRICES)
    return None if first is None or second is None else (float(first), float(second))


def _listed(settings: Settings) -> str:
    """Return the model's name in litellm's list, which has no API in it: openai/responses/gpt-5 is openai/gpt-5."""
    return settings.model.replace("/responses/", "/", 1)


def _cost(response: Any, settings: Settings, sent: int, wrote: int) -> float:
    """Return litellm's cost, which includes the discount for cached tokens; 0 without a known price."""
    prices = price_of(settings)
    if prices is None:
        return 0.0
    if counted := getattr(response, "usage", None):
        counted.prompt_tokens, counted.completion_tokens = sent, wrote
    given = dict(zip(_PRICES, prices, strict=True)) if _are_given(settings) else None
    try:
        return float(
            load().completion_cost(completion_response=response, model=_listed(settings), custom_cost_per_token=given)
        )
    except Exception:  # litellm raises a bare Exception for a provider that its list does not hold whole.
        return sent * prices[0] + wrote * prices[1]


def _counted_by_litellm(model: str, messages: list[Json], sent: int) -> bool:
    """Tell whether litellm made up the count: for Ollama it fills in a missing one, from the text alone."""
    return "ollama" in model and sent == load().token_counter(messages=messages)


def tokens_sent(messages: list[Json], request: Mapping[str, Any]) -> int:
    """Estimate the tokens of a request, without the answer."""
    return _pictures(messages) * _TOKENS_A_PICTURE + text_tokens_sent(messages, request)


def text_tokens_sent(messages: list[Json], request: Mapping[str, Any]) -> int:
    """Estimate the tokens of a request's text alone."""
    texts = [part.get("text", "") for part in _parts(messages)]
    return (sum(map(len, texts)) + len(json.dumps(dict(request)))) // _LETTERS_A_TOKEN


def _pictures(messages: list[Json]) -> int:
    return sum(part["type"] == "image_url" for part in _parts(messages))


def _parts(messages: list[Json]) -> list[Json]:
    contents = [message["content"] for message in messages]
    return [
        part
        for content in contents
        for part in ([{"type": "text", "text": content}] if isinstance(content, str) else content)
    ]
