"""litellm itself, made quiet and kept to the address that it is given."""

from __future__ import annotations

import functools
import logging
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@functools.cache
def load() -> Any:
    """litellm, silent and without telemetry. Imported on first use: it takes seconds."""
    for part in ("MODEL_COST_MAP", "ANTHROPIC_BETA_HEADERS"):
        os.environ.setdefault(f"LITELLM_LOCAL_{part}", "True")  # Otherwise these lists are fetched from the network.
    import litellm

    _follow_no_redirects()
    litellm.telemetry = False
    litellm.suppress_debug_info = True
    for name in ("LiteLLM", "LiteLLM Router", "LiteLLM Proxy"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)  # It logs requests, and so pictures and perhaps keys.
    return litellm


def _follow_no_redirects() -> None:
    """Prompt and picture go to the address that was named: a redirect is an answer, and its address nobody's choice.

    litellm has no setting for that; it makes all of its clients in these two places.
    """
    from litellm.llms.custom_httpx.http_handler import HTTPHandler
    from litellm.llms.openai.common_utils import BaseOpenAILLM

    HTTPHandler.create_client = _staying(HTTPHandler.create_client)  # type: ignore[method-assign]
    BaseOpenAILLM._get_sync_http_client = staticmethod(  # type: ignore[method-assign]
        _staying(BaseOpenAILLM._get_sync_http_client)
    )


def _staying(make: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(make)
    def made(*args: Any) -> Any:
        client = make(*args)
        client.follow_redirects = False
        return client

    return made


def missing_keys(model: str) -> list[str]:
    """Variables of API keys that the model's provider wants and that are not set; one that is empty is not set.

    Other credentials, such as a cloud's, can be found in places that litellm's check does not look into.
    """
    with _empty_unset():
        missing = load().validate_environment(model)["missing_keys"]
    return [name for name in missing if name.endswith("_API_KEY")]


@contextmanager
def _empty_unset() -> Iterator[None]:
    """litellm takes a variable that is there for one that is set; for a moment the empty ones are not there."""
    empty = {name: value for name, value in os.environ.items() if name.endswith("_API_KEY") and not value.strip()}
    for name in empty:
        del os.environ[name]
    try:
        yield
    finally:
        os.environ.update(empty)
