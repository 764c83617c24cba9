"""litellm: loaded on first use, made quiet, and restrained: no redirects, and a bound on the size of replies."""

from __future__ import annotations

import functools
import logging
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final

LONGEST_REPLY: Final = 64 * 2**20
"""Longest reply, bytes. A streamed answer of a hundred thousand tokens, about the longest, has thirty million."""


class UnusableReplyError(Exception):
    """A reply that no second request betters."""


class TooLongError(UnusableReplyError):
    """A reply is longer than LONGEST_REPLY."""


class WebPageError(UnusableReplyError):
    """A successful reply is a web page: the address is that of a website, or of a network's login."""


@functools.cache
def load() -> Any:
    """Return litellm, silent and without telemetry. The import takes seconds."""
    for part in ("MODEL_COST_MAP", "ANTHROPIC_BETA_HEADERS"):
        os.environ.setdefault(f"LITELLM_LOCAL_{part}", "True")  # Otherwise litellm downloads these lists.
    import litellm

    _restrain_clients()
    _leave_arguments()
    litellm.telemetry = False
    litellm.suppress_debug_info = True
    for name in ("LiteLLM", "LiteLLM Router", "LiteLLM Proxy"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)  # Its logs hold requests: pictures, and perhaps keys.
    return litellm


def _restrain_clients() -> None:
    """Make HTTP clients follow no redirects and bound every reply.

    Prompt and picture go only to the address that the user chose, and no reply fills the memory. litellm has no setting
    for either; it makes all of its clients in these two functions.
    """
    from litellm.llms.custom_httpx.http_handler import HTTPHandler
    from litellm.llms.openai.common_utils import BaseOpenAILLM

    HTTPHandler.create_client = _restrained(HTTPHandler.create_client)  # type: ignore[method-assign]
    BaseOpenAILLM._get_sync_http_client = staticmethod(  # type: ignore[method-assign]
        _restrained(BaseOpenAILLM._get_sync_http_client)
    )


def _leave_arguments() -> None:
    """Keep litellm from parsing a model's arguments; the harness does, and explains errors to the model.

    litellm looks there for a mistake of older models. It reports arguments that Python's JSON reader rejects as a
    failure of the provider.
    """
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
    """Refuse a web page, and bound the decompressed size of a reply to LONGEST_REPLY."""
    if response.is_success and response.headers.get("content-type", "").startswith("text/html"):
        raise WebPageError("it answers with a web page")
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
    """Return the variables of API keys that the model's provider needs and that are unset or empty.

    Other credentials, such as a cloud's, are left out: litellm's check does not know all of their places.
    """
    with _empty_unset():
        missing = load().validate_environment(model)["missing_keys"]
    return [name for name in missing if name.endswith("_API_KEY")]


@contextmanager
def _empty_unset() -> Iterator[None]:
    """Remove empty key variables for a moment: litellm would take them as set."""
    empty = {name: value for name, value in os.environ.items() if name.endswith("_API_KEY") and not value.strip()}
    for name in empty:
        del os.environ[name]
    try:
        yield
    finally:
        os.environ.update(empty)
