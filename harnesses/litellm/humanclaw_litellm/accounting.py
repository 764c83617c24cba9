"""What an answer took: tokens and US dollars as the provider tells them, else estimates that are marked as such."""

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
"""What the large providers charge for 512 x 512 pixels lies between 250 and 420."""
_MOST: Final = 1 << 40
"""Tokens that no answer takes."""
_PRICES: Final = ("input_cost_per_token", "output_cost_per_token")


def usage_of(response: Any, settings: Settings, messages: list[Json], request: Mapping[str, Any], said: str) -> Usage:
    """response: litellm's. said: all text that the model wrote, for an estimate."""
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
    """Tokens as a provider counts them; 0 for what is no count, as if it had told none."""
    found = getattr(told, name, 0)
    return int(found) if _is_amount(found) and found < _MOST else 0


def _is_amount(found: object) -> TypeGuard[int | float]:
    return isinstance(found, int | float) and not isinstance(found, bool) and 0 <= found < math.inf


def price_of(settings: Settings) -> tuple[float, float] | None:
    """US dollars a token in and out: those given with params, else of litellm's list; None for a model that is not on
    it."""
    if any(word in settings.params for word in _PRICES):
        return tuple(float(settings.params.get(word, 0.0)) for word in _PRICES)  # type: ignore[return-value]
    listed = load().model_cost  # litellm's own look-up asks a server of Ollama's for what only the list can tell.
    found = listed.get(settings.model) or listed.get(settings.model.partition("/")[2]) or {}
    first, second = (found.get(word) for word in _PRICES)
    return None if first is None or second is None else (float(first), float(second))


def _cost_by_list(response: Any, settings: Settings, plain: float) -> float:
    """litellm also knows what is cheaper because a cache held it."""
    if not plain or any(word in settings.params for word in _PRICES):
        return plain
    try:
        return float(load().completion_cost(completion_response=response, model=settings.model))
    except Exception:
        return plain  # litellm raises a bare Exception where its list does not suffice.


def _counted_by_litellm(response: Any, model: str, messages: list[Json], sent: int) -> bool:
    """For Ollama litellm fills a missing count in by itself, and does not say so; its count is of the text alone."""
    return "ollama" in model and sent == load().token_counter(messages=messages)


def tokens_sent(messages: list[Json], request: Mapping[str, Any]) -> int:
    """Estimate what a request takes, without the answer."""
    pictures, letters = _measure(messages)
    return pictures * _TOKENS_A_PICTURE + (letters + len(json.dumps(dict(request)))) // _LETTERS_A_TOKEN


def _measure(messages: list[Json]) -> tuple[int, int]:
    """How many pictures, and how many letters of text, messages hold."""
    contents = [message["content"] for message in messages]
    parts = [part for content in contents if isinstance(content, list) for part in content]
    texts = [content for content in contents if isinstance(content, str)] + [part.get("text", "") for part in parts]
    return sum(part["type"] == "image_url" for part in parts), sum(map(len, texts))
