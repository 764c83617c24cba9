"""The options of scripted agents, as given by `--option KEY=VALUE`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import AliasChoices, BaseModel, ConfigDict, Field

from humanclaw import HumanclawError
from humanclaw.plugins import read_options
from humanclaw_scripted.faults import FAULTS


class OracleOptions(BaseModel):
    """Options of `--agent oracle`."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    words: Literal["map", "eyes"] = "map"
    """What its words are written from: the map that it knows, or its view alone, for training data."""


class GuessOptions(BaseModel):
    """Options of `--agent guess`."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    first: bool = False
    """Whether it always answers with the first option, instead of one at random."""


class VerifierOptions(BaseModel):
    """Options of `--verifier oracle`; those of the agent are ignored."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    miss: float = Field(0.0, ge=0, le=1, validation_alias=AliasChoices("verifier_miss", "miss"))
    """Probability that it accepts a stop out of reach of the target."""


class FaultyOptions(OracleOptions):
    """Options of `--agent faulty`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    profile: str = "default"
    fault: str = "none"
    """A name of FAULTS, or `none`."""
    repair: str = ""
    """A capability whose faults are removed, to check a root cause."""
    miss: float = Field(0.0, ge=0, le=1)
    """Probability that the verifier `oracle` accepts a call that it should reject."""

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> FaultyOptions:
        """Check options. Raises HumanclawError that names the wrong one."""
        options = read_options(cls, given)
        if options.fault not in (*FAULTS, "none"):
            raise HumanclawError(f"there is no fault {options.fault!r}.", f"Choose from: {', '.join(FAULTS)}, none.")
        known = sorted({fault.capability for fault in FAULTS.values()})
        if options.repair not in ("", *known):
            raise HumanclawError(f"no fault is of {options.repair!r}.", f"repair is one of: {', '.join(known)}.")
        return options
