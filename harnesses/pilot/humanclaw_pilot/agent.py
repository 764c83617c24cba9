"""The pilot: it sees by a network that was trained here, and goes by the planner of the agent `seeing`.

The planner asks for depth and ids of its view. Here both are the network's guesses from the picture, so nothing that
only the simulator knows is used.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field
from scipy.ndimage import maximum_filter, minimum_filter

from humanclaw import Decision, EpisodeContext, HistoryEntry, Observation, PluginError, Plugins
from humanclaw.body import rest_pose
from humanclaw.plugins import read_options
from humanclaw.world import BODY_ID, CameraMount, View, ego_camera
from humanclaw_pilot.network import CELLS, CLASSES, WEIGHTS, Eyes, Floats, Glance

TARGET: Final = 1
"""Id of what the network takes for the target; other things have THING."""
THING: Final = 2
EDGE: Final = 0.5
"""Ratio (logarithm) of the depths of neighbouring cells from which they are the edge of something."""
CLEAR: Final = 3.5
"""Farthest obstacle that is believed, metres."""
NEARER: Final = 0.7
"""Share of that range which is left each time a search begins anew."""
DEEPER: Final = 0.18
"""Metres by which a seat is taken to be farther than guessed, and"""
THROUGH: Final = 0.4
"""another target: who stops too early fails, who touches it does not."""
AGAIN: Final = 12
"""How often a search begins anew with an empty map, as guessed obstacles can close a passage and sightings be wrong."""
LATELY: Final = 3
"""Views in which the target must have been seen for the pilot to stop at it."""


class PilotOptions(BaseModel):
    """Options of `--agent pilot`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    profile: str = "default"
    """Ignored; accepted so that one command line serves models and the pilot."""
    certain: float = Field(0.8, gt=0, lt=1)
    """Share of the network's answer from which a cell shows the target."""
    weights: Path = WEIGHTS
    """File of the network's weights."""


class PilotAgent:
    """Pictures, instruction and feedback in, calls and words out."""

    name, privileged = "pilot", False

    def __init__(self, options: Mapping[str, Any]) -> None:
        self._options = read_options(PilotOptions, options)
        self._look = Eyes.read(self._options.weights)
        self.settings = self._options.model_dump() | {"weights": self._look.digest, "words": "eyes"}

    def begin(self, context: EpisodeContext) -> None:
        if context.spec.target_category not in CLASSES:
            message = f"the pilot knows {', '.join(CLASSES[3:])}, and not {context.spec.target_category!r}."
            raise PluginError(message, "Name one of these in the instruction.")
        spec = context.spec.model_copy(update={"target_ids": (TARGET,)})
        self._context = replace(context, spec=spec, scene=None, state=None, view=lambda: self._view)
        self._kind = CLASSES.index(spec.target_category)
        self._left, self._sat = AGAIN, False
        self._renew()

    def _renew(self) -> None:
        self._planner = _plugins().make("agents", "seeing", {})
        self._planner.begin(self._context)
        self._unseen = LATELY

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        glance = self._look(observation.rgb)
        mine = glance.share[self._kind] > self._options.certain
        clear = CLEAR * NEARER ** (AGAIN - self._left)
        deeper = DEEPER if self._context.spec.interact else THROUGH
        self._view = imagined(observation.rgb, glance, mine, self._context.gaze, clear, deeper)
        self._unseen = 0 if mine.any() else self._unseen + 1
        decision: Decision = self._planner.decide(observation, history)
        while self._left and self._calls(decision, "stop") and not (self._unseen < LATELY or self._sat):
            self._left -= 1
            self._renew()
            decision = self._planner.decide(observation, history)
        self._sat = self._calls(decision, "sit")
        return decision

    def _calls(self, decision: Decision, role: str) -> bool:
        return any(self._context.skills[call.skill].role == role for call in decision.calls)


def imagined(
    rgb: NDArray[np.uint8], glance: Glance, mine: NDArray[np.bool_], gaze: CameraMount, clear: float, deeper: float
) -> View:
    """Return the view that a glance means. mine: the cells (CELLS, CELLS) of the target.

    clear: the farthest obstacle that is believed, and deeper: how much farther the target is taken to be, metres.
    Floor is where a level floor is seen from standing eyes, whatever depth was guessed.
    """
    kinds, logs = glance.share.argmax(0), np.log(glance.depth)
    floor = (kinds == CLASSES.index("floor")) & ~mine
    # Where something ends before another, the guess lies between the two: an obstacle that is not there.
    sure = (maximum_filter(logs, 3) - minimum_filter(logs, 3) < EDGE) & (glance.depth < clear)
    ids = np.select([mine, kinds == CLASSES.index("body"), floor | sure], [TARGET, BODY_ID, THING], 0)
    ids, depth, floor = (_enlarged(part, len(rgb) // CELLS) for part in (ids, glance.depth, floor))
    depth = depth + deeper * (ids == TARGET)
    level = _floor_depth(len(rgb), gaze)
    return View(rgb, np.where(floor & np.isfinite(level), level, depth).astype(np.float32), ids.astype(np.int32))


def _enlarged(grid: NDArray[Any], side: int) -> NDArray[Any]:
    return grid.repeat(side, 0).repeat(side, 1)


def _floor_depth(rows: int, gaze: CameraMount) -> Floats:
    """Return (rows, 1) depth of a level floor in each row of a view; infinite above the horizon."""
    up = 1 - (np.arange(rows) + 0.5) / (rows / 2)
    fall = -(np.sin(gaze.pitch) + up * np.cos(gaze.pitch))
    high = float(ego_camera(rest_pose(), gaze=gaze).position[1])
    return np.asarray(np.where(fall > 0.02, high / np.maximum(fall, 0.02), np.inf)[:, None], np.float32)


@lru_cache(1)
def _plugins() -> Plugins:
    """Return the installed plugins: a factory of agents gets options alone, and not the plugins of the run."""
    return Plugins.discover()
