"""litellm itself, made quiet, kept to the address that it is given, and to so many bytes of what that sends."""

from __future__ import annotations

import functools
import logging
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final

LONGEST_REPLY: Final = 64 * 2**20
"""Bytes. The longest answer of a model in pieces, a hundred thousand tokens, has about thirty million."""


class TooLongError(Exception):
    """A reply that has not ended after LONGEST_REPLY bytes."""


@functools.cache
def load() -> Any:
    """litellm, silent and without telemetry. Imported on first use: it takes seconds."""
    for part in ("MODEL_COST_MAP", "ANTHROPIC_BETA_HEADERS"):
        os.environ.setdefault(f"LITELLM_LOCAL_{part}", "True")  # Otherwise these lists are fetched from the network.
    import litellm

    _restrain_clients()
    _leave_arguments()
    litellm.telemetry = False
    litellm.suppress_debug_info = True
    for name in ("LiteLLM", "LiteLLM Router", "LiteLLM Proxy"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)  # It logs requests, and so pictures and perhaps keys.
    return litellm


def _restrain_clients() -> None:
    """Prompt and picture go to the address that was named: a redirect is an answer, and its address nobody's choice.
    And no reply fills the memory.

    litellm has no setting for either; it makes all of its clients in these two places.
    """
    from litellm.llms.custom_httpx.http_handler import HTTPHandler
    from litellm.llms.openai.common_utils import BaseOpenAILLM

    HTTPHandler.create_client = _restrained(HTTPHandler.create_client)  # type: ignore[method-assign]
    BaseOpenAILLM._get_sync_http_client = staticmethod(  # type: ignore[method-assign]
        _restrained(BaseOpenAILLM._get_sync_http_client)
    )


def _leave_arguments() -> None:
    """Keep litellm from reading what a model wrote as arguments: where it cannot be read, that is refused in words.
    litellm looks there for a mistake of older models, and takes a number or a nesting that Python's reader does not
    hold for the failure of the provider."""
    from litellm.litellm_core_utils.llm_response_utils import convert_dict_to_response as reading

    reading.handle_invalid_parallel_tool_calls = lambda tool_calls: tool_calls


def _restrained(make: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(make)
    def made(*args: Any) -> Any:
        client = make(*args)
        client.follow_redirects = False
        hooks = client.event_hooks
        client.event_hooks = {**hooks, "response": [*hooks.get("response", ()), _bound]}
        return client

    return made


def _bound(response: Any) -> None:
    """Let no more than LONGEST_REPLY bytes of a reply be read, unpacked, in one piece or in many."""
    read = response.iter_bytes

    def iter_bytes(chunk_size: int | None = None) -> Iterator[bytes]:
        left = LONGEST_REPLY
        for piece in read(chunk_size):
            left -= len(piece)
            if left < 0:
                raise TooLongError(f"the reply has more than {LONGEST_REPLY / 2**20:.3g} MiB")
            yield piece

    response.iter_bytes = iter_bytes


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
