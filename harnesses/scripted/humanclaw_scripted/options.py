"""The options of scripted agents, as given by `--option KEY=VALUE`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from humanclaw import HumanclawError
from humanclaw.plugins import read_options
from humanclaw_scripted.faults import FAULTS


class OracleOptions(BaseModel):
    """Options of `--agent oracle`."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    words: Literal["map", "eyes"] = "map"
    """What its words are written from: the map that it knows, or its view alone, for training data."""


class VerifierOptions(BaseModel):
    """Options of `--verifier oracle`; those of the agent are ignored."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    miss: float = Field(0.0, ge=0, le=1)
    """Probability that it accepts a stop out of reach of the target."""


class FaultyOptions(OracleOptions):
    """Options of `--agent faulty`. history, images and mid_level mean the same as for a model."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    profile: str = "default"
    fault: str = "none"
    """A name of FAULTS, two of them joined by a plus sign, or `none`."""
    repair: str = ""
    """A capability whose faults are removed, to check a root cause."""
    history: int = Field(10, ge=0)
    images: int = Field(1, ge=1)
    mid_level: bool = True
    bounded: bool = False
    """Whether memory, attention and distance estimates have limits."""
    misjudged: float = Field(0.2, ge=0, le=1)
    """Probability that a bounded agent takes a target in view within 4 m to be within reach."""
    confusion: float = Field(0.1, ge=0)
    """Weight of each further picture against the current one in a bounded agent's attention."""
    miss: float = Field(0.0, ge=0, le=1)
    """Probability that the verifier `oracle` accepts a call that it should reject."""

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> FaultyOptions:
        """Check options. Raises HumanclawError that names the wrong one."""
        options = read_options(cls, given)
        unknown = {*options.fault.split("+")} - {*FAULTS, "none"}
        if unknown:
            raise HumanclawError(
                f"there is no fault {sorted(unknown)[0]!r}.", f"Choose from: {', '.join(FAULTS)}, none."
            )
        return options
