"""The options of scripted agents, as given by `--option KEY=VALUE`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from humanclaw import HumanclawError
from humanclaw_scripted.faults import FAULTS

M = TypeVar("M", bound=BaseModel)


class FaultyOptions(BaseModel):
    """Of `--agent faulty`. history, images and mid_level mean what they mean for a model."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    profile: str = "default"
    fault: str = "none"
    """A name of FAULTS, two of them joined by a plus sign, or `none`."""
    repair: str = ""
    """A capability whose faults are put right: the check of a root cause."""
    history: int = Field(10, ge=0)
    images: int = Field(1, ge=1)
    mid_level: bool = True
    bounded: bool = False
    """Whether memory, attention and the sense of distance have limits."""
    misjudged: float = Field(0.2, ge=0, le=1)
    """How often, within 4 m of a target in view, a bounded agent takes it to be within reach."""
    confusion: float = Field(0.1, ge=0)
    """How strongly each further picture competes with the current one for a bounded agent's attention."""
    miss: float = Field(0.0, ge=0, le=1)
    """Of the verifier `oracle`: how often it lets pass what it should reject."""

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> FaultyOptions:
        """Check options. Raises HumanclawError that says which is wrong."""
        found = _read(cls, given)
        unknown = {*found.fault.split("+")} - {*FAULTS, "none"}
        if unknown:
            raise HumanclawError(
                f"there is no fault {sorted(unknown)[0]!r}.", f"Choose from: {', '.join(FAULTS)}, none."
            )
        return found


class DetectorOptions(BaseModel):
    """Of `--agent seeing-colour`."""

    model_config = ConfigDict(frozen=True, extra="ignore", str_strip_whitespace=True)

    detector: str = Field(min_length=1)
    """The command line of a program that knows things in pictures."""
    score: float = Field(0.3, ge=0, le=1)
    """From which on it is believed."""
    seconds: float = Field(60.0, gt=0)
    """After which a program that has not answered is given up."""

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> DetectorOptions:
        """Check options. Raises HumanclawError that says which is wrong."""
        if not str(given.get("detector", "")).strip():
            told = "the agent 'seeing-colour' needs a program that knows things in pictures, and none was given."
            raise HumanclawError(
                told, "Give its command, as in --option detector='node detect.mjs'; the README of scripted tells more."
            )
        return _read(cls, given)


def _read(model: type[M], given: Mapping[str, Any]) -> M:
    """Check options. Raises HumanclawError that says which is wrong."""
    try:
        return model(**given)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "options"
        raise HumanclawError(
            f"--option {where}: {first['msg']}.", f"The options are {', '.join(model.model_fields)}."
        ) from None
