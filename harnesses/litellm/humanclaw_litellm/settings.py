"""The options of a run that concern the model."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, Self
from urllib.parse import urlsplit

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, Json, ValidationError

from humanclaw import PluginError
from humanclaw_litellm.redaction import holds_key, redact, secrets_in

Mode = Literal["tools", "tools_auto", "schema", "prompt"]
"""How a model is asked for a call: tools it must use, tools it may use, a JSON schema for its answer, or words
alone."""
PROFILES: Final[Mapping[str, Mapping[str, Any]]] = {
    "paper": {
        "history": 10, "history_slack": 0, "images": 1, "mid_level": True, "temperature": 0.0, "guide": False,
        "brief": False,
    },
    "default": {"history": 20, "history_slack": 10, "images": 1, "mid_level": True},
}  # fmt: skip
"""What the options are when they are not given. paper: the baseline of the paper's ablation, decided greedily."""
VERIFIER: Final[Mapping[str, Any]] = {"num_retries": 2, "timeout": 30.0}
"""The verifier's own budget, when none is given: it is a safeguard, so an episode waits for it only a while."""


_OURS: Final = frozenset(
    {
        "api_base", "api_key", "base_url", "client", "drop_params", "max_retries", "max_tokens", "messages", "model",
        "num_retries", "parallel_tool_calls", "stream", "stream_options", "temperature", "timeout",
        "tool_choice", "tools",
    }
)  # fmt: skip
"""What every request says already. A response_format may be given, for a server that knows a better one."""


class ModelError(PluginError):
    """The model cannot be used as it was asked for, and what to do about it."""


def _address(url: str) -> str:
    """Hold an address to what a request can be sent to; of anything else nobody knows where a key would stand."""
    if url and not re.fullmatch(r"https?://[^\s/@]+(/\S*)?", url):
        raise ValueError("it must be an address, such as http://localhost:8000/v1, without user, password and spaces")
    return url


def _without_credentials(url: str) -> str:
    parts = urlsplit(url)
    if parts.username or parts.password or parts.query or parts.fragment or holds_key(parts.path):
        raise ValueError(
            "it must hold no user, password, query, fragment or key, because options are recorded; use auth_env"
        )
    return url


def _without_keys(params: dict[str, Any]) -> dict[str, Any]:
    if taken := sorted(_OURS & set(params)):
        raise ValueError(f"{taken[0]} cannot be set here; it is an option of its own, or decided by the harness")
    if place := next(secrets_in(params), ""):
        raise ValueError(f"{redact(place)} looks like a key, and options are recorded; use auth_env")
    return params


Params = Annotated[dict[str, Any], AfterValidator(_without_keys)]


class Settings(BaseModel):
    """How to reach a model and what to show it."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    model: Annotated[str, Field(min_length=1)]
    """As litellm writes it: provider/name."""
    profile: Literal["default", "paper"] = "default"
    api_base: Annotated[str, AfterValidator(_without_credentials), AfterValidator(_address)] = ""
    auth_env: str = ""
    """Environment variable that holds the key; by default the provider's own."""
    mode: Literal["auto", "tools", "tools_auto", "schema", "prompt"] = "auto"
    history: Annotated[int, Field(ge=0)] = 20
    """Past steps told in words."""
    history_slack: Annotated[int, Field(ge=0)] = 0
    """So many more may be told, until the oldest of them are left out at once: a provider's cache holds in between."""
    images: Annotated[int, Field(ge=0)] = 1
    """Pictures shown, the current view included; 0 for a model that takes none."""
    mid_level: bool = True
    """Whether the model keeps a mid-level goal (an ablation of the paper)."""
    guide: bool = True
    """Whether the prompt also tells how far the floor is in each row of the picture, when a target counts as reached,
    how many turns make a circle, and one worked example."""
    brief: bool = True
    """Whether a tool asks for the reasoning as one text of named lines rather than as a field each."""
    detail: Literal["", "low", "high", "auto"] = ""
    """How closely the provider is to look at a picture, where it knows such a thing; empty leaves it to the
    provider."""
    temperature: Annotated[float, Field(ge=0)] | None = None
    max_tokens: Annotated[int, Field(ge=1)] | None = None
    timeout: Annotated[float, Field(gt=0)] = 120.0
    """Seconds that one request may take."""
    num_retries: Annotated[int, Field(ge=0)] = 5
    backoff: Annotated[float, Field(ge=0)] = 1.0
    """Seconds before the first retry; each further wait doubles, up to a minute."""
    stream: bool = False
    """Whether answers are asked for in pieces; a server that gives no others is found out without it."""
    requests_per_minute: Annotated[float, Field(gt=0)] | None = None
    """At most, of all workers of this machine together."""
    tokens_per_minute: Annotated[float, Field(gt=0)] | None = None
    """The same for tokens, those of the answer included."""
    params: Params | Json[Params] = {}
    """Further parameters of litellm.completion, such as {"reasoning_effort": "low"}."""

    @classmethod
    def of(cls, options: Mapping[str, Any]) -> Self:
        """Read the options of a run; those of other parts are passed over, misspelt ones refused. Raises ModelError."""
        given = {key: value for key, value in options.items() if value is not None}
        if "model" not in given:
            raise ModelError("no model is named.", "Name one with --model, such as --model openai/gpt-4o-mini.")
        for key in set(given) - set(cls.model_fields):
            cls._refuse_near_miss(key)
        _refuse_secrets(given)
        try:
            return cls(**_profile(given) | given)
        except ValidationError as error:
            raise _explain(error) from None

    @classmethod
    def of_verifier(cls, options: Mapping[str, Any]) -> Self:
        """Return the same, for the verifier: verifier_model, verifier_api_base and so on go before model, api_base and
        so on."""
        own = {key.removeprefix("verifier_"): value for key, value in options.items() if key.startswith("verifier_")}
        shared = {key: value for key, value in options.items() if not key.startswith("verifier_")}
        if own.get("model") and "api_base" not in own:
            shared.pop("api_base", None)
            shared.pop("auth_env", None)
        return cls.of({**VERIFIER, **shared, **own})

    @property
    def marks_cache(self) -> bool:
        """Whether the provider wants to be told what to cache. For other models such a mark does nothing, or harm."""
        return "claude" in self.model

    @property
    def in_force(self) -> dict[str, Any]:
        """Everything that was chosen, as JSON can hold it. There is no key among it."""
        return self.model_dump(mode="json")

    @classmethod
    def _refuse_near_miss(cls, key: str) -> None:
        if key == "api_key":
            raise ModelError(
                "a key must not be an option, because options are recorded.", "Name its variable: auth_env."
            )
        near = difflib.get_close_matches(key.removeprefix("verifier_"), cls.model_fields, n=1, cutoff=0.8)
        if near and not key.startswith("verifier_"):
            raise ModelError(f"there is no option {key!r}.", f"Did you mean {near[0]}?")


def _refuse_secrets(given: Mapping[str, Any]) -> None:
    """Options of other parts are recorded too, such as the address of a verifier that is not in use."""
    for key, value in given.items():
        try:
            if isinstance(value, str) and "://" in value:
                _without_credentials(value)
        except ValueError as error:
            raise ModelError(f"option {key} is not valid: {error}.") from None
        if (isinstance(value, str) and redact(value) != value) or _hides(key, value):
            raise ModelError(f"option {key} holds a key, and options are recorded.", "Name its variable: auth_env.")


def _hides(key: str, value: Any) -> bool:
    """Whether an option of another part holds a key in what is nested in it, also as text."""
    if key in Settings.model_fields:
        return False  # These tell more of what is wrong with them.
    try:
        return any(secrets_in(json.loads(value) if isinstance(value, str) else value, key))
    except ValueError:
        return False


def _profile(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of the profile. A history of so many steps, asked for by number, is one of just so many."""
    values = dict(PROFILES.get(str(given.get("profile", "default")), {}))
    return values | ({"history_slack": 0} if "history" in given else {})


def _explain(error: ValidationError) -> ModelError:
    first = error.errors(include_input=False)[0]
    return ModelError(f"option {first['loc'][0]} is not valid: {first['msg']}.")
