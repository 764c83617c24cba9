"""The loop: an agent decides, the episode does the rest (paper, section 3)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from humanclaw.episodes.embodiment import Body
from humanclaw.episodes.episode import Clock, Episode
from humanclaw.plugins.agents import Agent, Verifier
from humanclaw.records.limits import Meter
from humanclaw.records.specification import EpisodeSpec
from humanclaw.records.steps import EpisodeRecord
from humanclaw.storage.files import Folder
from humanclaw.world.simulator import DistanceFactory


def run_episode(
    body: Body,
    spec: EpisodeSpec,
    agent: Agent,
    verifier: Verifier | None = None,
    *,
    folder: Path | str | Folder | None = None,
    options: Mapping[str, Any] | None = None,
    distance: DistanceFactory | None = None,
    meter: Meter | None = None,
    company: Sequence[str] = (),
    clock: Clock = "paused",
    begun: Callable[[], object] = lambda: None,
    stopping: Callable[[], bool] = lambda: False,
) -> EpisodeRecord:
    """Run one episode to its end. See Episode for the arguments.

    begun: called once, as soon as the agent and the verifier have begun.
    stopping: called before each step; if true, the episode ends there and is recorded as interrupted.

    A provider's failure, a plugin's error and a limit are outcomes. If the record's `limit` is "run", begin no further
    episode. Every other exception, KeyboardInterrupt included, is raised again once the record is closed.
    """
    with Episode(
        body,
        spec,
        agent,
        verifier,
        folder=folder,
        options=options,
        distance=distance,
        meter=meter,
        company=company,
        clock=clock,
    ) as episode:
        begun()
        while not (episode.done or stopping()):
            episode.ask()
    return episode.record
