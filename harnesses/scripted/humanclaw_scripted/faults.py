"""Faults: missing capabilities of known effect, against which root causes are checked. faults.csv is their table.

Its column `task` says which sitting tasks show a fault: any (seated), one where the oracle only walks up to the target
(standing), or one where it first sits down on another seat (elsewhere). Every command loads the table, so this module
imports no agent; humanclaw_scripted.behaviours implements the faults.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from humanclaw import EpisodeSpec


@dataclass(frozen=True)
class Fault:
    """A missing capability, its effect, and the episodes that show it."""

    name: str
    capability: str
    cause: str
    """Label of HumanCLAW-Bench for the root cause that the fault should lead to."""
    description: str
    seated: bool = False
    """Whether only sitting tasks show it."""
    standing: bool = False
    """Whether the oracle only walks up to the target, and the fault does the rest."""
    elsewhere: bool = False
    """Whether the oracle first sits down on another seat."""
    ways: tuple[float, float] = (0.0, float("inf"))
    """Least and greatest length of the way in the episodes that show it, metres."""
    rooms: int = 1
    """Least number of rooms on the way in the episodes that show it."""

    @property
    def agent(self) -> str:
        """Name of the agent that can have this fault."""
        return "faulty"

    @property
    def options(self) -> Mapping[str, Any]:
        """Options of the agent for this fault."""
        return {"fault": self.name}

    def fits(self, spec: EpisodeSpec) -> bool:
        """Tell whether an episode can show this fault; True if the length of its way is unknown."""
        if self.seated and not spec.interact:
            return False
        way, (least, most) = spec.difficulty, self.ways
        return way is None or (least <= way.distance <= most and way.rooms >= self.rooms)


def _fault(row: Mapping[str, str]) -> Fault:
    task, ways = row["task"], (float(row["least_m"]), float(row["most_m"]))
    return Fault(
        row["name"], row["capability"], row["cause"], row["description"], seated=task != "",
        standing=task in ("standing", "elsewhere"), elsewhere=task == "elsewhere", ways=ways, rooms=int(row["rooms"]),
    )  # fmt: skip


_TABLE: Final = resources.files("humanclaw_scripted").joinpath("faults.csv").read_text("utf-8")
FAULTS: Final[Mapping[str, Fault]] = {row["name"]: _fault(row) for row in csv.DictReader(_TABLE.splitlines())}
"""Faults by the name for `--option fault=NAME`, in the order of the root causes. None leads to "too far": that cause
lies in the task."""
