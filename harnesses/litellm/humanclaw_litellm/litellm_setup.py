"""litellm: loaded on first use, made quiet, and restrained: no redirects, bounded replies, a deadline."""

from __future__ import annotations

import functools
import logging
import os
import threading
from collections.abc import Callable
from concurrent.futures import Future, TimeoutError as FutureTimeoutError
from typing import Any, Final

from humanclaw_litellm.failures import FailedRequest, check_reply, failure_of
from humanclaw_litellm.replies import tidied

LONGEST_REPLY: Final = 64 * 2**20
"""Bytes."""
_GRACE: Final = 0.25
"""Seconds of a head start for the client's own timeout: its error says more."""
_exchange: Final = threading.local()
"""Address and response of this thread's last request. litellm's errors keep neither whole."""


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
    """Make HTTP clients follow no redirects, retry nothing, and keep each response for its thread.

    Prompt and picture go only to the address that the user chose. litellm has no setting for it, and loses max_retries
    for some providers; it makes all of its clients in these functions.
    """
    from litellm.llms.custom_httpx.http_handler import HTTPHandler
    from litellm.llms.openai.common_utils import BaseOpenAILLM
    from litellm.llms.openai.openai import OpenAIChatCompletion

    # litellm has no option for it.
    HTTPHandler.create_client = _restrained(HTTPHandler.create_client)  # type: ignore[method-assign]
    BaseOpenAILLM._get_sync_http_client = staticmethod(  # type: ignore[method-assign]  # litellm has no option for it.
        _restrained(BaseOpenAILLM._get_sync_http_client)
    )
    make_client = OpenAIChatCompletion._get_openai_client

    def make_without_retries(*args: Any, **options: Any) -> Any:
        return make_client(*args, **{**options, "max_retries": 0})

    # litellm has no option for it.
    OpenAIChatCompletion._get_openai_client = make_without_retries  # type: ignore[method-assign]


def _restrained(make: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(make)
    def made(*args: Any) -> Any:
        client = make(*args)
        client.follow_redirects = False
        hooks = client.event_hooks
        client.event_hooks = {
            "request": [*hooks.get("request", ()), _begin],
            "response": [*hooks.get("response", ()), _keep],
        }
        return client

    return made


def _begin(request: Any) -> None:
    _exchange.response, _exchange.address = None, f"{request.url.scheme}://{request.url.netloc.decode()}"


def _keep(response: Any) -> None:
    """Read a response, and refuse one whose decompressed size is above LONGEST_REPLY."""
    pieces, length = [], 0
    for piece in response.iter_bytes():
        length += len(piece)
        if length > LONGEST_REPLY:
            raise ValueError(f"the reply has more than {LONGEST_REPLY / 2**20:.3g} MiB")
        pieces.append(piece)
    response._content = tidied(b"".join(pieces))  # As its read() does.
    _exchange.response = response


def _leave_arguments() -> None:
    """Keep litellm from parsing a model's arguments; the harness does, and explains errors to the model.

    litellm looks there for a mistake of older models. It reports arguments that Python's JSON reader rejects as a
    failure of the provider.
    """
    from litellm.litellm_core_utils.llm_response_utils import convert_dict_to_response as reading

    reading.handle_invalid_parallel_tool_calls = lambda tool_calls: tool_calls


def complete(seconds: float, **request: Any) -> Any:
    """Return the completion of one request that takes at most `seconds` of wall time. Raises FailedRequest.

    A client's own timeout restarts with every byte that arrives. A request that is too slow is abandoned to its
    thread.
    """
    answer: Future[Any] = Future()
    litellm = load()

    def run() -> None:
        _exchange.response, _exchange.address = None, ""
        try:
            completion = litellm.completion(timeout=seconds, **request)
            check_reply(completion, _exchange.response)
            answer.set_result(completion)
        except BaseException as error:
            answer.set_exception(failure_of(error, _exchange.response, _exchange.address))

    threading.Thread(target=run, name="request", daemon=True).start()
    try:
        return answer.result(seconds + _GRACE)
    except FutureTimeoutError:
        raise FailedRequest(f"no answer within {seconds:.3g} s", 408) from None


def missing_key(model: str) -> str:
    """Return the variable of an API key that the model's provider needs and that is unset; empty if there is none.

    Other credentials, such as a cloud's, are left out: litellm's check does not know all of their places. It does not
    know every provider either, but tells the key that it would send.
    """
    for name in [name for name in os.environ if name.endswith("_API_KEY") and not os.environ[name].strip()]:
        os.environ.pop(name, None)  # litellm takes an empty variable as set.
    litellm = load()
    if missing := litellm.validate_environment(model)["missing_keys"]:
        return next((name for name in missing if name.endswith("_API_KEY")), "")
    _, provider, key, _ = litellm.get_llm_provider(model)
    name = f"{provider.upper()}_API_KEY"
    return "" if key or name in os.environ or provider not in litellm.openai_compatible_providers else name
