"""Live logging of episodes while they run."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from humanclaw import Chunk, EpisodeRecord, HumanclawError, Motion, Plugins, Scene, StepRecord
from humanclaw.body import HISTORY
from humanclaw.storage import jpeg
from humanclaw_rerun.log import EpisodeLog


@dataclass
class _Open:
    """An episode in progress: its log, its next frame, and the first frame of the current step.

    before, body: last frame of the body before the current step, and now; None until the body has moved.
    """

    log: EpisodeLog
    frame: int = HISTORY
    first: int = HISTORY
    before: Motion | None = None
    body: Motion | None = None


class Live:
    """Logs every episode from its first chunk on.

    The observer hooks call its three methods. Several episodes may run at once if each has a thread of its own.
    """

    def __init__(self, target: str | Path) -> None:
        """target: the address of a viewer (rerun+http://...), or a folder for one file per episode, NAME.rrd."""
        self._target = str(target)
        self._open: dict[str, _Open] = {}

    def chunk(self, episode: EpisodeRecord, chunk: Chunk) -> None:
        """Log half a second of motion. Raises RecordError if the file cannot be written."""
        under_way, simulated = self._of(episode), chunk.execution.simulated
        # The view of the first step was taken before any motion; the first frame is closest to it.
        under_way.before = under_way.before or simulated[:1]
        under_way.body = simulated[-1:]
        under_way.log.body(simulated, chunk.commanded, under_way.frame)
        under_way.log.objects(chunk.execution.objects, under_way.frame)
        under_way.frame += len(chunk.commanded)

    def step(self, episode: EpisodeRecord, step: StepRecord, view: NDArray[np.uint8]) -> None:
        """Log a recorded step. view: ego view before the step, (height, width, 3)."""
        under_way = self._of(episode)
        under_way.log.view(jpeg(view), under_way.before, under_way.first)
        under_way.log.step(step, under_way.first)
        # A step can have several chunks, so its end is known only now.
        under_way.first, under_way.before = under_way.frame, under_way.body

    def end(self, episode: EpisodeRecord) -> None:
        """Close the recording of an episode."""
        self._of(episode).log.close()
        del self._open[episode.spec.id]

    def _of(self, episode: EpisodeRecord) -> _Open:
        name = episode.spec.id
        if name not in self._open:
            self._open[name] = _Open(EpisodeLog(episode, self._place(name)))
            _log_house(self._open[name].log, episode)
        return self._open[name]

    def _place(self, name: str) -> str:
        if "://" in self._target:
            return self._target
        Path(self._target).mkdir(parents=True, exist_ok=True)
        return str(Path(self._target) / f"{name}.rrd")


def _log_house(log: EpisodeLog, episode: EpisodeRecord) -> None:
    scene, note = house_of(episode, Plugins.discover())
    if scene:
        log.house(scene)
    if note:
        log.note(note)


def house_of(episode: EpisodeRecord, plugins: Plugins) -> tuple[Scene | None, str]:
    """Return the house of an episode and an empty note; None and the reason if it is missing or differs."""
    try:
        scene = plugins.scene(episode.spec.scene)
    except HumanclawError as fault:
        return None, f"The house is not drawn: {fault}"
    if episode.scene_digest and scene.digest != episode.scene_digest:
        return None, "The house is not drawn: the installed scene differs from the one of the record."
    return scene, ""
