"""The usage of an answer: tokens and US dollars from the provider, else estimates marked as such."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, Final, TypeGuard

from humanclaw.records import Usage
from humanclaw_litellm.library import load
from humanclaw_litellm.settings import Settings

Json = dict[str, Any]
_LETTERS_A_TOKEN: Final = 4
_TOKENS_A_PICTURE: Final = 350
"""For 512 x 512 pixels. The large providers count 250 to 420."""
_MOST: Final = 1 << 40
"""Larger token counts are not believed."""
_PRICES: Final = ("input_cost_per_token", "output_cost_per_token")


def usage_of(response: Any, settings: Settings, messages: list[Json], request: Mapping[str, Any], said: str) -> Usage:
    """Return the usage of litellm's response. said: all text that the model wrote, for an estimate."""
    counted = getattr(response, "usage", None)
    tokens = (_count(counted, "prompt_tokens"), _count(counted, "completion_tokens"))
    estimated = not any(tokens) or _counted_by_litellm(response, settings.model, messages, tokens[0])
    if estimated:
        tokens = (tokens_sent(messages, request), len(said) // _LETTERS_A_TOKEN)
    details = getattr(counted, "completion_tokens_details", None)
    thought = 0 if estimated else _count(details, "reasoning_tokens")
    told = getattr(counted, "cost", None)
    if _is_amount(told) and not estimated:
        return Usage(*tokens, float(told), tokens_reasoning=thought)
    prices = price_of(settings)
    cost = sum(count * price for count, price in zip(tokens, prices, strict=True)) if prices else 0.0
    if prices and not estimated:
        cost = _cost_by_list(response, settings, cost)
    return Usage(*tokens, cost, estimated, cost_estimated=True, tokens_reasoning=thought)


def _count(told: object, name: str) -> int:
    """Return a provider's token count; 0 if it is missing or no plausible count."""
    found = getattr(told, name, 0)
    return int(found) if _is_amount(found) and found < _MOST else 0


def _is_amount(found: object) -> TypeGuard[int | float]:
    return isinstance(found, int | float) and not isinstance(found, bool) and 0 <= found < math.inf


def price_of(settings: Settings) -> tuple[float, float] | None:
    """Return US dollars for a token in and a token out, from params or else from litellm's list.

    None for a model that is on neither.
    """
    if any(word in settings.params for word in _PRICES):
        return tuple(float(settings.params.get(word, 0.0)) for word in _PRICES)  # type: ignore[return-value]
    listed = load().model_cost  # litellm's own look-up would ask an Ollama server for prices.
    found = listed.get(settings.model) or listed.get(settings.model.partition("/")[2]) or {}
    first, second = (found.get(word) for word in _PRICES)
    return None if first is None or second is None else (float(first), float(second))


def _cost_by_list(response: Any, settings: Settings, plain: float) -> float:
    """Return litellm's cost, which includes the discount for cached tokens; else the plain cost."""
    if not plain or any(word in settings.params for word in _PRICES):
        return plain
    try:
        return float(load().completion_cost(completion_response=response, model=settings.model))
    except Exception:
        return plain  # litellm raises a bare Exception if its list lacks a price.


def _counted_by_litellm(response: Any, model: str, messages: list[Json], sent: int) -> bool:
    """Tell whether litellm made up the count: for Ollama it fills in a missing one, from the text alone."""
    return "ollama" in model and sent == load().token_counter(messages=messages)


def tokens_sent(messages: list[Json], request: Mapping[str, Any]) -> int:
    """Estimate the tokens of a request, without the answer."""
    pictures, letters = _measure(messages)
    return pictures * _TOKENS_A_PICTURE + (letters + len(json.dumps(dict(request)))) // _LETTERS_A_TOKEN


def _measure(messages: list[Json]) -> tuple[int, int]:
    """Return the number of pictures and of text characters in messages."""
    contents = [message["content"] for message in messages]
    parts = [part for content in contents if isinstance(content, list) for part in content]
    texts = [content for content in contents if isinstance(content, str)] + [part.get("text", "") for part in parts]
    return sum(part["type"] == "image_url" for part in parts), sum(map(len, texts))
