"""The options of a run that configure the model."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, Json, ValidationError

from humanclaw import PluginError, PromptSettings
from humanclaw_litellm.redaction import redact, secrets_in

Mode = Literal["tools", "tools_auto", "schema", "prompt"]
"""Ways to ask a model for a call: tools it must use, tools it may use, a JSON schema, or instructions alone."""
PROFILES: Final[Mapping[str, Mapping[str, Any]]] = {
    "paper": {
        "history": 10, "history_slack": 0, "images": 1, "mid_level": True, "temperature": 0.0, "guide": False,
        "brief": False, "history_text": "whole",
    },
    "default": {"history": 20, "history_slack": 10, "images": 1, "mid_level": True},
}  # fmt: skip
"""Defaults by profile. paper: the baseline of the paper's ablation, with greedy decoding."""
VERIFIER: Final[Mapping[str, Any]] = {"num_retries": 2, "timeout": 30.0}
"""The verifier's default budget. It is smaller, so that an episode does not wait long for a safeguard."""
_OURS: Final = frozenset(
    {
        "api_base", "api_key", "base_url", "client", "drop_params", "max_retries", "max_tokens", "messages", "model",
        "num_retries", "parallel_tool_calls", "stream", "stream_options", "temperature", "timeout",
        "tool_choice", "tools",
    }
)  # fmt: skip
"""Parameters that the harness sets itself. response_format is not among them: a server may have a better one."""


class ModelError(PluginError):
    """The model cannot be used with these options; the message says what to do."""


def _address(url: str) -> str:
    """Check that an address is an HTTP URL. In any other form a key could hide anywhere."""
    if url and not re.fullmatch(r"https?://[^\s/@]+(/\S*)?", url):
        raise ValueError("it must be an address, such as http://localhost:8000/v1, without user, password and spaces")
    return url


def _not_ours(params: dict[str, Any]) -> dict[str, Any]:
    if taken := sorted(_OURS & set(params)):
        raise ValueError(f"{taken[0]} cannot be set here; it is an option of its own, or decided by the harness")
    return params


def _or_none(value: Any) -> Any:
    """Read the words of a command line for no value."""
    return None if isinstance(value, str) and value.strip().lower() in ("", "none", "null") else value


Params = Annotated[dict[str, Any], AfterValidator(_not_ours)]


class Settings(PromptSettings):
    """How to reach a model, and what its prompt contains."""

    model: Annotated[str, Field(min_length=1)]
    """provider/name, as litellm writes it."""
    profile: Literal["default", "paper"] = "default"
    api_base: Annotated[str, AfterValidator(_address)] = ""
    auth_env: str = ""
    """Environment variable with the key; by default the provider's own variable."""
    mode: Literal["auto", "tools", "tools_auto", "schema", "prompt"] = "auto"
    temperature: Annotated[Annotated[float, Field(ge=0)] | None, BeforeValidator(_or_none)] = None
    """Sampling temperature; none to send no temperature, whatever the profile says."""
    max_tokens: Annotated[Annotated[int, Field(ge=1)] | None, BeforeValidator(_or_none)] = None
    timeout: Annotated[float, Field(gt=0)] = 120.0
    """Seconds for one request."""
    num_retries: Annotated[int, Field(ge=0)] = 5
    """A server of this machine that has never answered is tried for ten seconds at most."""
    backoff: Annotated[float, Field(ge=0)] = 1.0
    """Seconds before the first retry; the wait doubles each time, up to 60 seconds."""
    requests_per_minute: Annotated[float, Field(gt=0)] | None = None
    """Limit for all workers of this machine together."""
    tokens_per_minute: Annotated[float, Field(gt=0)] | None = None
    """Limit for all workers together; tokens of the answer count."""
    params: Params | Json[Params] = {}
    """Further parameters of litellm.completion, such as {"reasoning_effort": "low"}."""

    @classmethod
    def of(cls, options: Mapping[str, Any]) -> Self:
        """Read the options of a run. Raises ModelError for an invalid option.

        Options of other plugins are ignored.
        """
        given = {key: value for key, value in options.items() if value is not None}
        if "model" not in given:
            raise ModelError(
                "no model is named.", "Name one with --model or --option model=NAME, such as openai/gpt-4o-mini."
            )
        _refuse_secrets(given)
        try:
            return cls(**_profile(given) | given)
        except ValidationError as error:
            raise _explain(error) from None

    @classmethod
    def of_verifier(cls, options: Mapping[str, Any]) -> Self:
        """Read the verifier's options: verifier_model overrides model, verifier_api_base overrides api_base, and so on.

        A verifier with a model of its own does not inherit api_base and auth_env.
        """
        own = {key.removeprefix("verifier_"): value for key, value in options.items() if key.startswith("verifier_")}
        shared = {key: value for key, value in options.items() if not key.startswith("verifier_")}
        # Otherwise the key of one provider would be sent to another.
        if own.get("model") and "api_base" not in own:
            shared.pop("api_base", None)
            shared.pop("auth_env", None)
        return cls.of({**VERIFIER, **shared, **own})

    @property
    def marks_cache(self) -> bool:
        """Whether the provider needs cache marks. For other models a mark does nothing or harms."""
        return "claude" in self.model


def _refuse_secrets(given: Mapping[str, Any]) -> None:
    """Refuse keys in any option, also in JSON text. Options of other plugins are recorded too."""
    for key, value in given.items():
        try:
            read = json.loads(value) if isinstance(value, str) else value
        except ValueError:
            read = value
        if place := "api_key" if key == "api_key" else next(secrets_in(read, key), ""):
            reason = f"option {redact(place)} holds a key, and options are recorded."
            raise ModelError(reason, "Name the variable of the key: auth_env.")


def _profile(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of the profile. An explicit `history` has no slack, so it means that many steps."""
    values = dict(PROFILES.get(str(given.get("profile", "default")), {}))
    return values | ({"history_slack": 0} if "history" in given else {})


def _explain(error: ValidationError) -> ModelError:
    first = error.errors(include_input=False)[0]
    return ModelError(f"option {first['loc'][0]} is not valid: {first['msg']}.")
