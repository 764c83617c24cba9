"""Check what agents and verifiers, which may be third-party code, return and say of themselves."""

from __future__ import annotations

import functools
import json
import reprlib
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final, TypeVar

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from humanclaw.errors import HumanclawError, blaming
from humanclaw.records.decisions import recordable
from humanclaw.records.specification import Name
from humanclaw.text.json import first_fault

T = TypeVar("T")
M = TypeVar("M", bound=BaseModel)
_SETTINGS: Final = TypeAdapter(dict[str, Any], config=ConfigDict(ser_json_inf_nan="strings"))


class StandIn:
    """Stands for an agent or a verifier that is elsewhere, or could not be made."""

    name: str
    owner: str
    """The plugin that errors are blamed on."""
    versions: Mapping[str, str] = MappingProxyType({})
    """Version of the distribution that brings it, for records; empty if this host knows it."""


@dataclass(frozen=True)
class Unmade(StandIn):
    """Stand-in for an agent or a verifier that could not be made: its episode still has a record, which says why."""

    name: str
    owner: str
    fault: BaseException
    privileged: bool = False

    def begin(self, context: object) -> None:
        """Raise the factory's error."""
        raise self.fault

    decide = verify = begin


def origin(agent: object) -> str:
    """Return the package of an agent or a verifier, or the plugin that a stand-in names."""
    if isinstance(agent, StandIn):
        return agent.owner
    return type(agent).__module__.partition(".")[0]


def admit(value: T, kind: type[T], whose: str) -> T:
    """Return a decision or a verdict in a form that a record can hold.

    Raises TypeError for a value of another type or with a malformed field; it states the expected and the given
    value.
    """
    if not isinstance(value, kind):
        raise TypeError(f"{whose} {reprlib.repr(value)} and no {kind.__name__}")
    return _typed(recordable(value, kind), kind, f"{whose} a malformed {kind.__name__}: ")


def name_of(agent: Any) -> str:
    """Return the name of an agent or a verifier. Raises PluginRunError for a name that a record cannot hold."""
    with blaming(origin(agent)):
        return _typed(agent.name, Name, "name: ")


def is_privileged(agent: object) -> bool:
    """Tell whether an agent or a verifier is to be given scene and true state. Raises PluginRunError if it fails."""
    with blaming(origin(agent)):
        return bool(getattr(agent, "privileged", False))


def settings_of(agent: object) -> dict[str, Any]:
    """Return the current settings of an agent or a verifier; empty if it has none. Raises PluginRunError for settings
    that JSON cannot hold."""
    with blaming(origin(agent)):
        settings = getattr(agent, "settings", None) or {}
        try:
            read: dict[str, Any] = json.loads(_SETTINGS.dump_json(dict(settings)))
        except (TypeError, ValueError) as error:
            raise TypeError(f"settings are a mapping that JSON can hold; got {reprlib.repr(settings)}") from error
        return read


@functools.cache
def _reader(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def _typed(value: object, kind: type[T], whose: str) -> T:
    try:
        # mypy takes a class for unhashable.
        read: T = _reader(kind).validate_python(value, strict=True)  # type: ignore[arg-type]
    except ValidationError as error:
        came = error.errors(include_url=False)[0]["input"]
        raise TypeError(f"{whose}{first_fault(error)}; got {reprlib.repr(came)}") from None
    return read


def read_options(model: type[M], given: Mapping[str, Any]) -> M:
    """Check the options of `--option KEY=VALUE`. Raises HumanclawError that names the first wrong one and lists all."""
    try:
        return model(**given)
    except ValidationError as error:
        listed = f"The options are {', '.join(model.model_fields)}."
        raise HumanclawError(f"--option {first_fault(error)}.", listed) from None
